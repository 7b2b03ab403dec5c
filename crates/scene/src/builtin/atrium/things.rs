//! What stands and hangs in the atrium as geometry, each piece about its own origin.

use std::f32::consts::FRAC_PI_2;

use glam::{Affine3A, Quat, Vec3};

use super::plan::*;
use crate::builtin::Detail;
use crate::builtin::noise::unit;
use crate::builtin::profile::{block, rounded, turned, v2};
use crate::builtin::shapes::*;

/// A slender vase with a neck, hollow.
pub(super) fn vase([segments, bend]: [u32; 2], detail: Detail) -> Geometry {
    let outside = [
        v2(0.13, 0.0),
        v2(0.15, 0.04),
        v2(0.22, 0.22),
        v2(0.265, 0.45),
        v2(0.20, 0.66),
        v2(0.105, 0.77),
        v2(0.11, 0.84),
        v2(0.165, 0.9),
    ];
    let inside =
        [v2(0.145, 0.895), v2(0.09, 0.83), v2(0.085, 0.77), v2(0.17, 0.66), v2(0.22, 0.45), v2(0.0, 0.3)];
    let mut profile = vec![v2(0.0, -0.01), v2(0.13, -0.01)];
    profile.extend(rounded(&outside, bend));
    profile.extend(rounded(&inside, bend.div_ceil(2)));
    turned(detail, &profile, segments)
}

/// A wide pot with a thick rim, filled with earth.
pub(super) fn pot(detail: Detail) -> Geometry {
    let bend = detail.facets(4, 1);
    let outside = [v2(0.24, 0.0), v2(0.29, 0.08), v2(0.36, 0.28), v2(0.385, 0.42)];
    let rim = [v2(0.40, 0.43), v2(0.425, 0.45), v2(0.425, 0.53), v2(0.40, 0.55), v2(0.36, 0.54)];
    let mut profile = vec![v2(0.0, -0.01), v2(0.24, -0.01)];
    profile.extend(rounded(&outside, bend));
    profile.extend(rounded(&rim, bend.div_ceil(2)));
    profile.extend([v2(0.34, 0.47), v2(0.2, 0.485), v2(0.0, 0.5)]);
    turned(detail, &profile, detail.facets(28, 8))
}

/// Long leaves that rise from a pot and bend over; each leaf is a closed, thin blade.
pub(super) fn leaves(seed: u32, detail: Detail) -> Geometry {
    let mut g = Geometry::new();
    let count = detail.count(22, 6);
    let segments = detail.facets(8, 3);
    for leaf in 0..count {
        let r = |k: u32| unit(seed, leaf * 8 + k);
        let turn = std::f32::consts::TAU * (leaf as f32 + 0.7 * r(0)) / count as f32 * 3.0;
        let (length, lean) = (0.75 + 0.5 * r(1), 0.25 + 0.75 * r(2));
        let wide = 0.028 + 0.03 * r(3);
        let forward = Vec3::new(libm::cosf(turn), 0.0, -libm::sinf(turn));
        let side = Vec3::new(forward.z, 0.0, -forward.x);
        let frames: Vec<Frame> = (0..=segments)
            .map(|i| {
                let t = i as f32 / segments as f32;
                let angle = FRAC_PI_2 - lean * (0.25 + 1.7 * t * t);
                // Height and reach of an arc whose slope falls along the blade.
                let (reach, rise) = (lean * t * t * 0.8 * length, length * (t - 0.42 * lean * t * t * t));
                let along = forward * libm::cosf(angle) + Vec3::Y * libm::sinf(angle);
                let width = wide * (0.35 + 2.6 * t * (1.0 - t)) * (1.0 - 0.85 * t * t);
                let origin = forward * (0.05 + 0.1 * r(4) + reach) + Vec3::Y * (0.42 + rise);
                Frame { origin, x: side * (width / wide), y: along.cross(side) }
            })
            .collect();
        g.append_at(
            &sweep(&frames, &rectangle(v2(-wide, -0.002), v2(wide, 0.002)), false, false),
            Vec3::ZERO,
        );
    }
    g
}

/// A wooden crate of 0.8 m: panels inside a frame of bars.
pub(super) fn crate_box(detail: Detail) -> Geometry {
    let h = 0.4;
    let mut g = cuboid(Vec3::new(-h + 0.03, 0.02, -h + 0.03), Vec3::new(h - 0.03, 0.78, h - 0.03));
    let bar = |g: &mut Geometry, a: Vec3, b: Vec3| {
        g.append_at(&block(detail, a.min(b), a.max(b), 0.008), Vec3::ZERO)
    };
    for s in [-1.0, 1.0] {
        for t in [-1.0, 1.0] {
            let corner = |y: f32, inset: f32| Vec3::new(s * (h - inset), y, t * (h - inset));
            bar(&mut g, corner(0.0, 0.0), corner(0.8, 0.085));
            for y in [0.004, 0.711] {
                bar(
                    &mut g,
                    Vec3::new(-h + 0.08, y, t * (h - 0.006)),
                    Vec3::new(h - 0.08, y + 0.085, t * (h - 0.06)),
                );
                bar(
                    &mut g,
                    Vec3::new(s * (h - 0.006), y, -h + 0.08),
                    Vec3::new(s * (h - 0.06), y + 0.085, h - 0.08),
                );
            }
        }
        let brace = block(detail, Vec3::new(-0.44, -0.04, -0.02), Vec3::new(0.44, 0.04, 0.02), 0.006);
        for turn in [0.0, FRAC_PI_2] {
            let face = Affine3A::from_rotation_translation(
                Quat::from_rotation_y(turn),
                Quat::from_rotation_y(turn) * Vec3::new(0.0, 0.4, s * (h - 0.022)),
            );
            g.append(&brace, &(face * Affine3A::from_rotation_z(s * 0.76)));
        }
    }
    g
}

/// A table of 1.8 × 0.8 m with turned legs.
pub(super) fn table(detail: Detail) -> Geometry {
    let mut g = block(detail, Vec3::new(-0.9, 0.71, -0.4), Vec3::new(0.9, 0.76, 0.4), 0.012);
    g.append_at(&cuboid(Vec3::new(-0.78, 0.60, -0.30), Vec3::new(0.78, 0.715, 0.30)), Vec3::ZERO);
    let leg = turned(
        detail,
        &rounded(
            &[
                v2(0.022, -0.005),
                v2(0.03, 0.05),
                v2(0.024, 0.12),
                v2(0.042, 0.3),
                v2(0.03, 0.5),
                v2(0.045, 0.56),
                v2(0.045, 0.712),
            ],
            detail.facets(3, 1),
        ),
        detail.facets(16, 6),
    );
    for x in [-0.8, 0.8] {
        for z in [-0.32, 0.32] {
            g.append_at(&leg, Vec3::new(x, 0.0, z));
        }
    }
    g
}

/// A stone bench of 1.7 × 0.42 m on two blocks.
pub(super) fn bench(detail: Detail) -> Geometry {
    let mut g = block(detail, Vec3::new(-0.85, 0.36, -0.21), Vec3::new(0.85, 0.45, 0.21), 0.02);
    for x in [-0.55, 0.55] {
        g.append_at(
            &block(detail, Vec3::new(-0.11, -0.01, -0.16), Vec3::new(0.11, 0.37, 0.16), 0.015),
            Vec3::X * x,
        );
    }
    g
}

/// The fountain's stone: a basin with a stem and a bowl in its middle.
pub(super) fn fountain(detail: Detail) -> Geometry {
    let bend = detail.facets(5, 1);
    let [radius, height] = FOUNTAIN;
    let mut profile = vec![v2(0.0, -0.02), v2(radius - 0.05, -0.02), v2(radius - 0.05, 0.08)];
    profile
        .extend(rounded(&[v2(radius - 0.12, 0.14), v2(radius - 0.14, 0.26), v2(radius - 0.08, 0.34)], bend));
    profile.extend(rounded(&[v2(radius - 0.02, 0.36), v2(radius, 0.40), v2(radius - 0.02, height)], bend));
    profile.extend([v2(radius - 0.18, height), v2(radius - 0.2, height - 0.2), v2(0.16, height - 0.2)]);
    profile.extend(rounded(&[v2(0.14, 0.3), v2(0.10, 0.55), v2(0.09, 0.75), v2(0.14, 0.95)], bend));
    profile.extend(rounded(&[v2(0.2, 1.0), v2(0.38, 1.12), v2(0.44, 1.24), v2(0.42, 1.26)], bend));
    profile.extend(rounded(&[v2(0.40, 1.25), v2(0.2, 1.13), v2(0.05, 1.1)], bend));
    profile.extend([v2(0.04, 1.3), v2(0.0, 1.35)]);
    turned(detail, &profile, detail.facets(56, 10))
}

/// The fountain's water: a thin disc that reaches into basin and stem.
pub(super) fn water(detail: Detail) -> Geometry {
    let r = FOUNTAIN[0] - 0.185;
    turned(detail, &[v2(r, FOUNTAIN[1] - 0.16), v2(r, FOUNTAIN[1] - 0.07)], detail.facets(56, 10))
}

/// A lattice screen's frame of 2.1 × 2.3 m along X.
pub(super) fn screen_frame(detail: Detail) -> Geometry {
    let mut g = Geometry::new();
    for x in [-1.02, 0.0, 1.02] {
        g.append_at(
            &block(detail, Vec3::new(x - 0.03, -0.01, -0.03), Vec3::new(x + 0.03, 2.3, 0.03), 0.006),
            Vec3::ZERO,
        );
    }
    for y in [0.05, 0.75, 2.2] {
        g.append_at(
            &block(detail, Vec3::new(-1.0, y, -0.024), Vec3::new(1.0, y + 0.07, 0.024), 0.006),
            Vec3::ZERO,
        );
    }
    g
}

/// A lattice screen's filling: one layer.
pub(super) fn screen_filling() -> Geometry {
    let mut g = Geometry::new();
    g.polygon(&[
        Vec3::new(-1.0, 0.1, 0.0),
        Vec3::new(1.0, 0.1, 0.0),
        Vec3::new(1.0, 2.22, 0.0),
        Vec3::new(-1.0, 2.22, 0.0),
    ]);
    g
}

/// A curtain, hung from y = 0.
pub(super) fn curtain(which: u32, detail: Detail) -> Geometry {
    let (width, folds) = if which == 0 { (0.85, 6.0) } else { (1.1, 8.0) };
    cloth(
        width,
        BEAM_BOTTOM - GALLERY - 0.22,
        folds,
        0.16,
        [detail.facets(72, 20), detail.facets(14, 3)],
        100 + which,
    )
}

/// A long banner on the hall's side, hung from y = 0.
pub(super) fn banner(detail: Detail) -> Geometry {
    cloth(0.85, 2.9, 2.5, 0.07, [detail.facets(28, 8), detail.facets(20, 3)], 300)
}

/// A rod along X across one bay, 1 m per unit.
pub(super) fn rod(half: f32, detail: Detail) -> Geometry {
    tube(&[Vec3::X * -half, Vec3::X * half], 0.016, detail.facets(10, 4))
}

/// A lantern's metal, hung from y = 0: a chain as a thin rod, a dome, a ring with four bars, a finial.
pub(super) fn lantern_metal(detail: Detail) -> Geometry {
    let bend = detail.facets(5, 1);
    let sides = detail.facets(18, 6);
    let mut g = tube(&[Vec3::Y * 0.01, Vec3::Y * -0.47], 0.006, detail.facets(8, 3));
    let mut dome = rounded(&[v2(0.155, -0.60), v2(0.12, -0.53), v2(0.05, -0.48), v2(0.018, -0.45)], bend);
    dome.push(v2(0.0, -0.45));
    let mut profile = vec![v2(0.0, -0.59), v2(0.14, -0.60)];
    profile.append(&mut dome);
    g.append_at(&turned(detail, &profile, sides), Vec3::ZERO);
    let foot =
        rounded(&[v2(0.0, -0.93), v2(0.02, -0.91), v2(0.03, -0.88), v2(0.10, -0.84), v2(0.105, -0.82)], bend);
    let mut foot = foot;
    foot.push(v2(0.0, -0.82));
    g.append_at(&turned(detail, &foot, sides), Vec3::ZERO);
    for i in 0..4 {
        let turn = Quat::from_rotation_y(FRAC_PI_2 * i as f32);
        let bar = tube(&[turn * Vec3::new(0.135, -0.59, 0.0), turn * Vec3::new(0.095, -0.83, 0.0)], 0.007, 4);
        g.append_at(&bar, Vec3::ZERO);
    }
    g
}

/// A lantern's glowing glass.
pub(super) fn lantern_glass(detail: Detail) -> Geometry {
    let bend = detail.facets(4, 1);
    let profile = rounded(&[v2(0.05, -0.815), v2(0.075, -0.76), v2(0.085, -0.68), v2(0.06, -0.61)], bend);
    turned(detail, &profile, detail.facets(20, 6))
}

/// A spot light's housing around the origin, open towards −Z.
pub(super) fn spot_housing(detail: Detail) -> Geometry {
    let profile = [
        v2(0.0, -0.06),
        v2(0.07, -0.06),
        v2(0.105, 0.02),
        v2(0.11, 0.16),
        v2(0.10, 0.16),
        v2(0.095, 0.03),
        v2(0.0, 0.0),
    ];
    let mut g = Geometry::new();
    // The lathe's axis becomes −Z, its mouth just behind the light.
    let turn = Affine3A::from_rotation_translation(Quat::from_rotation_x(-FRAC_PI_2), Vec3::Z * 0.17);
    g.append(&turned(detail, &profile, detail.facets(24, 6)), &turn);
    g
}

/// A picture's frame on a wall that faces +Z, about the picture's centre.
pub(super) fn picture_frame(width: f32, height: f32) -> Geometry {
    let (w, h, b) = (0.5 * width, 0.5 * height, 0.09);
    let mut g = Geometry::new();
    // Mitred: a rectangle swept around the picture.
    let corner = |x: f32, y: f32| Frame {
        origin: Vec3::new(x * w, y * h, 0.0),
        x: Vec3::new(x, y, 0.0),
        y: Vec3::NEG_Z,
    };
    let path = [corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0), corner(-1.0, -1.0)];
    g.append_at(&sweep(&path, &rectangle(v2(0.0, -0.06), v2(b, 0.02)), false, true), Vec3::ZERO);
    g
}

/// A picture's canvas in [`picture_frame`].
pub(super) fn picture_canvas(width: f32, height: f32) -> Geometry {
    let (w, h) = (0.5 * width + 0.02, 0.5 * height + 0.02);
    cuboid(Vec3::new(-w, -h, -0.03), Vec3::new(w, h, 0.03))
}

/// A spot light's stem: from the light's pivot at the origin up to the ceiling, `height` metres above.
pub(super) fn spot_stem(height: f32, detail: Detail) -> Geometry {
    let mut g = tube(&[Vec3::new(0.0, 0.0, 0.0), Vec3::Y * (height + 0.01)], 0.014, detail.facets(10, 4));
    g.append_at(
        &cuboid(Vec3::new(-0.06, height - 0.03, -0.06), Vec3::new(0.06, height + 0.01, 0.06)),
        Vec3::ZERO,
    );
    g
}
