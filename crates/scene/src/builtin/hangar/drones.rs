//! The drones, each about its middle: bodies, and what they carry.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Affine3A, Quat, Vec2, Vec3};

use super::palette::Stuff::{self, *};
use super::plan::*;
use crate::builtin::joinery::torus;
use crate::builtin::kit::Kit;
use crate::builtin::shapes::Geometry;
use crate::builtin::{Detail, emitters};

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A drone's body with what holds its lamp.
pub(super) fn body(detail: Detail, lamp: Lamp) -> Things {
    let mut k: Things = Kit::new(detail);
    let level = |y: f32| Affine3A::from_rotation_translation(Quat::from_rotation_x(FRAC_PI_2), Vec3::Y * y);
    let shell =
        [[0.0, -0.07], [0.07, -0.065], [0.12, -0.03], [0.13, 0.0], [0.11, 0.035], [0.05, 0.06], [0.0, 0.065]];
    k.round(if lamp == Lamp::Ring { White } else { Carbon }, Vec3::ZERO, &shell, 26);
    k.turned(Orange, Vec3::ZERO, &[[0.125, -0.012], [0.137, -0.008], [0.137, 0.008], [0.125, 0.012]], 26);
    match lamp {
        Lamp::Ring => {
            // The ring goes around; spokes hold it from inside, three rotors stand above them.
            for i in 0..6 {
                let d = Quat::from_rotation_y(TAU * i as f32 / 6.0) * Vec3::X;
                k.bar(Carbon, &[d * 0.1, d * (RING[0] - 0.8 * RING[1])], 0.009, 6);
            }
            for i in 0..3 {
                let d = Quat::from_rotation_y(TAU * (i as f32 + 0.25) / 3.0) * Vec3::X;
                let hub = d * 0.24 + Vec3::Y * 0.09;
                k.bar(Carbon, &[d * 0.08 + Vec3::Y * 0.03, hub], 0.014, 8);
                rotor(&mut k, hub, 0.1);
            }
        }
        _ => {
            for i in 0..4 {
                let d = Quat::from_rotation_y(TAU * (i as f32 + 0.5) / 4.0) * Vec3::X;
                let hub = d * 0.34 + Vec3::Y * 0.05;
                k.bar(Carbon, &[d * 0.08, hub - Vec3::Y * 0.01], 0.016, 8);
                rotor(&mut k, hub, 0.13);
                let guard = torus(0.14, 0.007, [detail.facets(28, 8), detail.facets(6, 3)]);
                let place = level(0.065) * Affine3A::IDENTITY;
                k.add(Carbon, &guard, &(Affine3A::from_translation(d * 0.34) * place));
            }
            // What holds the lamp from above.
            match lamp {
                Lamp::Sphere => {
                    let cap = [[0.0, -0.085], [0.05, -0.09], [0.06, -0.098], [0.07, -0.085], [0.03, -0.05]];
                    k.turned(Chrome, Vec3::ZERO, &cap, 20);
                }
                _ => {
                    let back = -BELOW + 0.004;
                    k.bar(Chrome, &[p(0.0, -0.05, 0.0), p(0.0, back + 0.01, 0.0)], 0.02, 10);
                    if lamp == Lamp::Disc {
                        k.turned(
                            Chrome,
                            p(0.0, back, 0.0),
                            &[[DISC + 0.012, 0.0], [DISC + 0.012, 0.012], [0.06, 0.035]],
                            32,
                        );
                    } else {
                        let [x, z] = RECTANGLE;
                        k.block(
                            Chrome,
                            [-x - 0.012, back, -z - 0.012],
                            [x + 0.012, back + 0.02, z + 0.012],
                            0.005,
                        );
                    }
                }
            }
        }
    }
    k
}

/// A motor with two blades.
fn rotor(k: &mut Things, hub: Vec3, reach: f32) {
    k.turned(Chrome, hub, &[[0.02, -0.02], [0.024, 0.0], [0.018, 0.03], [0.006, 0.04]], 12);
    for s in [-1.0_f32, 1.0] {
        k.plank(
            Rubber,
            hub + Vec3::Y * 0.03,
            hub + p(s * reach, 0.03, 0.3 * s * reach),
            p(0.0, 0.3, 1.0),
            [0.012, 0.0025],
        );
    }
}

/// What a drone carries, and where it is in the drone's space: how it lies there, and how far below the middle.
pub(super) fn lamp(detail: Detail, lamp: Lamp) -> (Geometry, Quat, f32) {
    let down = crate::builtin::path::look_along(Vec3::NEG_Y);
    match lamp {
        Lamp::Sphere => (emitters::sphere(detail, SPHERE), Quat::IDENTITY, BELOW),
        Lamp::Ring => {
            let ring = torus(RING[0], RING[1], [detail.facets(48, 16), detail.facets(10, 5)]);
            (ring, Quat::from_rotation_x(FRAC_PI_2), 0.0)
        }
        Lamp::Rectangle => (emitters::rectangle(Vec2::from(RECTANGLE)), down, BELOW),
        Lamp::Disc => (emitters::disc(detail, DISC), down, BELOW),
    }
}
