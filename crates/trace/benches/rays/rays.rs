//! The same questions for everybody: points on a mesh's surface, and rays from them.

use dapple_scene::glam::Vec3;
use dapple_trace::offset_origin;
use dapple_trace::sampling::{fixed_pattern, hash, orthonormal_basis, unit_interval};

use crate::scenes::Triangles;

/// Rays of a point.
pub(crate) const RAYS: usize = 64;

/// A point's directions with each coordinate on its own, for packets.
pub(crate) type Directions = [[f32; RAYS]; 3];

/// Rays from points on a surface, neighbours in space one after the other.
pub(crate) struct Batch {
    pub(crate) origins: Vec<Vec3>,
    /// [`RAYS`] unit vectors a point: what users of the tracer hold.
    pub(crate) directions: Vec<Vec3>,
    /// The same, arranged for packets, so that arranging them is not timed.
    pub(crate) arranged: Vec<Directions>,
}

impl Batch {
    /// Points uniform by area on the fronts of the triangles, in Morton order, with the fixed cosine pattern of each.
    pub(crate) fn new(mesh: &Triangles, points: usize) -> Batch {
        let mut batch = Batch { origins: Vec::new(), directions: Vec::new(), arranged: Vec::new() };
        let mut pattern = Vec::new();
        for (site, (position, normal)) in place(mesh, points).into_iter().enumerate() {
            batch.origins.push(offset_origin(position, normal));
            fixed_pattern(RAYS as u32, hash(1, site as u64, 0), &mut pattern);
            let (t, b) = orthonormal_basis(normal);
            let mut arranged = [[0.0; RAYS]; 3];
            for (i, d) in pattern.iter().enumerate() {
                let d = t * d.x + b * d.y + normal * d.z;
                batch.directions.push(d);
                for (axis, value) in arranged.iter_mut().zip(d.to_array()) {
                    axis[i] = value;
                }
            }
            batch.arranged.push(arranged);
        }
        batch
    }

    /// Points.
    pub(crate) fn len(&self) -> usize {
        self.origins.len()
    }

    /// A point's directions.
    #[inline]
    pub(crate) fn directions(&self, point: usize) -> &[Vec3] {
        &self.directions[point * RAYS..][..RAYS]
    }
}

/// Positions and unit normals.
fn place(mesh: &Triangles, points: usize) -> Vec<(Vec3, Vec3)> {
    let corners = |t: &[u32; 3]| t.map(|i| mesh.positions[i as usize]);
    let mut sum = 0.0;
    let sums: Vec<f64> = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = corners(t);
            sum += f64::from((b - a).cross(c - a).length());
            sum
        })
        .collect();
    let (min, size) = (mesh.bounds.min, mesh.bounds.max - mesh.bounds.min);
    let random = |site: usize, sample: u32| unit_interval(hash(0, site as u64, sample));
    let mut placed: Vec<(u64, Vec3, Vec3)> = (0..points)
        .filter_map(|site| {
            // Stratified, so that few points spread well, too.
            let pick = (site as f64 + f64::from(random(site, 0))) / points as f64 * sum;
            let triangle = sums.partition_point(|s| *s <= pick).min(sums.len().checked_sub(1)?);
            let [a, b, c] = corners(&mesh.triangles[triangle]);
            let (mut u, mut v) = (random(site, 1), random(site, 2));
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let position = a + (b - a) * u + (c - a) * v;
            let normal = (b - a).cross(c - a).try_normalize()?;
            Some((morton((position - min) / size.max_element()), position, normal))
        })
        .collect();
    placed.sort_by_key(|p| p.0);
    placed.into_iter().map(|(_, position, normal)| (position, normal)).collect()
}

/// Interleaved bits of a place in the unit cube.
fn morton(place: Vec3) -> u64 {
    let [x, y, z] = (place * 1023.0).to_array().map(|v| v as u32);
    (0..10).fold(0, |m, bit| {
        let b = |v: u32| u64::from(v >> bit & 1);
        m | (b(x) | b(y) << 1 | b(z) << 2) << (3 * bit)
    })
}
