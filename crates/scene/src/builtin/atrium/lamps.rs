//! The atrium's area lights: three globes in the lower arcades, and a panel that hangs in the skylight.
//!
//! Radiances make about 1 lx under a globe and 2 lx under the panel, so that a picture needs no exposure.

use glam::{Vec2, Vec3};

use super::plan::*;
use super::{Palette, things};
use crate::builtin::builder::{Emitter, GlbBuilder, MeshId, NodeSpec};
use crate::builtin::profile::{block, turned, v2};
use crate::builtin::shapes::{Frame, Geometry, cuboid, rectangle, sweep, tube};
use crate::builtin::{Detail, emitters, path};

/// Hooks of the globes, among [`LANTERNS`]; the others carry lanterns that are off.
pub(super) const HOOKS: [usize; 3] = [1, 3, 5];
/// Radius of a globe, and how far its middle hangs below the hook.
pub(super) const GLOBE: [f32; 2] = [0.2, 0.95];
/// The panel's middle and half extents along X and Z.
pub(super) const PANEL: (Vec3, Vec2) = (Vec3::new(0.0, 7.02, 0.0), Vec2::new(2.5, 1.0));
/// Radiances of the three globes and of the panel.
const RADIANCES: [Vec3; 4] = [
    Vec3::new(62.0, 42.0, 21.0),
    Vec3::new(58.0, 50.0, 38.0),
    Vec3::new(64.0, 35.0, 15.0),
    Vec3::new(8.6, 9.1, 10.0),
];

/// Hangs the lights, and the lanterns that are off.
pub(super) fn light(b: &mut GlbBuilder, p: &Palette, detail: Detail) {
    let metal = b.mesh("lantern", &[(&things::lantern_metal(detail), p.brass)]);
    let glass = b.mesh("lantern-glass", &[(&things::lantern_glass(detail), p.glow)]);
    let holder = b.mesh("globe-holder", &[(&holder(detail), p.brass)]);
    let globe = emitters::sphere(detail, GLOBE[0]);
    let mut globes = RADIANCES[..3].iter().enumerate().map(|(i, &radiance)| -> MeshId {
        let glow = b.material(&format!("globe-{i}"), &emitters::glow(radiance));
        emitters::mesh(b, &format!("globe-{i}"), &globe, glow)
    });
    let globes = [globes.next(), globes.next(), globes.next()];
    let mut next = 0;
    for (i, &hook) in LANTERNS.iter().enumerate() {
        match globes.get(next).copied().flatten().filter(|_| HOOKS.contains(&i)) {
            Some(globe) => {
                b.node("globe-holder", &NodeSpec::mesh_at(holder, hook, 0.0));
                let spec = emitters::at(globe, Emitter::Sphere, hook - Vec3::Y * GLOBE[1]);
                b.node(&format!("globe-{next}"), &spec);
                next += 1;
            }
            None => {
                b.node("lantern", &NodeSpec::mesh_at(metal, hook, 0.0));
                b.node("lantern-glass", &NodeSpec::mesh_at(glass, hook, 0.0));
            }
        }
    }
    let case = b.mesh("panel-case", &[(&case(detail), p.iron)]);
    b.node("panel-case", &NodeSpec::mesh_at(case, PANEL.0, 0.0));
    let glow = b.material("panel", &emitters::glow(RADIANCES[3]));
    let panel = emitters::mesh(b, "panel", &emitters::rectangle(PANEL.1), glow);
    let down = NodeSpec {
        rotation: path::look_along(Vec3::NEG_Y),
        ..emitters::at(panel, Emitter::Rectangle, PANEL.0)
    };
    b.node("panel", &down);
}

/// A rod from the hook and a cap over the globe; hung from y = 0.
fn holder(detail: Detail) -> Geometry {
    let [radius, drop] = GLOBE;
    let mut g = tube(&[Vec3::Y * 0.01, Vec3::Y * (radius + 0.012 - drop)], 0.011, detail.facets(10, 4));
    let sides = detail.facets(28, 8);
    // The cap stays clear of the globe: its inside is a part of a slightly larger sphere.
    let (inside, outside) = (radius + 0.006, radius + 0.018);
    let arc = |r: f32, i: u32| {
        let (s, c) = libm::sincosf(0.62 * i as f32 / 4.0);
        v2(if i == 0 { 0.0 } else { r * s }, r * c - drop)
    };
    let mut profile: Vec<Vec2> = (0..=4).map(|i| arc(inside, i)).collect();
    profile.extend((0..=4).rev().map(|i| arc(outside, i)));
    g.append_at(&turned(Detail(1.0), &profile, sides), Vec3::ZERO);
    let rose = [v2(0.0, -0.03), v2(0.05, -0.03), v2(0.07, -0.008), v2(0.07, 0.01), v2(0.0, 0.01)];
    g.append_at(&turned(detail, &rose, sides), Vec3::ZERO);
    g
}

/// A shallow case behind and around the panel, about its middle, with rods up into the skylight's beams.
fn case(detail: Detail) -> Geometry {
    let h = PANEL.1;
    let mut g = Geometry::new();
    g.append_at(
        &cuboid(Vec3::new(-h.x - 0.02, 0.012, -h.y - 0.02), Vec3::new(h.x + 0.02, 0.05, h.y + 0.02)),
        Vec3::ZERO,
    );
    let corner = |x: f32, z: f32| Frame {
        origin: Vec3::new(x * h.x, 0.0, z * h.y),
        x: Vec3::new(x, 0.0, z),
        y: Vec3::Y,
    };
    let rim = [corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0), corner(-1.0, -1.0)];
    g.append_at(&sweep(&rim, &rectangle(v2(0.012, -0.03), v2(0.06, 0.06)), false, true), Vec3::ZERO);
    let top = CEILING + 0.2 - PANEL.0.y;
    for x in [-BAY, 0.0, BAY] {
        for z in [-0.7, 0.7] {
            g.append_at(
                &tube(&[Vec3::new(x, 0.03, z), Vec3::new(x, top, z)], 0.014, detail.facets(10, 4)),
                Vec3::ZERO,
            );
            g.append_at(
                &block(
                    detail,
                    Vec3::new(x - 0.05, 0.03, z - 0.05),
                    Vec3::new(x + 0.05, 0.075, z + 0.05),
                    0.01,
                ),
                Vec3::ZERO,
            );
        }
    }
    g
}
