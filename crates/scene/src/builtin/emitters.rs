//! Meshes and materials of area lights: each mesh stands for an analytic shape that its node names.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use super::Detail;
use super::builder::{Emitter, GlbBuilder, MaterialId, MaterialSpec, MeshId, NodeSpec};
use super::shapes::{Geometry, ball};

/// A sphere of a radius about the origin.
pub(super) fn sphere(detail: Detail, radius: f32) -> Geometry {
    let level = if detail.0 > 0.3 { 3 } else { 2 };
    let mut g = ball(level);
    g.positions.iter_mut().for_each(|p| *p *= radius);
    g
}

/// A disc of a radius about the origin, flat, its front towards −Z: where lights shine.
pub(super) fn disc(detail: Detail, radius: f32) -> Geometry {
    let rim = detail.facets(64, 24);
    let mut g = Geometry::new();
    let middle = g.vertex(Vec3::ZERO, Vec3::NEG_Z, Vec2::ZERO);
    for i in 0..rim {
        let (s, c) = libm::sincosf(TAU * i as f32 / rim as f32);
        g.vertex(Vec3::new(radius * c, radius * s, 0.0), Vec3::NEG_Z, Vec2::new(-radius * c, -radius * s));
    }
    for i in 0..rim {
        g.triangles.push([middle, middle + 1 + (i + 1) % rim, middle + 1 + i]);
    }
    g
}

/// A rectangle of half extents along X and Y about the origin, flat, its front towards −Z.
pub(super) fn rectangle(half: Vec2) -> Geometry {
    let mut g = Geometry::new();
    let corner = |x: f32, y: f32| Vec3::new(x * half.x, y * half.y, 0.0);
    g.polygon(&[corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)]);
    g
}

/// A black material that emits a radiance.
pub(super) fn glow(radiance: Vec3) -> MaterialSpec {
    MaterialSpec { emissive: radiance, ..MaterialSpec::matt(0.0, 0.0, 0.0, 0.9) }
}

/// A mesh of one emitting piece.
pub(super) fn mesh(b: &mut GlbBuilder, name: &str, piece: &Geometry, material: MaterialId) -> MeshId {
    b.mesh(name, &[(piece, material)])
}

/// A node that carries an emitting mesh upright at a place.
pub(super) fn at(mesh: MeshId, emitter: Emitter, translation: Vec3) -> NodeSpec {
    NodeSpec { emitter: Some(emitter), ..NodeSpec::mesh_at(mesh, translation, 0.0) }
}
