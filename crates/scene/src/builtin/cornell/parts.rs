//! The box, its blocks, the stages, the studio around them. Each about its own origin unless it says the world's space.

use glam::{Vec2, Vec3};

use super::palette::Stuff::{self, *};
use super::plan::{self, *};
use crate::builtin::Detail;
use crate::builtin::kit::Kit;
use crate::builtin::shapes::lathe;

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Floor and walls of the studio, its front open. World space.
pub(super) fn studio(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([x0, x1], [z0, z1], height) = STUDIO;
    let thick = 0.2;
    k.plain(Concrete, [x0 - thick, -thick, z0 - thick], [x1 + thick, 0.0, z1]);
    k.plain(Backdrop, [x0 - thick, 0.0, z0 - thick], [x1 + thick, height, z0]);
    k.plain(Backdrop, [x0 - thick, 0.0, z0], [x0, height, z1]);
    k.plain(Backdrop, [x1, 0.0, z0], [x1 + thick, height, z1]);
    for (a, b) in [
        ([x0, 0.0, z0], [x1, 0.12, z0 + 0.03]),
        ([x0, 0.0, z0 + 0.03], [x0 + 0.03, 0.12, z1]),
        ([x1 - 0.03, 0.0, z0 + 0.03], [x1, 0.12, z1]),
    ] {
        k.block(Ink, a, b, 0.008);
    }
    k
}

/// The box about the middle of its floor inside, open to +Z: slabs that touch, clad outside.
pub(super) fn cornell_box(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([w, h, d], t) = (INSIDE, THICK);
    // Walls of two layers: what the box shows inside, and the cladding.
    let skin = 0.03;
    k.plain(White, [-w - t, -t, -d - t], [w + t, 0.0, d]);
    k.plain(White, [-w - skin, h, -d - skin], [w + skin, h + skin, d]);
    k.plain(White, [-w - skin, 0.0, -d - skin], [w + skin, h, -d]);
    k.plain(Red, [-w - skin, 0.0, -d], [-w, h, d]);
    k.plain(Green, [w, 0.0, -d], [w + skin, h, d]);
    k.plain(Cladding, [-w - t, h + skin, -d - t], [w + t, h + t, d]);
    k.plain(Cladding, [-w - t, 0.0, -d - t], [w + t, h + skin, -d - skin]);
    for s in [-1.0_f32, 1.0] {
        let (a, b) = (s * (w + skin), s * (w + t));
        k.plain(Cladding, [a.min(b), 0.0, -d - skin], [a.max(b), h + skin, d]);
    }
    k
}

/// The light about the middle of its upper face.
pub(super) fn light(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.plain(Light, [-LIGHT[0], -0.02, -LIGHT[1]], [LIGHT[0], 0.0, LIGHT[1]]);
    k
}

/// A block about the middle of its underside.
pub(super) fn block(detail: Detail, of: Stuff, half: f32, height: f32) -> Things {
    let mut k: Things = Kit::new(detail);
    k.plain(of, [-half, 0.0, -half], [half, height, half]);
    k
}

/// The round base of a stage about the middle of its top.
fn stage(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let [radius, height] = TOP;
    k.turned(Stage, Vec3::ZERO, &[[radius - 0.1, -height], [radius, -height + 0.05], [radius, 0.0]], 96);
    let band =
        [[radius - 0.01, -0.15], [radius + 0.012, -0.15], [radius + 0.012, -0.12], [radius - 0.01, -0.12]];
    k.turned(Brass, Vec3::ZERO, &band, 96);
    k
}

/// A post behind a stage with an arm over its middle and a rod that ends at a height. All of it is farther from the stage's
/// middle than rays go, or hidden from there behind what hangs from the rod.
fn gallows(k: &mut Things, end: f32) {
    let ([radius, height], top) = (TOP, 1.7);
    let foot = p(0.0, -height, -radius - 0.25);
    k.turned(Ink, foot, &[[0.2, 0.0], [0.2, 0.02], [0.05, 0.04], [0.03, 0.08]], 32);
    let line = [foot, p(0.0, top, foot.z), p(0.0, top, 0.0), p(0.0, top - 0.25, 0.0)];
    k.pipe(Ink, &line, 0.025, 0.18, 16);
    k.bar(Brass, &[p(0.0, top - 0.2, 0.0), p(0.0, end, 0.0)], 0.005, 8);
}

/// A stage with nothing on it: visibility is 1.
pub(super) fn open_stage(detail: Detail) -> Things {
    stage(detail)
}

/// A stage with a disc above it.
pub(super) fn disc_stage(detail: Detail) -> Things {
    let mut k = stage(detail);
    let ([radius, height], thick) = (DISC_SIZE, 0.012);
    let rim = [Vec2::new(radius, height), Vec2::new(radius, height + thick)];
    k.at(Ivory, &lathe(&rim, detail.facets(256, 32)), Vec3::ZERO);
    gallows(&mut k, height + thick);
    k
}

/// A stage with a wall on it.
pub(super) fn wall_stage(detail: Detail) -> Things {
    let mut k = stage(detail);
    let [height, thick, half] = WALL_SIZE;
    k.plain(Ivory, [-thick, 0.0, -half], [0.0, height, half]);
    k
}

/// A stage with a ball above it.
pub(super) fn ball_stage(detail: Detail) -> Things {
    let mut k = stage(detail);
    let ([radius, height], rings) = (BALL_SIZE, detail.facets(72, 12));
    let profile: Vec<Vec2> = (0..=rings)
        .map(|i| {
            let (s, c) = libm::sincosf(std::f32::consts::PI * i as f32 / rings as f32);
            let s = if i == 0 || i == rings { 0.0 } else { s };
            Vec2::new(radius * s, height - radius * c)
        })
        .collect();
    k.at(Ivory, &lathe(&profile, detail.facets(144, 24)), Vec3::ZERO);
    gallows(&mut k, height + radius - 0.002);
    k
}

/// The truss that lamps hang from: three tubes and the bars between. World space.
pub(super) fn truss(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([x0, x1], y, z) = plan::TRUSS;
    let half = 0.14;
    let lines = [Vec2::new(half, 0.0), Vec2::new(-half, 0.0), Vec2::new(0.0, 0.22)];
    let on = |line: Vec2, x: f32| p(x, y + line.y, z + line.x);
    for line in lines {
        k.bar(Steel, &[on(line, x0), on(line, x1)], 0.024, 12);
    }
    let fields = 24;
    for i in 0..fields {
        let at = |k: u32| x0 + (x1 - x0) * k as f32 / fields as f32;
        for (j, line) in lines.into_iter().enumerate() {
            let next = lines[(j + 1) % 3];
            let (a, b) = if i % 2 == 0 { (line, next) } else { (next, line) };
            k.bar(Steel, &[on(a, at(i)), on(b, at(i + 1))], 0.009, 6);
        }
    }
    // The one end rests on the box, the other hangs on the wall.
    k.block(Ink, [x1 - 0.02, y - 0.2, z - 0.25], [STUDIO.0[1], y + 0.35, z + 0.25], 0.01);
    k.bar(Ink, &[p(x0 + 0.05, 0.0, z), p(x0 + 0.05, y, z)], 0.035, 16);
    k.turned(Ink, p(x0 + 0.05, 0.0, z), &[[0.22, 0.0], [0.22, 0.02], [0.06, 0.05]], 28);
    k
}

/// A lamp's housing about its light, which shines along −Z.
pub(super) fn housing(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let shell =
        [[0.0, 0.02], [0.075, 0.02], [0.085, -0.05], [0.1, -0.05], [0.095, 0.1], [0.06, 0.2], [0.0, 0.22]];
    k.turned_along(Ink, Vec3::ZERO, Vec3::Z, &shell, 28);
    k
}

/// Its glowing glass.
pub(super) fn glass(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.turned_along(
        Lamp,
        Vec3::ZERO,
        Vec3::Z,
        &[[0.0, -0.005], [0.072, -0.005], [0.072, 0.015], [0.0, 0.015]],
        28,
    );
    k
}
