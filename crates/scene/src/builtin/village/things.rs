//! What stands in the village, each piece about its own foot: torches, fences, carts, barrels, the well, stalls, stacks of wood.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Affine3A, Quat, Vec2, Vec3};

use super::palette::Stuff::{self, *};
use crate::builtin::Detail;
use crate::builtin::joinery::{Wheel, torus};
use crate::builtin::kit::Kit;
use crate::builtin::noise::unit;
use crate::builtin::shapes::{Geometry, ball, lathe};

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Height of a standing torch's flame above the ground.
pub(super) const STANDING: f32 = 1.98;
/// Where a wall torch's flame is, from its foot on a wall that looks along +Z.
pub(super) const ON_WALL: Vec3 = Vec3::new(0.0, 0.33, 0.2);

/// An iron basket around the place of a flame at the origin.
fn basket(k: &mut Things, at: Vec3) {
    k.turned(Iron, at, &[[0.025, -0.1], [0.05, -0.07], [0.075, -0.012], [0.05, -0.018], [0.0, -0.06]], 16);
    for i in 0..6 {
        let d = Quat::from_rotation_y(TAU * i as f32 / 6.0) * Vec3::X;
        k.bar(Iron, &[at + d * 0.066 - Vec3::Y * 0.02, at + d * 0.095 + Vec3::Y * 0.09], 0.005, 6);
    }
    let hoop = torus(0.088, 0.006, [k.detail.facets(24, 8), k.detail.facets(6, 4)]);
    let level = Affine3A::from_rotation_translation(Quat::from_rotation_x(FRAC_PI_2), at + Vec3::Y * 0.07);
    k.add(Iron, &hoop, &level);
}

/// A torch on a post.
pub(super) fn torch(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let top = STANDING - 0.07;
    k.turned(Oak, p(0.0, -0.4, 0.0), &[[0.055, 0.0], [0.055, 0.45], [0.045, 0.5], [0.038, top + 0.38]], 12);
    for y in [0.5, 1.4] {
        k.turned(Iron, p(0.0, y, 0.0), &[[0.045, -0.02], [0.052, -0.015], [0.052, 0.015], [0.045, 0.02]], 12);
    }
    basket(&mut k, p(0.0, STANDING, 0.0));
    k
}

/// A torch in a bracket, from its foot on a wall that looks along +Z.
pub(super) fn wall_torch(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.block(Iron, [-0.04, -0.16, -0.03], [0.04, 0.12, 0.02], 0.006);
    k.bar(Iron, &[p(0.0, -0.12, 0.01), p(0.0, -0.05, 0.12), p(0.0, 0.05, ON_WALL.z - 0.03)], 0.011, 8);
    k.bar(Oak, &[p(0.0, -0.05, ON_WALL.z - 0.06), ON_WALL - Vec3::Y * 0.07], 0.026, 10);
    basket(&mut k, ON_WALL);
    k
}

/// A flame about its foot: a drop whose tip leans, closed.
pub(super) fn flame(detail: Detail) -> Geometry {
    let outline =
        [[0.0, -0.02], [0.045, 0.0], [0.062, 0.05], [0.056, 0.12], [0.037, 0.19], [0.016, 0.26], [0.0, 0.32]];
    let outline: Vec<Vec2> = outline.iter().map(|&[r, y]| Vec2::new(r, y)).collect();
    let mut g = lathe(&outline, detail.facets(12, 6));
    for q in &mut g.positions {
        let t = (q.y / 0.32).clamp(0.0, 1.0);
        q.x += 0.035 * t * t;
        q.z += 0.015 * libm::sinf(4.5 * t);
    }
    g
}

/// A panel of fence, 2 m long about its middle: two posts, rails, and pickets.
pub(super) fn fence(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    for x in [-0.94, 0.94] {
        k.block(Oak, [x - 0.06, -0.45, -0.06], [x + 0.06, 1.02, 0.06], 0.015);
    }
    for y in [0.32, 0.78] {
        k.plank(Oak, p(-1.06, y, 0.0), p(1.06, y + 0.02, 0.0), Vec3::Y, [0.045, 0.022]);
    }
    let count = detail.count(11, 5);
    for i in 0..count {
        let x = -0.8 + 1.6 * i as f32 / (count - 1) as f32;
        let (lean, tall) = (0.05 * (unit(541, i) - 0.5), 0.86 + 0.16 * unit(542, i));
        let head = [[-0.05, -0.3], [0.05, -0.3], [0.05, tall], [0.0, tall + 0.09], [-0.05, tall]];
        k.prism(
            Boards,
            &head,
            [0.02, 0.042],
            &Affine3A::from_rotation_translation(Quat::from_rotation_z(lean), p(x, 0.0, 0.0)),
        );
    }
    k
}

/// A two-wheeled cart about the middle of its axle's shadow, its shafts along +X on the ground.
pub(super) fn cart(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let wheel = Wheel { radius: 0.62, rim: [0.07, 0.1], spokes: (12, 0.022), hub: [0.09, 0.24] };
    let mut one: Things = Kit::new(detail);
    one.wheel(&wheel, [Oak, Iron, Iron]);
    for z in [-0.78, 0.78] {
        k.at_all(&one, p(0.0, 0.61, z));
    }
    k.bar(Iron, &[p(0.0, 0.61, -0.9), p(0.0, 0.61, 0.9)], 0.028, 10);
    let mut body: Things = Kit::new(detail);
    for i in 0..6 {
        let z = -0.6 + 0.2 * i as f32;
        body.plain(Boards, [-1.05, 0.0, z + 0.006], [1.05, 0.035, z + 0.194]);
    }
    for x in [-0.7, 0.0, 0.7] {
        body.block(Oak, [x - 0.05, -0.08, -0.62], [x + 0.05, 0.004, 0.62], 0.01);
    }
    for s in [-1.0_f32, 1.0] {
        for i in 0..3 {
            let y = 0.07 + 0.14 * i as f32;
            body.plain(Boards, [-1.06, y, s * 0.6 - 0.015], [1.06, y + 0.12, s * 0.6 + 0.015]);
        }
        for x in [-0.98, -0.33, 0.33, 0.98] {
            body.plank(Oak, p(x, -0.07, s * 0.635), p(x, 0.56, s * 0.66), Vec3::X, [0.03, 0.022]);
        }
        body.bar(
            Oak,
            &[p(-1.0, -0.06, s * 0.42), p(0.6, -0.05, s * 0.45), p(2.5, -0.1, s * 0.34)],
            0.036,
            10,
        );
    }
    for i in 0..3 {
        let y = 0.07 + 0.14 * i as f32;
        body.plain(Boards, [1.03, y, -0.585], [1.06, y + 0.12, 0.585]);
    }
    // A load of sacks.
    for i in 0..5 {
        let r = |c: u32| unit(551, 4 * i + c);
        let mut sack = ball(if detail.0 > 0.3 { 3 } else { 1 });
        let bulge = p(0.3, 0.17, 0.24);
        sack.positions.iter_mut().for_each(|q| *q *= bulge);
        sack.normals.iter_mut().for_each(|n| *n = (*n / bulge).normalize());
        let at = p(-0.7 + 0.36 * i as f32, 0.19 + 0.1 * (i % 2) as f32, 0.34 * (r(0) - 0.5) * 2.0);
        body.add(Sack, &sack, &Affine3A::from_rotation_translation(Quat::from_rotation_y(3.0 * r(1)), at));
    }
    // Its shafts' ends rest on the ground.
    let tilt = Quat::from_rotation_z(-0.235);
    k.all(&body, &Affine3A::from_rotation_translation(tilt, p(0.0, 0.72, 0.0)));
    k
}

/// A barrel of staves with hoops.
pub(super) fn barrel(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.cask([Oak, Iron]);
    k
}

/// A crate of 0.8 m.
pub(super) fn crate_box(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.crate_box([Boards, Oak]);
    k
}

/// The well: a ring of stones, a roof on two posts, a windlass with a bucket.
pub(super) fn well(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let courses = 4;
    let count = 14;
    for course in 0..courses {
        for i in 0..count {
            let r = |c: u32| unit(561, (course * 16 + i) * 4 + c);
            let turn = TAU * (i as f32 + 0.5 * (course % 2) as f32) / count as f32;
            let y = -0.3 + 0.3 * course as f32;
            let half = 0.97 * std::f32::consts::PI / count as f32;
            let stone = crate::builtin::profile::block(
                detail,
                p(0.78 - 0.03 * r(0), y, -half),
                p(1.06 + 0.04 * r(1), y + 0.295, half),
                0.035,
            );
            k.add(Stone, &stone, &Affine3A::from_quat(Quat::from_rotation_y(turn)));
        }
    }
    k.turned(Pane, p(0.0, 0.12, 0.0), &[[0.8, 0.0], [0.8, 0.02]], 28);
    for x in [-1.0, 1.0] {
        k.block(Oak, [x - 0.08, -0.3, -0.08], [x + 0.08, 2.35, 0.08], 0.015);
    }
    k.bar(Oak, &[p(-1.18, 1.55, 0.0), p(1.3, 1.55, 0.0)], 0.065, 14);
    k.bar(
        Iron,
        &[p(1.28, 1.55, 0.0), p(1.36, 1.55, 0.0), p(1.36, 1.25, 0.12), p(1.52, 1.25, 0.12)],
        0.016,
        8,
    );
    k.bar(Sack, &[p(0.12, 1.5, 0.0), p(0.12, 1.07, 0.0)], 0.014, 8);
    k.turned(
        Oak,
        p(0.12, 0.76, 0.0),
        &[[0.0, 0.0], [0.11, 0.0], [0.15, 0.27], [0.13, 0.27], [0.1, 0.04], [0.0, 0.04]],
        18,
    );
    k.bar(Iron, &[p(-0.02, 1.02, 0.0), p(0.12, 1.1, 0.0), p(0.26, 1.02, 0.0)], 0.008, 6);
    for s in [-1.0_f32, 1.0] {
        let down = p(0.0, -0.62, s * 0.78).normalize();
        for i in 0..5 {
            let a = p(0.0, 2.78, 0.0) + down * (0.27 * i as f32);
            let b = a + down * 0.3 + p(0.0, 0.78, s * 0.62).normalize() * 0.03;
            k.plank(
                Shingle,
                0.5 * (a + b) - Vec3::X * 1.35,
                0.5 * (a + b) + Vec3::X * 1.35,
                b - a,
                [0.16, 0.016],
            );
        }
        for x in [-1.0, 1.0] {
            k.plank(Oak, p(x, 2.72, 0.0), p(x, 2.0, s * 0.9), Vec3::X, [0.05, 0.05]);
        }
    }
    k.bar(Oak, &[p(-1.4, 2.78, 0.0), p(1.4, 2.78, 0.0)], 0.07, 10);
    k
}

/// A market stall's posts, counter and goods; the cloth is [`awning`].
pub(super) fn stall(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    for (x, z, top) in [(-1.3, -0.7, 2.45), (1.3, -0.7, 2.45), (-1.3, 0.7, 2.05), (1.3, 0.7, 2.05)] {
        k.bar(Oak, &[p(x, -0.4, z), p(x, top, z)], 0.05, 10);
    }
    for (z, y) in [(-0.7, 2.44), (0.7, 2.04)] {
        k.bar(Oak, &[p(-1.45, y, z), p(1.45, y, z)], 0.04, 10);
    }
    for i in 0..5 {
        let z = -0.2 + 0.18 * i as f32;
        k.plain(Boards, [-1.4, 0.86, z], [1.4, 0.9, z + 0.17]);
    }
    for x in [-1.2, 0.0, 1.2] {
        k.block(Oak, [x - 0.05, -0.3, -0.15], [x + 0.05, 0.865, -0.05], 0.01);
        k.block(Oak, [x - 0.05, -0.3, 0.55], [x + 0.05, 0.865, 0.65], 0.01);
    }
    // Bowls, jugs and heaps of apples.
    for i in 0..7 {
        let r = |c: u32| unit(571, 4 * i + c);
        let at = p(-1.15 + 0.38 * i as f32, 0.895, 0.1 + 0.3 * r(0));
        match i % 3 {
            0 => k.turned(
                Clay,
                at,
                &[
                    [0.0, 0.0],
                    [0.07, 0.0],
                    [0.12, 0.1],
                    [0.1, 0.2],
                    [0.05, 0.25],
                    [0.07, 0.31],
                    [0.055, 0.31],
                    [0.035, 0.25],
                    [0.0, 0.2],
                ],
                22,
            ),
            1 => {
                k.turned(
                    Oak,
                    at,
                    &[[0.0, 0.0], [0.08, 0.0], [0.17, 0.09], [0.155, 0.09], [0.075, 0.02], [0.0, 0.02]],
                    22,
                );
                let apple = ball(if detail.0 > 0.3 { 2 } else { 0 });
                for j in 0..5 {
                    let (s, c) = libm::sincosf(TAU * j as f32 / 4.0);
                    let (out, up) = if j == 4 { (0.0, 0.14) } else { (0.07, 0.08) };
                    let place = Affine3A::from_scale_rotation_translation(
                        Vec3::splat(0.05),
                        Quat::IDENTITY,
                        at + p(out * c, up, out * s),
                    );
                    k.add(Red, &apple, &place);
                }
            }
            _ => k.turned(
                Brass,
                at,
                &[
                    [0.0, 0.0],
                    [0.05, 0.0],
                    [0.055, 0.01],
                    [0.02, 0.05],
                    [0.02, 0.09],
                    [0.06, 0.13],
                    [0.07, 0.2],
                    [0.062, 0.2],
                    [0.05, 0.13],
                    [0.0, 0.1],
                ],
                22,
            ),
        }
    }
    k
}

/// A stall's cloth: one layer that sags between its bars.
pub(super) fn awning(detail: Detail) -> Geometry {
    let mut g = Geometry::new();
    let [nx, nz] = [detail.facets(24, 6), detail.facets(12, 4)];
    let surface = |s: f32, t: f32| {
        let x = 3.0 * (s - 0.5);
        let sag = 0.09
            * libm::sinf(std::f32::consts::PI * (t / 0.9).min(1.0))
            * (0.6 + 0.4 * libm::sinf(TAU * s * 2.0));
        let hem = if t > 0.9 { 1.6 * (t - 0.9) } else { 0.0 };
        p(x, 2.56 - 0.4 * t.min(0.9) / 0.9 - sag - hem, -0.72 + 1.46 * t.min(0.9) / 0.9 + 0.3 * hem)
    };
    for j in 0..=nz {
        for i in 0..=nx {
            let (s, t) = (i as f32 / nx as f32, j as f32 / nz as f32);
            let e = 0.01;
            let n = (surface(s, t + e) - surface(s, t - e)).cross(surface(s + e, t) - surface(s - e, t));
            g.vertex(surface(s, t), n.normalize_or(Vec3::Y), Vec2::new(3.0 * s, 1.6 * t));
        }
    }
    for j in 0..nz {
        for i in 0..nx {
            let a = j * (nx + 1) + i;
            let (b, c, d) = (a + 1, a + nx + 2, a + nx + 1);
            g.triangles.extend([[a, d, c], [a, c, b]]);
        }
    }
    g
}

/// A stack of split logs between two stakes, 2.4 m long.
pub(super) fn stack(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    for x in [-1.25, 1.25] {
        k.bar(Oak, &[p(x, -0.4, 0.0), p(x, 1.25, 0.0)], 0.05, 8);
    }
    for row in 0..6_u32 {
        for i in 0..13 - row % 2 {
            let r = |c: u32| unit(581, (row * 16 + i) * 4 + c);
            let x = -1.08 + 0.18 * (i as f32 + 0.5 * (row % 2) as f32);
            let y = 0.075 + 0.163 * row as f32;
            let half = 0.36 + 0.06 * r(0);
            k.bar(Log, &[p(x, y, -half), p(x, y, half)], 0.084 + 0.008 * r(1), 8);
        }
    }
    k
}

/// A kettle on a tripod over stones and logs.
pub(super) fn kettle(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let top = p(0.0, 1.85, 0.0);
    for i in 0..3 {
        let d = Quat::from_rotation_y(TAU * (i as f32 + 0.2) / 3.0) * Vec3::X;
        k.bar(Oak, &[d * 0.95 - Vec3::Y * 0.15, top - d * 0.12 + Vec3::Y * 0.2], 0.035, 10);
    }
    k.bar(Iron, &[top, p(0.0, 1.12, 0.0)], 0.01, 6);
    k.bar(
        Iron,
        &[p(-0.3, 0.83, 0.0), p(-0.2, 1.05, 0.0), p(0.0, 1.13, 0.0), p(0.2, 1.05, 0.0), p(0.3, 0.83, 0.0)],
        0.011,
        8,
    );
    let pot = [
        [0.0, 0.4],
        [0.2, 0.42],
        [0.31, 0.52],
        [0.33, 0.68],
        [0.28, 0.82],
        [0.32, 0.86],
        [0.29, 0.87],
        [0.25, 0.82],
        [0.28, 0.68],
        [0.24, 0.55],
        [0.0, 0.52],
    ];
    k.turned(DarkSteel, Vec3::ZERO, &pot, 32);
    for i in 0..9 {
        let turn = Quat::from_rotation_y(TAU * i as f32 / 9.0);
        let place = Affine3A::from_scale_rotation_translation(
            Vec3::new(0.17, 0.12, 0.14),
            turn,
            turn * p(0.62, 0.03, 0.0),
        );
        k.add(Stone, &ball(if detail.0 > 0.3 { 2 } else { 1 }), &place);
    }
    for i in 0..5 {
        let d = Quat::from_rotation_y(TAU * (i as f32 + 0.4) / 5.0) * Vec3::X;
        k.bar(Log, &[d * 0.42 + Vec3::Y * 0.03, Vec3::Y * 0.2 - d * 0.06], 0.05, 8);
    }
    k
}

/// A sign on an arm; the board hangs from the origin.
pub(super) fn sign(detail: Detail, which: usize) -> Things {
    let mut k: Things = Kit::new(detail);
    for x in [-0.24, 0.24] {
        k.bar(Iron, &[p(x, 0.0, 0.0), p(x, -0.2, 0.0)], 0.007, 6);
    }
    k.block(Oak, [-0.36, -0.72, -0.02], [0.36, -0.18, 0.02], 0.01);
    for s in [-1.0_f32, 1.0] {
        let along = Vec3::Z * s;
        let of = [Brass, Red][which % 2];
        k.turned_along(
            of,
            p(0.0, -0.45, 0.018 * s),
            along,
            &[[0.19, 0.0], [0.19, 0.012], [0.12, 0.02], [0.0, 0.022]],
            30,
        );
    }
    k
}

/// The arm that carries a sign, from a wall that looks along +Z: the sign hangs 0.75 m before it.
pub(super) fn sign_arm(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.block(Iron, [-0.05, -0.5, -0.03], [0.05, 0.12, 0.02], 0.008);
    k.bar(Iron, &[p(0.0, 0.02, 0.0), p(0.0, 0.02, 1.2)], 0.02, 8);
    k.bar(Iron, &[p(0.0, -0.42, 0.01), p(0.0, -0.2, 0.3), p(0.0, 0.01, 0.9)], 0.014, 8);
    k
}
