//! Triangle shapes to build scenes from: closed ones are counter-clockwise from outside; texture coordinates are metres.

mod building;
mod loft;
mod organic;
mod swept;

use glam::{Affine3A, Vec2, Vec3};

pub use building::{arcade_wall, ring_slab, ring_slab_faces, stairs};
pub use loft::{Girth, between, loft, oval};
pub use organic::{ball, boulder, boulder_points, cloth};
pub use swept::{Frame, arc_frames, circle, lathe, rectangle, sweep, tube};

/// Triangles with unit normals and texture coordinates; all three lists of vertices are equally long.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Geometry {
    /// Positions, metres.
    pub positions: Vec<Vec3>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
    /// Texture coordinates in metres on the surface (v down).
    pub uvs: Vec<Vec2>,
    /// Vertex indices, counter-clockwise from the front.
    pub triangles: Vec<[u32; 3]>,
}

impl Geometry {
    /// Nothing.
    pub fn new() -> Geometry {
        Geometry::default()
    }

    /// Adds a vertex and returns its index.
    pub fn vertex(&mut self, position: Vec3, normal: Vec3, uv: Vec2) -> u32 {
        let index = self.positions.len() as u32;
        self.positions.push(position);
        self.normals.push(normal);
        self.uvs.push(uv);
        index
    }

    /// Adds a flat convex polygon, counter-clockwise from the front, as a fan around its first corner,
    /// with its own vertices and coordinates from [`planar_uv`].
    pub fn polygon(&mut self, corners: &[Vec3]) {
        let mut normal = Vec3::ZERO;
        for (i, &a) in corners.iter().enumerate() {
            normal += a.cross(corners[(i + 1) % corners.len()]);
        }
        let normal = normal.normalize_or(Vec3::Y);
        let first = self.positions.len() as u32;
        for &p in corners {
            self.vertex(p, normal, planar_uv(normal, p));
        }
        for i in 2..corners.len() as u32 {
            self.triangles.push([first, first + i - 1, first + i]);
        }
    }

    /// Adds all of another geometry, placed by a rigid map with uniform scale.
    pub fn append(&mut self, other: &Geometry, placement: &Affine3A) {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions.iter().map(|&p| placement.transform_point3(p)));
        self.normals.extend(other.normals.iter().map(|&n| placement.transform_vector3(n).normalize_or(n)));
        self.uvs.extend_from_slice(&other.uvs);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
    }

    /// Adds all of another geometry, moved.
    pub fn append_at(&mut self, other: &Geometry, offset: Vec3) {
        self.append(other, &Affine3A::from_translation(offset));
    }

    /// Volume enclosed by a closed geometry, cubic metres; negative if it is inside out.
    pub fn signed_volume(&self) -> f32 {
        self.triangle_corners().map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    /// Area, square metres.
    pub fn area(&self) -> f32 {
        self.triangle_corners().map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).sum()
    }

    fn triangle_corners(&self) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        self.triangles.iter().map(|t| t.map(|i| self.positions[i as usize]))
    }
}

/// Coordinates in metres on a plane with the given unit normal: level surfaces are mapped by (x, z), others by
/// (way along the horizontal, −y), so that neighbouring faces of one orientation fit together.
pub fn planar_uv(normal: Vec3, p: Vec3) -> Vec2 {
    if normal.y.abs() > 0.7 {
        Vec2::new(p.x, p.z)
    } else {
        let along = Vec3::Y.cross(normal).normalize_or(Vec3::X);
        Vec2::new(along.dot(p), -p.y)
    }
}

/// An axis-aligned box.
pub fn cuboid(min: Vec3, max: Vec3) -> Geometry {
    let mut g = Geometry::new();
    let p = |i: u32| {
        let pick = |bit: u32, lo: f32, hi: f32| if i & bit == 0 { lo } else { hi };
        Vec3::new(pick(1, min.x, max.x), pick(2, min.y, max.y), pick(4, min.z, max.z))
    };
    for face in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
        g.polygon(&face.map(p));
    }
    g
}

/// A box with edges cut at 45° over `bevel` metres (at most half the shortest side).
pub fn beveled_box(min: Vec3, max: Vec3, bevel: f32) -> Geometry {
    let (center, half) = (0.5 * (min + max), 0.5 * (max - min));
    let inner = half - Vec3::splat(bevel.min(half.min_element() * 0.999));
    let mut g = Geometry::new();
    // The corner with signs `s`, on the face of axis `k`: pushed out fully along k only.
    let p = |s: [f32; 3], k: usize| {
        let mut q = inner;
        q[k] = half[k];
        center + q * Vec3::from_array(s)
    };
    let signs = [-1.0, 1.0];
    for k in 0..3 {
        let (u, v) = ((k + 1) % 3, (k + 2) % 3);
        let with = |a: f32, b: f32, c: f32| {
            let mut s = [0.0; 3];
            (s[k], s[u], s[v]) = (a, b, c);
            s
        };
        for side in signs {
            // The face across axis k.
            let round = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            let corners = round.map(|(a, b)| p(with(side, side * a, b), k));
            g.polygon(&corners);
            // The edge strip along axis k, between the faces across u and v.
            for other in signs {
                let (su, sv) = (side, other);
                let strip = [
                    p(with(-su * sv, su, sv), u),
                    p(with(su * sv, su, sv), u),
                    p(with(su * sv, su, sv), v),
                    p(with(-su * sv, su, sv), v),
                ];
                g.polygon(&[strip[3], strip[2], strip[1], strip[0]]);
            }
        }
    }
    for x in signs {
        for y in signs {
            for z in signs {
                let s = [x, y, z];
                if x * y * z > 0.0 {
                    g.polygon(&[p(s, 0), p(s, 1), p(s, 2)]);
                } else {
                    g.polygon(&[p(s, 0), p(s, 2), p(s, 1)]);
                }
            }
        }
    }
    g
}
