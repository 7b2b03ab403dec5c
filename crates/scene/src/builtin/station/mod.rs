//! The station: a hangar in space with modules, booms, solar panels and a mast, past which rocks drift. Almost nothing moves.

mod hull;
mod motion;
mod outside;
mod palette;
mod plan;

use glam::{Quat, Vec3};

use super::builder::*;
use super::physics::frame_times;
use super::shapes::boulder;
use super::{BuiltinError, Detail, path};
use crate::LightKind;
use palette::{Palette, Stuff};
use plan::*;

/// Makes the scene.
pub(super) fn glb(detail: Detail) -> Result<Vec<u8>, BuiltinError> {
    let mut b = GlbBuilder::new();
    let palette = Palette::new(&mut b)?;
    build_hangar(&mut b, &palette, detail);
    let animation = b.animation("station");
    attach(&mut b, &palette, animation, detail);
    load_deck(&mut b, &palette, detail);
    light(&mut b, &palette, detail);
    drift(&mut b, &palette, animation, detail);
    let paths = [("path-deck", motion::deck()), ("path-orbit", motion::orbit())];
    path::place_cameras(&mut b, animation, paths, FRAMES);
    b.finish()
}

fn build_hangar(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    for (name, kit) in [
        ("slabs", hull::slabs(detail)),
        ("plating", hull::plating(detail)),
        ("ribs", hull::ribs(detail)),
        ("services", hull::services(detail)),
        ("roof", hull::roof(detail)),
    ] {
        let mesh = kit.mesh(b, name, |s| palette.of(s));
        b.node(name, &NodeSpec::mesh_at(mesh, Vec3::ZERO, 0.0));
    }
}

fn attach(b: &mut GlbBuilder, palette: &Palette, animation: AnimationId, detail: Detail) {
    let module = outside::module(detail).mesh(b, "module", |s| palette.of(s));
    let stays = outside::stays(detail).mesh(b, "stays", |s| palette.of(s));
    let airlock = outside::airlock(detail).mesh(b, "airlock", |s| palette.of(s));
    let bay = outside::truss_bay(detail).mesh(b, "truss-bay", |s| palette.of(s));
    let panel = outside::solar_panel(detail).mesh(b, "solar-panel", |s| palette.of(s));
    let mast = outside::mast(detail).mesh(b, "mast", |s| palette.of(s));
    let dish = outside::dish(detail).mesh(b, "dish", |s| palette.of(s));
    let times: Vec<f32> = (0..=motion::KEYS).map(|i| SECONDS * i as f32 / motion::KEYS as f32).collect();
    let parts: Vec<f32> = times.iter().map(|t| t / SECONDS).collect();
    for (number, side) in [1.0_f32, -1.0].into_iter().enumerate() {
        let turn = outside::side_turn(side);
        let axis = |x: f32| Vec3::new(side * x, MODULE[2], 0.0);
        b.node("module", &NodeSpec::mesh_at(module, axis(MODULE[0]), turn));
        b.node("stays", &NodeSpec::mesh_at(stays, axis(MODULE[0]), turn));
        let turns: Vec<Quat> = parts.iter().map(|&t| rotation_y(turn) * motion::airlock(t)).collect();
        let spec = NodeSpec {
            rotation: turns[0],
            ..NodeSpec::mesh_at(airlock, axis(MODULE[0] + MODULE[1] - 0.3), 0.0)
        };
        let node = b.node(&format!("airlock-{number}"), &spec);
        b.channel(animation, node, &times, Track::Rotation(&turns), false);
        for i in 0..BAYS {
            let along = BOOM[0] - 0.35 + BOOM[1] * i as f32;
            b.node("truss-bay", &NodeSpec::mesh_at(bay, axis(along), turn));
            if PANEL_BAYS.contains(&i) {
                for ahead in [0.0, std::f32::consts::PI] {
                    let at = axis(along + 0.5 * BOOM[1]) + rotation_y(ahead) * Vec3::Z * BOOM[2];
                    b.node("solar-panel", &NodeSpec::mesh_at(panel, at, ahead));
                }
            }
        }
    }
    let down = Quat::from_rotation_z(-std::f32::consts::FRAC_PI_2);
    let keel = |i: u32| Vec3::new(0.0, -0.48 - BOOM[1] * i as f32, -1.0);
    for i in 0..KEEL_BAYS {
        b.node("truss-bay", &NodeSpec { rotation: down, ..NodeSpec::mesh_at(bay, keel(i), 0.0) });
    }
    let probe = outside::probe(detail).mesh(b, "probe", |s| palette.of(s));
    b.node("probe", &NodeSpec::mesh_at(probe, keel(KEEL_BAYS), 0.0));
    b.node("mast", &NodeSpec::mesh_at(mast, MAST.0, 0.0));
    let turns: Vec<Quat> = parts.iter().map(|&t| motion::dish(t)).collect();
    let spec = NodeSpec {
        rotation: turns[0],
        ..NodeSpec::mesh_at(dish, Vec3::new(-7.0, CEILING + 0.58, -4.0), 0.0)
    };
    let node = b.node("dish", &spec);
    b.channel(animation, node, &times, Track::Rotation(&turns), false);
}

fn load_deck(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let containers = [Stuff::Blue, Stuff::Olive, Stuff::Red]
        .map(|color| outside::container(detail, color).mesh(b, "container", |s| palette.of(s)));
    for container in CONTAINERS {
        let mesh = containers[container.color];
        b.node("container", &NodeSpec::mesh_at(mesh, container.at, container.turn));
    }
    let barrel = outside::barrel(detail).mesh(b, "barrel", |s| palette.of(s));
    for &[x, z] in BARRELS {
        b.node("barrel", &NodeSpec::mesh_at(barrel, Vec3::new(x, 0.0, z), 1.7 * x));
    }
    let pod = outside::pod(detail).mesh(b, "pod", |s| palette.of(s));
    b.node("pod", &NodeSpec::mesh_at(pod, POD, 0.25));
}

fn light(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let sun = LightSpec {
        color: Vec3::new(1.0, 0.97, 0.92),
        intensity: 3.2,
        range: None,
        kind: LightKind::Directional,
    };
    let sun = b.light("sun", &sun);
    let rotation = path::look_along(Vec3::new(-0.45, -0.75, -0.62));
    let translation = Vec3::new(20.0, 30.0, 26.0);
    b.node("sun", &NodeSpec { light: Some(sun), rotation, translation, ..NodeSpec::default() });

    let bulb = LightSpec {
        color: Vec3::new(0.92, 0.96, 1.0),
        intensity: 11.0,
        range: Some(11.0),
        kind: LightKind::Point,
    };
    let bulb = b.light("lamp", &bulb);
    let housing = outside::lamp(detail).mesh(b, "lamp-housing", |s| palette.of(s));
    let glass = outside::glass(detail).mesh(b, "lamp-glass", |s| palette.of(s));
    for [x, z] in LAMPS {
        let at = Vec3::new(x, CEILING - 0.4, z);
        b.node("lamp-housing", &NodeSpec::mesh_at(housing, at, 0.0));
        b.node("lamp-glass", &NodeSpec { casts: false, ..NodeSpec::mesh_at(glass, at, 0.0) });
        // Below the glass, so that the housing does not shade its own light.
        let translation = at - Vec3::Y * 0.1;
        b.node("lamp", &NodeSpec { light: Some(bulb), translation, ..NodeSpec::default() });
    }
    let spot = LightSpec {
        color: Vec3::new(1.0, 0.8, 0.55),
        intensity: 90.0,
        range: Some(25.0),
        kind: LightKind::Spot { inner_cone_angle: 0.2, outer_cone_angle: 0.42 },
    };
    let spot = b.light("spot", &spot);
    for (at, aim) in [
        (Vec3::new(8.2, 4.3, 5.6), POD + Vec3::Y),
        (Vec3::new(-8.2, 4.3, 5.6), Vec3::new(-5.0, 0.4, -4.0)),
        (Vec3::new(9.0, 8.0, 7.0), Vec3::new(18.0, MODULE[2], 1.0)),
        (Vec3::new(-9.0, 8.0, 7.0), Vec3::new(-18.0, MODULE[2], 1.0)),
    ] {
        let rotation = path::look_along(aim - at);
        b.node("spot", &NodeSpec { light: Some(spot), rotation, translation: at, ..NodeSpec::default() });
    }
}

fn drift(b: &mut GlbBuilder, palette: &Palette, animation: AnimationId, detail: Detail) {
    // Triangles of an icosphere fall by 4 a level.
    let level = if detail.0 > 0.5 {
        4
    } else if detail.0 > 0.15 {
        3
    } else {
        2
    };
    let stones = [(Stuff::RockGray, 950), (Stuff::RockBrown, 951), (Stuff::RockDark, 952)]
        .map(|(stuff, seed)| b.mesh("rock", &[(&boulder(level, seed), palette.of(stuff))]));
    // Rocks keep their velocity: two keys of place, and of rotation a few, none farther than half a turn from the next.
    let ends = frame_times(&[0, FRAMES as usize]);
    let steps = frame_times(&(0..=6).map(|i| i * FRAMES as usize / 6).collect::<Vec<_>>());
    for (i, rock) in rocks().iter().enumerate() {
        let (translation, rotation) = rock.pose(0.0);
        let spec = NodeSpec {
            mesh: Some(stones[rock.stone]),
            translation,
            rotation,
            scale: Vec3::splat(rock.radius),
            ..NodeSpec::default()
        };
        let node = b.node(&format!("rock-{i}"), &spec);
        let places: Vec<Vec3> = ends.iter().map(|&t| rock.pose(t).0).collect();
        b.channel(animation, node, &ends, Track::Translation(&places), false);
        let turns: Vec<Quat> = steps.iter().map(|&t| rock.pose(t).1).collect();
        b.channel(animation, node, &steps, Track::Rotation(&turns), false);
    }
}

#[cfg(test)]
mod tests;
