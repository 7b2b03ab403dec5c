//! A village at night: houses of timber on rolling land, lit by torches and a moon.
//!
//! Nothing but area lights: the nodes `flame` are small meshes that emit from their triangles, the node `moon` is a disc. None of
//! them moves.

mod ground;
mod houses;
mod mill;
mod motion;
mod palette;
mod plan;
mod things;
mod trees;

use std::f32::consts::FRAC_PI_2;

use glam::{Quat, Vec2, Vec3};

use super::builder::*;
use super::kit::Kit;
use super::movers::{self, Motion};
use super::shapes::boulder;
use super::{BuiltinError, Detail, emitters, path};
use palette::{Palette, Stuff};
use plan::*;

/// Makes the scene.
pub(super) fn glb(detail: Detail) -> Result<Vec<u8>, BuiltinError> {
    let mut b = GlbBuilder::new();
    let palette = Palette::new(&mut b)?;
    lay_land(&mut b, &palette, detail);
    plant(&mut b, &palette, detail);
    build(&mut b, &palette, detail);
    furnish(&mut b, &palette, detail);
    let animation = b.animation("village");
    animate(&mut b, &palette, animation, detail);
    light(&mut b, &palette, detail);
    let paths = [("path-lane", motion::lane()), ("path-roofs", motion::roofs())];
    path::place_cameras(&mut b, animation, paths, FRAMES);
    b.finish()
}

fn make(b: &mut GlbBuilder, palette: &Palette, name: &str, kit: &Kit<Stuff>) -> MeshId {
    kit.mesh(b, name, |s| palette.of(s))
}

fn lay_land(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let surface = ground::surface(detail);
    let block = ground::block(&surface);
    let [grass, road] = &surface;
    let land = b.mesh("land", &[(grass, palette.of(Stuff::Grass)), (road, palette.of(Stuff::Road))]);
    b.node("land", &NodeSpec::mesh_at(land, Vec3::ZERO, 0.0));
    // Nobody sees it, so it carries no light.
    let bedrock = b.mesh("bedrock", &[(&block, palette.of(Stuff::Earth))]);
    b.node("bedrock", &NodeSpec { receives: false, ..NodeSpec::mesh_at(bedrock, Vec3::ZERO, 0.0) });
    let water = b.mesh("water", &[(&ground::water(detail), palette.of(Stuff::Water))]);
    b.node("water", &NodeSpec::mesh_at(water, Vec3::ZERO, 0.0));
}

fn plant(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let put = |b: &mut GlbBuilder, name: &str, mesh: MeshId, (at, turn, scale): ([f32; 2], f32, f32)| {
        let spec = NodeSpec { scale: Vec3::splat(scale), ..NodeSpec::mesh_at(mesh, on_ground(at), turn) };
        b.node(name, &spec);
    };
    let tree = |b: &mut GlbBuilder, [wood, leaves]: [super::shapes::Geometry; 2], name: &str, of: Stuff| {
        let wood = b.mesh(&format!("{name}-wood"), &[(&wood, palette.of(Stuff::Bark))]);
        (wood, b.mesh(&format!("{name}-leaves"), &[(&leaves, palette.of(of))]))
    };
    let leafy = [1, 2].map(|seed| tree(b, trees::leafy(700 + seed, detail), "tree", Stuff::Leaf));
    let firs = [1, 2].map(|seed| tree(b, trees::fir(710 + seed, detail), "fir", Stuff::Needle));
    for (i, place) in TREES.into_iter().enumerate() {
        put(b, "tree-wood", leafy[i % 2].0, place);
        put(b, "tree-leaves", leafy[i % 2].1, place);
    }
    for (i, place) in plan::firs().into_iter().enumerate() {
        put(b, "fir-wood", firs[i % 2].0, place);
        put(b, "fir-leaves", firs[i % 2].1, place);
    }
    let tufts = [1, 2, 3]
        .map(|seed| b.mesh("tuft-leaves", &[(&ground::tuft(720 + seed, detail), palette.of(Stuff::Blade))]));
    for (i, place) in ground::tufts().into_iter().enumerate() {
        put(b, "tuft-leaves", tufts[i % 3], place);
    }
    // Triangles of an icosphere fall by 4 a level.
    let level = if detail.0 > 0.5 {
        3
    } else if detail.0 > 0.15 {
        2
    } else {
        1
    };
    let stones =
        [971, 972, 973].map(|seed| b.mesh("rock", &[(&boulder(level, seed), palette.of(Stuff::Rock))]));
    for (i, (at, radius)) in ROCKS.into_iter().enumerate() {
        put(b, "rock", stones[i % 3], (at, 1.7 * i as f32, radius));
    }
}

fn build(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let designs: Vec<MeshId> = (0..DESIGNS.len())
        .map(|i| make(b, palette, &format!("house-{i}"), &houses::house(detail, i)))
        .collect();
    for plot in PLOTS {
        let name = if plot.design == 3 { "hall" } else { "house" };
        b.node(name, &NodeSpec::mesh_at(designs[plot.design], on_ground(plot.at), plot.turn));
    }
    let tower = make(b, palette, "mill", &mill::tower(detail));
    b.node("mill", &NodeSpec::mesh_at(tower, on_ground(MILL.0), MILL.1));
}

fn furnish(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let fence = make(b, palette, "fence", &things::fence(detail));
    for corners in FENCES {
        for pair in corners.windows(2) {
            let (a, z) = (Vec2::from(pair[0]), Vec2::from(pair[1]));
            let count = libm::roundf(a.distance(z) / 2.0).max(1.0);
            for i in 0..count as u32 {
                let at = a.lerp(z, (i as f32 + 0.5) / count);
                let along = z - a;
                // Panels follow the slope along them.
                let half = along.normalize_or(Vec2::X) * 0.9;
                let rise = (ground(at + half) - ground(at - half)) / 1.8;
                let rotation =
                    rotation_y(libm::atan2f(-along.y, along.x)) * Quat::from_rotation_z(libm::atanf(rise));
                let spec = NodeSpec { rotation, ..NodeSpec::mesh_at(fence, on_ground(at.to_array()), 0.0) };
                b.node("fence", &spec);
            }
        }
    }
    let barrel = make(b, palette, "barrel", &things::barrel(detail));
    for at in BARRELS {
        b.node("barrel", &NodeSpec::mesh_at(barrel, on_ground(at), 2.3 * at[0]));
    }
    let crates = make(b, palette, "crate", &things::crate_box(detail));
    for (at, turn, scale, lift) in CRATES {
        let spec = NodeSpec {
            scale: Vec3::splat(scale),
            ..NodeSpec::mesh_at(crates, on_ground(at) + Vec3::Y * lift, turn)
        };
        b.node("crate", &spec);
    }
    let mut set = |name: &str, kit: &Kit<Stuff>, places: &[([f32; 2], f32)]| {
        let mesh = make(b, palette, name, kit);
        for &(at, turn) in places {
            b.node(name, &NodeSpec::mesh_at(mesh, on_ground(at), turn));
        }
    };
    set("cart", &things::cart(detail), &CARTS);
    set("well", &things::well(detail), &[(WELL, 0.3)]);
    set("stall", &things::stall(detail), &STALLS);
    set("stack", &things::stack(detail), &STACKS);
    set("kettle", &things::kettle(detail), &[(KETTLE, 0.2)]);
    let awning = b.mesh("awning-cloth", &[(&things::awning(detail), palette.of(Stuff::Cloth))]);
    for (at, turn) in STALLS {
        b.node("awning-cloth", &NodeSpec::mesh_at(awning, on_ground(at), turn));
    }
}

fn animate(b: &mut GlbBuilder, palette: &Palette, animation: AnimationId, detail: Detail) {
    let times = motion::key_times();
    let parts: Vec<f32> = times.iter().map(|t| t / SECONDS).collect();
    let (at, turn, axle, _) = MILL;
    let hub = on_ground(at) + rotation_y(turn) * Vec3::new(0.0, axle, mill::AHEAD);
    let mesh = make(b, palette, "sails", &mill::sails(detail));
    let turns: Vec<Quat> = parts.iter().map(|&t| rotation_y(turn) * motion::sails(t)).collect();
    let motion = Motion { turns: Some(&turns), ..Motion::default() };
    movers::place(b, animation, &times, "sails", &NodeSpec::mesh_at(mesh, hub, 0.0), motion);

    let arm = make(b, palette, "sign-arm", &things::sign_arm(detail));
    for (i, plot) in [&PLOTS[2], &PLOTS[7]].into_iter().enumerate() {
        let half = DESIGNS[plot.design].half;
        let local = Vec3::new(0.62 * half[0], 2.3, half[1] + 0.04);
        let foot = on_ground(plot.at);
        let on_wall = |p: Vec3| foot + rotation_y(plot.turn) * p;
        b.node("sign-arm", &NodeSpec::mesh_at(arm, on_wall(local), plot.turn));
        let name = format!("sign-{i}");
        let mesh = make(b, palette, &name, &things::sign(detail, i));
        let across = rotation_y(plot.turn + FRAC_PI_2);
        let turns: Vec<Quat> = parts.iter().map(|&t| across * motion::sign(t, i)).collect();
        let spec = NodeSpec::mesh_at(mesh, on_wall(local + Vec3::new(0.0, 0.0, 0.75)), 0.0);
        let motion = Motion { turns: Some(&turns), ..Motion::default() };
        movers::place(b, animation, &times, &name, &spec, motion);
    }
}

/// Where wall torches hang on a house's front: beside the door.
fn wall_torches(plot: &Plot) -> [Vec3; 2] {
    let half = DESIGNS[plot.design].half;
    let (x, wide) = ([0.75, -0.75, 0.3, 0.0][plot.design], if plot.design == 3 { 1.3 } else { 0.95 });
    [-wide, wide].map(|d| Vec3::new(x + d, 1.85, half[1] + 0.05))
}

fn light(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let flame = b.mesh("flame", &[(&things::flame(detail), palette.of(Stuff::Flame))]);
    let standing = make(b, palette, "torch", &things::torch(detail));
    let wall = make(b, palette, "wall-torch", &things::wall_torch(detail));
    let mut number = 0;
    let mut burn = |b: &mut GlbBuilder, at: Vec3, scale: f32| {
        let spec =
            NodeSpec { scale: Vec3::splat(scale), ..NodeSpec::mesh_at(flame, at, 2.4 * number as f32) };
        b.node("flame", &spec);
        number += 1;
    };
    for at in TORCHES {
        let foot = on_ground(at);
        b.node("torch", &NodeSpec::mesh_at(standing, foot, at[0]));
        burn(b, foot + Vec3::Y * things::STANDING, 1.0);
    }
    for plot in &PLOTS {
        for local in wall_torches(plot) {
            let turn = rotation_y(plot.turn);
            let at = on_ground(plot.at) + turn * local;
            b.node("wall-torch", &NodeSpec::mesh_at(wall, at, plot.turn));
            burn(b, at + turn * things::ON_WALL, 0.85);
        }
    }
    for (x, z) in [(0.05, 0.0), (-0.1, 0.09), (0.0, -0.12)] {
        burn(b, on_ground(KETTLE) + Vec3::new(x, 0.16, z), 0.7);
    }
    let (at, radius, target) = MOON;
    let moon = b.mesh("moon", &[(&emitters::disc(detail, radius), palette.of(Stuff::Moon))]);
    let spec = NodeSpec { rotation: path::look_along(target - at), ..emitters::at(moon, Emitter::Disc, at) };
    b.node("moon", &spec);
}

#[cfg(test)]
mod tests;
