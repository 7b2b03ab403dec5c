//! Which places lie inside of bodies, where nobody sees them and their darkness says nothing.
//!
//! A place is inside if more than half of the directions over it first meet a *back* that has an inside behind it: that of a
//! material with one side, or of a closed shell whatever its material (many exporters call every material double-sided).

use dapple_scene::glam::Vec3;
use dapple_scene::{Mesh, Scene};
use rayon::prelude::*;

use crate::rtao::Site;
use crate::sampling::{fixed_pattern, hash, orthonormal_basis};
use crate::{Ray, Tracer, offset_origin};

/// Most directions asked a place.
const RAYS: u32 = 64;

/// After so many directions a share of backs that is this far from the limit decides: each prefix of a pattern covers the
/// hemisphere evenly.
const SETTLED: [(usize, f64); 4] = [(4, 0.5), (8, 0.5), (16, 0.25), (32, 0.15)];

/// Of which triangles the back is an inside, for all meshes of a scene.
#[derive(Clone, Debug, Default)]
pub struct Solids {
    /// For each mesh a flag a triangle; one for all where they agree.
    of_mesh: Vec<Flags>,
}

#[derive(Clone, Debug)]
enum Flags {
    All(bool),
    Each(Vec<bool>),
}

impl Solids {
    /// Finds the closed shells of all meshes, in parallel. O(n log n) in the triangles.
    pub fn new(scene: &Scene) -> Solids {
        let of_mesh = scene.meshes.par_iter().map(|mesh| {
            let is_single = |material: u32| !scene.materials[material as usize].double_sided;
            if mesh.parts.iter().all(|part| is_single(part.material)) {
                return Flags::All(true);
            }
            let mut flags = closed_shells(mesh);
            for part in mesh.parts.iter().filter(|part| is_single(part.material)) {
                let first = part.first_triangle as usize;
                flags[first..first + part.triangle_count as usize].fill(true);
            }
            match flags.first() {
                Some(&first) if flags.iter().all(|flag| *flag == first) => Flags::All(first),
                _ => Flags::Each(flags),
            }
        });
        Solids { of_mesh: of_mesh.collect() }
    }

    /// Whether behind this triangle there is an inside.
    pub fn has_inside(&self, mesh: u32, triangle: u32) -> bool {
        match self.of_mesh.get(mesh as usize) {
            Some(Flags::All(flag)) => *flag,
            Some(Flags::Each(flags)) => flags.get(triangle as usize).copied().unwrap_or(false),
            None => false,
        }
    }
}

/// Whether each of the sites lies inside of something. `scene` is the one that tracer and solids were made for.
///
/// # Panics
///
/// If `sites` and `inside` differ in length.
pub fn find_inside(scene: &Scene, tracer: &Tracer, solids: &Solids, sites: &[Site], inside: &mut [bool]) {
    assert_eq!(sites.len(), inside.len(), "one answer for each site");
    sites.par_iter().zip(inside).with_min_len(64).for_each_init(Vec::new, |directions, (site, inside)| {
        *inside = is_inside(scene, tracer, solids, site, directions);
    });
}

/// Whether one site lies inside of something; `directions` is a buffer.
pub fn is_inside(
    scene: &Scene,
    tracer: &Tracer,
    solids: &Solids,
    site: &Site,
    directions: &mut Vec<Vec3>,
) -> bool {
    let normal = site.normal_world;
    if !normal.is_finite() || normal == Vec3::ZERO {
        return false;
    }
    let origin_world = offset_origin(site.position_world, normal);
    let (tangent, bitangent) = orthonormal_basis(normal);
    fixed_pattern(RAYS, hash(0, site.key, 0), directions);
    mostly_backs(directions, &SETTLED, 0.5, |d| {
        let direction_world = tangent * d.x + bitangent * d.y + normal * d.z;
        let hit = tracer.closest_hit(&Ray { origin_world, direction_world, t_max: f32::MAX });
        hit.is_some_and(|hit| {
            hit.back_face && solids.has_inside(scene.instances[hit.instance as usize].mesh, hit.triangle)
        })
    })
}

/// Whether more than `limit` of the directions meet a back. They are asked in order, and no more once one of `settled` (after
/// so many of them, so far from the limit) decides.
pub(crate) fn mostly_backs(
    directions: &[Vec3],
    settled: &[(usize, f64)],
    limit: f64,
    mut is_back: impl FnMut(Vec3) -> bool,
) -> bool {
    let mut backs = 0u32;
    for (shot, direction) in directions.iter().enumerate() {
        let share = f64::from(backs) / shot.max(1) as f64;
        if settled.iter().any(|&(rays, margin)| shot == rays && (share - limit).abs() >= margin) {
            return share > limit;
        }
        backs += u32::from(is_back(*direction));
    }
    f64::from(backs) > limit * directions.len() as f64
}

/// For each triangle whether it is part of a closed shell: triangles joined by edges, none of which has a free border.
/// Corners at equal positions are one.
fn closed_shells(mesh: &Mesh) -> Vec<bool> {
    let place_of = weld(&mesh.positions);
    let corners: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|v| place_of[v as usize])).collect();
    // An edge both ways: (low, high, runs from high to low, triangle).
    let mut edges = Vec::with_capacity(3 * corners.len());
    for (t, [a, b, c]) in (0u32..).zip(&corners) {
        // A triangle without area bounds nothing, and what it joins is joined without it or not closed.
        if a == b || b == c || c == a {
            continue;
        }
        for (from, to) in [(a, b), (b, c), (c, a)] {
            edges.push((*from.min(to), *from.max(to), from > to, t));
        }
    }
    edges.par_sort_unstable();
    let mut shells = Shells::new(corners.len());
    for around in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        // As many triangles run one way along the edge as the other: nothing ends here.
        let turned = around.iter().filter(|edge| edge.2).count();
        let ends = 2 * turned != around.len();
        for pair in around.windows(2) {
            shells.join(pair[0].3, pair[1].3);
        }
        if ends {
            shells.open(around[0].3);
        }
    }
    (0..corners.len() as u32).map(|t| !shells.is_open(t)).collect()
}

/// For each position the first that is equal to it (−0 is 0).
fn weld(positions: &[Vec3]) -> Vec<u32> {
    let key = |i: u32| positions[i as usize].to_array().map(|x| if x == 0.0 { 0 } else { x.to_bits() });
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.par_sort_unstable_by_key(|&i| (key(i), i));
    let mut first = vec![0; positions.len()];
    for same in order.chunk_by(|&a, &b| key(a) == key(b)) {
        for &i in same {
            first[i as usize] = same[0];
        }
    }
    first
}

/// Triangles joined to shells, with a mark on those that have a border.
struct Shells {
    parent: Vec<u32>,
    open: Vec<bool>,
}

impl Shells {
    fn new(count: usize) -> Shells {
        Shells { parent: (0..count as u32).collect(), open: vec![false; count] }
    }

    fn root(&mut self, mut t: u32) -> u32 {
        while self.parent[t as usize] != t {
            let above = self.parent[t as usize];
            self.parent[t as usize] = self.parent[above as usize];
            t = above;
        }
        t
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        if a != b {
            let (low, high) = (a.min(b), a.max(b));
            self.parent[high as usize] = low;
            self.open[low as usize] |= self.open[high as usize];
        }
    }

    fn open(&mut self, t: u32) {
        let root = self.root(t);
        self.open[root as usize] = true;
    }

    fn is_open(&mut self, t: u32) -> bool {
        let root = self.root(t);
        self.open[root as usize]
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use dapple_scene::Material;
    use dapple_scene::glam::Affine3A;

    use super::*;
    use crate::test_support::{cube, joined, mesh, quad, scene, sphere};

    fn inside(scene: &Scene, sites: &[(Vec3, Vec3)]) -> Vec<bool> {
        let tracer = Tracer::new(scene, &posed(scene));
        let solids = Solids::new(scene);
        let sites: Vec<Site> = (0u64..)
            .zip(sites)
            .map(|(key, &(position_world, normal_world))| Site { position_world, normal_world, key })
            .collect();
        let mut answers = vec![false; sites.len()];
        find_inside(scene, &tracer, &solids, &sites, &mut answers);
        answers
    }

    /// All instances where their mesh stands.
    fn posed(scene: &Scene) -> dapple_scene::Pose {
        let instance = dapple_scene::PosedInstance { world_from_mesh: Affine3A::IDENTITY, deformed: None };
        dapple_scene::Pose { instances: vec![instance; scene.instances.len()], ..Default::default() }
    }

    /// A floor with a cube on it, from 0 to 1.
    fn cube_on_floor(double_sided: bool, lid: bool) -> Scene {
        let floor = quad(
            Vec3::new(-5.0, 0.0, 5.0),
            Vec3::new(5.0, 0.0, 5.0),
            Vec3::new(5.0, 0.0, -5.0),
            Vec3::new(-5.0, 0.0, -5.0),
        );
        let mut body = cube();
        if !lid {
            // Without its top the cube is no shell any more.
            body.triangles.retain(|t| !t.iter().all(|&v| body.positions[v as usize].y == 1.0));
            body.parts[0].triangle_count = body.triangles.len() as u32;
        }
        let (mut scene, _) = scene(vec![floor, body], &[(0, Affine3A::IDENTITY), (1, Affine3A::IDENTITY)]);
        scene.materials[0] = Material { double_sided, ..Material::default() };
        scene
    }

    #[test]
    fn the_floor_under_a_body_is_inside() {
        let sites = [
            (Vec3::new(0.5, 0.0, 0.5), Vec3::Y),
            (Vec3::new(0.01, 0.0, 0.01), Vec3::Y),
            (Vec3::new(-0.01, 0.0, 0.5), Vec3::Y),
            (Vec3::new(3.0, 0.0, 0.0), Vec3::Y),
            (Vec3::new(0.5, 1.0, 0.5), Vec3::Y),
        ];
        let expected = [true, true, false, false, false];
        assert_eq!(inside(&cube_on_floor(false, true), &sites), expected, "one side");
        assert_eq!(
            inside(&cube_on_floor(true, true), &sites),
            expected,
            "a closed shell of two-sided sheets"
        );
        assert_eq!(inside(&cube_on_floor(true, false), &sites), [false; 5], "a box without a lid");
    }

    #[test]
    fn shells_are_told_apart() {
        let ball = sphere(Vec3::new(4.0, 0.0, 0.0), 1.0, 8, 12);
        let sheet = quad(Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y);
        let balls = ball.triangles.len();
        let both = joined([ball, sheet]);
        let closed = closed_shells(&both);
        assert!(closed[..balls].iter().all(|c| *c));
        assert_eq!(closed[balls..], [false, false]);
        // With every corner of its own, as files without normals are loaded.
        let positions = both.triangles.iter().flatten().map(|&v| both.positions[v as usize]).collect();
        let triangles = (0..both.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        assert_eq!(closed_shells(&mesh(positions, triangles)), closed);
        // A triangle that is turned over leaves a border of three edges.
        let mut turned = cube();
        turned.triangles[3].reverse();
        assert_eq!(closed_shells(&turned), vec![false; 12]);
        assert_eq!(closed_shells(&cube()), vec![true; 12]);
        assert!(closed_shells(&mesh(vec![], vec![])).is_empty());
    }
}
