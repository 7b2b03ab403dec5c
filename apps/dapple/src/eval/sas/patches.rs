//! Patches: pairs of triangles that share an edge, each laid into a rectangle.

use std::collections::HashMap;

use dapple_scene::Mesh;
use dapple_scene::glam::Vec3;

/// Least cosine between the normals of two triangles of one patch.
const LEAST_COSINE: f32 = 0.7;

/// One or two triangles in the unit square: the first has its apex at (0, 0) and its other corners at (1, 0) and (0, 1), which the
/// second shares; the apex of that is at (1, 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Patch {
    /// Vertices at (0, 0), (1, 0), (0, 1).
    pub(super) corners: [u32; 3],
    /// Vertex at (1, 1), if there is a second triangle.
    pub(super) opposite: Option<u32>,
}

/// Where a triangle lies in its patch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place {
    patch: u32,
    /// Whether it is the second one.
    second: bool,
    /// Which of its corners is the apex.
    apex: u8,
}

/// All triangles of a mesh in patches.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Patches {
    pub(super) patches: Vec<Patch>,
    of_triangle: Vec<Place>,
}

/// A triangle's vertices from its corner `apex` on.
fn from_apex(triangle: [u32; 3], apex: usize) -> [u32; 3] {
    [triangle[apex], triangle[(apex + 1) % 3], triangle[(apex + 2) % 3]]
}

impl Patches {
    /// Pairs each triangle with a free neighbour of the same part that turns little, across its longest edge if it can. Vertices at
    /// one place count as one.
    pub(super) fn new(mesh: &Mesh) -> Patches {
        let mut ids: HashMap<[u32; 3], u32> = HashMap::new();
        let weld: Vec<u32> = (mesh.positions.iter())
            .map(|p| {
                let next = ids.len() as u32;
                *ids.entry(p.to_array().map(f32::to_bits)).or_insert(next)
            })
            .collect();
        let corner = |v: u32| mesh.positions[v as usize];
        let part_of =
            |triangle: usize| mesh.parts.partition_point(|part| part.first_triangle as usize <= triangle);
        let normal = |t: [u32; 3]| {
            (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).normalize_or_zero()
        };
        // The edge opposite of each corner, by its ends in the order of the triangle.
        let mut across: HashMap<(u32, u32), Vec<(u32, u8)>> = HashMap::new();
        for (index, triangle) in mesh.triangles.iter().enumerate() {
            for apex in 0..3 {
                let [_, p, q] = from_apex(*triangle, apex).map(|v| weld[v as usize]);
                across.entry((p, q)).or_default().push((index as u32, apex as u8));
            }
        }
        let mut places: Vec<Option<Place>> = vec![None; mesh.triangles.len()];
        let mut patches = Vec::new();
        for (index, &triangle) in mesh.triangles.iter().enumerate() {
            if places[index].is_some() {
                continue;
            }
            let length = |apex: usize| {
                let [_, p, q] = from_apex(triangle, apex);
                corner(p).distance_squared(corner(q))
            };
            let mut apexes = [0, 1, 2];
            apexes.sort_by(|a, b| length(*b).total_cmp(&length(*a)));
            let partner = apexes.iter().find_map(|&apex| {
                let [_, p, q] = from_apex(triangle, apex).map(|v| weld[v as usize]);
                let fits = |other: u32| {
                    let other = other as usize;
                    other != index
                        && places[other].is_none()
                        && part_of(other) == part_of(index)
                        && normal(mesh.triangles[other]).dot(normal(triangle)) >= LEAST_COSINE
                };
                let found = across.get(&(q, p))?.iter().find(|(other, _)| fits(*other))?;
                Some((apex, *found))
            });
            let patch = patches.len() as u32;
            let (apex, opposite) = match partner {
                Some((apex, (other, other_apex))) => {
                    places[other as usize] = Some(Place { patch, second: true, apex: other_apex });
                    (apex, Some(mesh.triangles[other as usize][usize::from(other_apex)]))
                }
                None => (apexes[0], None),
            };
            places[index] = Some(Place { patch, second: false, apex: apex as u8 });
            patches.push(Patch { corners: from_apex(triangle, apex), opposite });
        }
        Patches { patches, of_triangle: places.into_iter().flatten().collect() }
    }

    /// The patch of a place in a triangle, given by the weights of its corners 1 and 2, and where it is in the unit square.
    pub(super) fn find(&self, triangle: u32, [w1, w2]: [f32; 2]) -> Option<(u32, [f32; 2])> {
        let place = self.of_triangle.get(triangle as usize)?;
        let weights = [1.0 - w1 - w2, w1, w2];
        let apex = usize::from(place.apex);
        let (next, last) = (weights[(apex + 1) % 3], weights[(apex + 2) % 3]);
        // The second triangle runs along the shared edge the other way: its next corner lies at (0, 1).
        let at = if place.second { [1.0 - next, 1.0 - last] } else { [next, last] };
        Some((place.patch, at.map(|c| c.clamp(0.0, 1.0))))
    }
}

impl Patch {
    /// A place and the unit normal there; `corner` gives where vertices are. Beyond the only triangle that of its nearest edge.
    pub(super) fn surface(&self, [u, v]: [f32; 2], corner: impl Fn(u32) -> Vec3) -> (Vec3, Vec3) {
        let [apex, p, q] = self.corners.map(&corner);
        let turn = |a: Vec3, b: Vec3| a.cross(b).normalize_or_zero();
        if u + v <= 1.0 {
            return (apex + u * (p - apex) + v * (q - apex), turn(p - apex, q - apex));
        }
        match self.opposite.map(&corner) {
            Some(s) => (s + (1.0 - u) * (q - s) + (1.0 - v) * (p - s), turn(q - s, p - s)),
            None => {
                let along = 0.5 * (1.0 + u - v);
                (q + along * (p - q), turn(p - apex, q - apex))
            }
        }
    }

    /// Lengths of its longer sides along u and along v.
    pub(super) fn sides(&self, corner: impl Fn(u32) -> Vec3) -> [f32; 2] {
        let [apex, p, q] = self.corners.map(&corner);
        let (u, v) = (apex.distance(p), apex.distance(q));
        match self.opposite.map(&corner) {
            Some(s) => [u.max(q.distance(s)), v.max(p.distance(s))],
            None => [u, v],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Mesh {
        Mesh {
            name: "m".to_owned(),
            positions: positions.iter().copied().map(Vec3::from).collect(),
            normals: vec![Vec3::Z; positions.len()],
            tangents: Vec::new(),
            uvs: [Vec::new(), Vec::new()],
            colors: Vec::new(),
            influences: Vec::new(),
            morph_targets: Vec::new(),
            morph_weights: Vec::new(),
            triangles: triangles.to_vec(),
            parts: vec![dapple_scene::Part {
                first_triangle: 0,
                triangle_count: triangles.len() as u32,
                material: 0,
            }],
        }
    }

    /// What [`Patches::find`] says of any place in any triangle is where [`Patch::surface`] finds it again.
    fn check_round_trip(mesh: &Mesh) {
        let patches = Patches::new(mesh);
        let corner = |v: u32| mesh.positions[v as usize];
        for (index, triangle) in mesh.triangles.iter().enumerate() {
            for weights in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.2, 0.3], [0.6, 0.1]] {
                let [a, b, c] = triangle.map(corner);
                let expected = a + weights[0] * (b - a) + weights[1] * (c - a);
                let (patch, at) = patches.find(index as u32, weights).unwrap();
                let (place, normal) = patches.patches[patch as usize].surface(at, corner);
                assert!(place.distance(expected) < 1e-5, "{index} {weights:?}: {place} {expected}");
                assert!(normal.dot((b - a).cross(c - a)) > 0.0);
            }
        }
    }

    #[test]
    fn a_square_is_one_patch_across_its_diagonal() {
        // The second triangle has vertices of its own.
        let square = [[0., 0., 0.], [2., 0., 0.], [2., 1., 0.], [0., 1., 0.], [0., 0., 0.], [2., 1., 0.]];
        let mesh = mesh(&square, &[[0, 1, 2], [5, 3, 4]]);
        let patches = Patches::new(&mesh);
        assert_eq!(patches.patches.len(), 1);
        assert_eq!(patches.patches[0].sides(|v| mesh.positions[v as usize]), [1.0, 2.0]);
        check_round_trip(&mesh);
    }

    #[test]
    fn what_turns_stays_apart_and_a_row_pairs_up() {
        let fold = mesh(&[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]], &[[0, 1, 2], [1, 0, 3]]);
        assert_eq!(Patches::new(&fold).patches.len(), 2);
        check_round_trip(&fold);
        let row: Vec<[f32; 3]> = (0..8).map(|i| [(i / 2) as f32, (i % 2) as f32, 0.0]).collect();
        let triangles: Vec<[u32; 3]> =
            (0..3).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 1], [2 * i + 1, 2 * i + 2, 2 * i + 3]]).collect();
        let row = mesh(&row, &triangles);
        assert_eq!(Patches::new(&row).patches.len(), 3);
        check_round_trip(&row);
        let degenerate = mesh(&[[0.; 3], [0.; 3], [1., 0., 0.]], &[[0, 1, 2], [0, 2, 1]]);
        assert_eq!(Patches::new(&degenerate).of_triangle.len(), 2);
    }
}
