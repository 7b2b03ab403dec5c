//! A street between houses, lit by three area lights that move: two spheres and a cube that turns. Wheels with spokes turn beside their
//! ways, and a carriage drives up and down, so that thin shadows move fast. All other lamps are off.

mod fronts;
mod machines;
mod motion;
mod palette;
mod plan;
mod things;

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Quat, Vec3};

use super::builder::*;
use super::kit::Kit;
use super::movers::{self, Motion};
use super::shapes::cuboid;
use super::{BuiltinError, Detail, emitters, path};
use palette::{Palette, Stuff};
use plan::*;

/// Makes the scene.
pub(super) fn glb(detail: Detail) -> Result<Vec<u8>, BuiltinError> {
    let mut b = GlbBuilder::new();
    let palette = Palette::new(&mut b)?;
    build(&mut b, &palette, detail);
    furnish(&mut b, &palette, detail);
    let animation = b.animation("street");
    turn_wheels(&mut b, &palette, animation, detail);
    drive(&mut b, &palette, animation, detail);
    light(&mut b, &palette, animation, detail);
    let paths = [("path-walk", motion::walk()), ("path-crane", motion::crane())];
    path::place_cameras(&mut b, animation, paths, FRAMES);
    b.finish()
}

fn make(b: &mut GlbBuilder, palette: &Palette, name: &str, kit: &Kit<Stuff>) -> MeshId {
    kit.mesh(b, name, |s| palette.of(s))
}

/// Where a house of a row stands, and its turn.
fn house_place(side: usize, i: usize) -> (Vec3, f32) {
    let x = -LENGTH + HOUSE * (i as f32 + 0.5);
    match side {
        0 => (Vec3::new(x, PAVEMENT, -FRONTS), 0.0),
        _ => (Vec3::new(x, PAVEMENT, FRONTS), PI),
    }
}

fn build(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let ground = make(b, palette, "ground", &things::ground(detail));
    b.node("ground", &NodeSpec::mesh_at(ground, Vec3::ZERO, 0.0));
    let houses: Vec<MeshId> = (0..FRONT.len())
        .map(|i| make(b, palette, &format!("house-{i}"), &fronts::house(detail, i)))
        .collect();
    let cores: Vec<MeshId> =
        (0..FRONT.len()).map(|i| make(b, palette, &format!("core-{i}"), &fronts::core(detail, i))).collect();
    // Cores block light but carry none.
    let put = |b: &mut GlbBuilder, which: usize, at: Vec3, turn: f32| {
        b.node("house", &NodeSpec::mesh_at(houses[which], at, turn));
        b.node("core", &NodeSpec { receives: false, ..NodeSpec::mesh_at(cores[which], at, turn) });
    };
    for (side, row) in ROWS.iter().enumerate() {
        for (i, &which) in row.iter().enumerate() {
            let (at, turn) = house_place(side, i);
            put(b, which, at, turn);
        }
    }
    // The east end: a house across, and walls beside it.
    let east = Vec3::new(LENGTH + 0.35, PAVEMENT, 0.0);
    put(b, 4, east, -FRAC_PI_2);
    let mut wing: Kit<Stuff> = Kit::new(detail);
    for s in [-1.0_f32, 1.0] {
        let (a, z) = (s * 0.5 * HOUSE, s * (FRONTS + 4.0));
        wing.plain(Stuff::Sand, [a.min(z), -0.3, -4.0], [a.max(z), 7.0, -0.12]);
        wing.block(Stuff::Trim, [a.min(z), 6.95, -4.1], [a.max(z), 7.15, 0.05], 0.02);
        wing.block(Stuff::Trim, [a.min(z), -0.3, -0.2], [a.max(z), 0.6, -0.04], 0.02);
    }
    let wing = make(b, palette, "wings", &wing);
    b.node("wings", &NodeSpec::mesh_at(wing, east, -FRAC_PI_2));
    let gate = make(b, palette, "gate", &fronts::gate(detail));
    b.node("gate", &NodeSpec::mesh_at(gate, Vec3::new(-LENGTH, 0.0, 0.0), FRAC_PI_2));
    let cloth = fronts::awning(detail);
    let cloths =
        [Stuff::RedCloth, Stuff::GreenCloth].map(|of| b.mesh("awning-cloth", &[(&cloth, palette.of(of))]));
    let frame = make(b, palette, "awning-frame", &fronts::awning_frame(detail));
    for (side, i, color) in AWNINGS {
        let (foot, turn) = house_place(side, i);
        let at = foot + rotation_y(turn) * Vec3::new(0.0, 3.42, 0.1);
        b.node("awning-cloth", &NodeSpec::mesh_at(cloths[color], at, turn));
        b.node("awning-frame", &NodeSpec::mesh_at(frame, at, turn));
    }
}

fn furnish(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let table = make(b, palette, "table", &things::table(detail));
    let chair = make(b, palette, "chair", &things::chair(detail));
    let ground = |[x, z]: [f32; 2]| Vec3::new(x, PAVEMENT, z);
    for (i, at) in TABLES.into_iter().enumerate() {
        b.node("table", &NodeSpec::mesh_at(table, ground(at), 1.1 * i as f32));
        let chairs = 2 + i % 2;
        for j in 0..chairs {
            // Chairs look at their table.
            let turn = 0.4 + 0.7 * i as f32 + std::f32::consts::TAU * j as f32 / chairs as f32;
            let at = ground(at) + rotation_y(turn) * Vec3::new(0.0, 0.0, -0.58);
            b.node("chair", &NodeSpec::mesh_at(chair, at, turn + 0.2 * (j as f32 - 0.5)));
        }
    }
    let mut set = |name: &str, kit: &Kit<Stuff>, places: &[(Vec3, f32, f32)]| {
        let mesh = make(b, palette, name, kit);
        for &(at, turn, scale) in places {
            b.node(name, &NodeSpec { scale: Vec3::splat(scale), ..NodeSpec::mesh_at(mesh, at, turn) });
        }
    };
    let upright = |places: &[[f32; 2]], turn: f32| -> Vec<(Vec3, f32, f32)> {
        places.iter().map(|&at| (ground(at), turn * at[0], 1.0)).collect()
    };
    set("lantern", &things::lantern(detail), &upright(&LANTERNS, 0.0));
    set("bollard", &things::bollard(detail), &upright(&BOLLARDS, 1.0));
    set("tub", &things::tub(detail), &TUBS.map(|(at, scale)| (ground(at), at[0], scale)));
    set("bicycle", &things::bicycle(detail), &BICYCLES.map(|(at, turn)| (ground(at), turn, 1.0)));
    let mut cask: Kit<Stuff> = Kit::new(detail);
    cask.cask([Stuff::Wood, Stuff::Iron]);
    set("barrel", &cask, &upright(&BARRELS, 2.0));
    let mut case: Kit<Stuff> = Kit::new(detail);
    case.crate_box([Stuff::Boards, Stuff::Wood]);
    let crates = CRATES.map(|(at, lift, turn, scale)| (ground(at) + Vec3::Y * lift, turn, 0.7 * scale));
    set("crate", &case, &crates);
    let strings = STRINGS.map(|x| (Vec3::new(x, STRING_HEIGHT, 0.0), 0.0, 1.0));
    set("string", &things::string(detail), &strings);
}

/// Adds a node with its places and rotations, one a key.
fn moving(
    b: &mut GlbBuilder,
    animation: AnimationId,
    name: &str,
    spec: &NodeSpec,
    places: Option<&[Vec3]>,
    turns: Option<&[Quat]>,
) {
    movers::place(b, animation, &motion::key_times(), name, spec, Motion { places, turns });
}

/// Parts (0 … 1) of the animation at its keys.
fn parts() -> impl Iterator<Item = f32> {
    (0..=motion::KEYS).map(|k| k as f32 / motion::KEYS as f32)
}

fn turn_wheels(b: &mut GlbBuilder, palette: &Palette, animation: AnimationId, detail: Detail) {
    for (i, (axle, turn, radius, spokes, rounds)) in WHEELS.into_iter().enumerate() {
        let name = format!("wheel-{i}");
        let mesh = make(b, palette, &name, &machines::fortune(detail, radius, spokes));
        let turns: Vec<Quat> = parts().map(|t| rotation_y(turn) * motion::fortune(t, rounds)).collect();
        moving(b, animation, &name, &NodeSpec::mesh_at(mesh, axle, 0.0), None, Some(&turns));
        let name = format!("stand-{i}");
        let stand = make(b, palette, &name, &machines::stand(detail, axle.y));
        b.node(&name, &NodeSpec::mesh_at(stand, Vec3::new(axle.x, 0.0, axle.z), turn));
    }
}

fn drive(b: &mut GlbBuilder, palette: &Palette, animation: AnimationId, detail: Detail) {
    let along: Vec<f32> = parts().map(motion::drive).collect();
    let mesh = make(b, palette, "carriage", &machines::carriage(detail));
    let places: Vec<Vec3> = along.iter().map(|&x| Vec3::new(x, 0.0, DRIVE[0])).collect();
    moving(b, animation, "carriage", &NodeSpec::mesh_at(mesh, places[0], 0.0), Some(&places), None);
    let (axles, half) = machines::AXLES;
    for (end, (axle, radius)) in axles.into_iter().zip(machines::ROLL).enumerate() {
        let mesh =
            make(b, palette, ["front-wheel", "rear-wheel"][end], &machines::carriage_wheel(detail, radius));
        let turns: Vec<Quat> = along.iter().map(|&x| motion::roll(x, radius)).collect();
        for (side, z) in [-half, half].into_iter().enumerate() {
            let places: Vec<Vec3> =
                along.iter().map(|&x| Vec3::new(x + axle, radius, DRIVE[0] + z)).collect();
            let name = format!("{}-wheel-{side}", ["front", "rear"][end]);
            moving(
                b,
                animation,
                &name,
                &NodeSpec::mesh_at(mesh, places[0], 0.0),
                Some(&places),
                Some(&turns),
            );
        }
    }
}

fn light(b: &mut GlbBuilder, palette: &Palette, animation: AnimationId, detail: Detail) {
    let [warm, cool, way] = motion::lights();
    for (i, (places, of)) in [(warm, Stuff::Warm), (cool, Stuff::Cool)].into_iter().enumerate() {
        let name = format!("light-sphere-{i}");
        let mesh = b.mesh(&name, &[(&emitters::sphere(detail, SPHERES[i]), palette.of(of))]);
        moving(b, animation, &name, &emitters::at(mesh, Emitter::Sphere, places[0]), Some(&places), None);
    }
    // The cube is no shape of its own: its triangles emit.
    let cube = cuboid(Vec3::splat(-CUBE), Vec3::splat(CUBE));
    let mesh = b.mesh("light-cube", &[(&cube, palette.of(Stuff::Cube))]);
    let turns: Vec<Quat> = parts().map(motion::cube).collect();
    moving(b, animation, "light-cube", &NodeSpec::mesh_at(mesh, way[0], 0.0), Some(&way), Some(&turns));
}

#[cfg(test)]
mod tests;
