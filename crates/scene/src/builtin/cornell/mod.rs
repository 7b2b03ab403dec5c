//! The Cornell box, in which a block turns, and beside it stages whose visibility has a closed form.
//!
//! The origins of the nodes `stage-open`, `stage-disc`, `stage-wall` and `stage-ball` are places on level ground. Up to an
//! occlusion distance of 0.6 m each sees only its own stage: nothing; a disc of radius 0.4 m in 0.3 m height; at its foot a wall
//! 0.4 m high, that runs along Z and looks to +X, where all places of the stage up to 0.6 m from it have a closed form; a ball of
//! radius 0.25 m, its middle in 0.32 m height. `apps/dapple/tests/closed_forms.rs` holds rays and points to them.

mod motion;
mod palette;
mod parts;
mod plan;

use glam::{Quat, Vec3};

use super::builder::*;
use super::kit::Kit;
use super::{BuiltinError, Detail, path};
use crate::LightKind;
use palette::{Palette, Stuff};
use plan::*;

/// Makes the scene.
pub(super) fn glb(detail: Detail) -> Result<Vec<u8>, BuiltinError> {
    let mut b = GlbBuilder::new();
    let palette = Palette::new(&mut b)?;
    build(&mut b, &palette, detail);
    let animation = b.animation("cornell");
    fill_box(&mut b, &palette, animation, detail);
    set_stages(&mut b, &palette, detail);
    light(&mut b, &palette, detail);
    let paths = [("path-box", motion::into_box()), ("path-stages", motion::stages())];
    path::place_cameras(&mut b, animation, paths, FRAMES);
    b.finish()
}

/// Adds a mesh and a node that carries it, both by one name.
fn put(b: &mut GlbBuilder, palette: &Palette, name: &str, kit: &Kit<Stuff>, at: Vec3, turn: f32) -> NodeId {
    let mesh = kit.mesh(b, name, |s| palette.of(s));
    b.node(name, &NodeSpec::mesh_at(mesh, at, turn))
}

fn build(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    put(b, palette, "studio", &parts::studio(detail), Vec3::ZERO, 0.0);
    put(b, palette, "box", &parts::cornell_box(detail), BOX, 0.0);
    put(b, palette, "truss", &parts::truss(detail), Vec3::ZERO, 0.0);
}

fn fill_box(b: &mut GlbBuilder, palette: &Palette, animation: AnimationId, detail: Detail) {
    let on_floor = |block: &Block| BOX + Vec3::new(block.at[0], 0.0, block.at[1]);
    let short = parts::block(detail, Stuff::White, SHORT.half, SHORT.height);
    put(b, palette, "short-block", &short, on_floor(&SHORT), SHORT.turn);
    let times: Vec<f32> = (0..=motion::KEYS).map(|i| SECONDS * i as f32 / motion::KEYS as f32).collect();
    let parts_of_time = || times.iter().map(|t| t / SECONDS);
    let tall = parts::block(detail, Stuff::White, TALL.half, TALL.height);
    let tall = put(b, palette, "tall-block", &tall, on_floor(&TALL), TALL.turn);
    let turns: Vec<Quat> = parts_of_time().map(motion::tall).collect();
    b.channel(animation, tall, &times, Track::Rotation(&turns), false);
    let cube = parts::block(detail, Stuff::Amber, CUBE.2, 2.0 * CUBE.2);
    let places: Vec<Vec3> = parts_of_time().map(motion::cube).collect();
    let cube = put(b, palette, "cube", &cube, places[0], 0.0);
    b.channel(animation, cube, &times, Track::Translation(&places), false);
}

fn set_stages(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    for (stage, kit) in [
        (OPEN, parts::open_stage(detail)),
        (DISC, parts::disc_stage(detail)),
        (WALL, parts::wall_stage(detail)),
        (BALL, parts::ball_stage(detail)),
    ] {
        put(b, palette, stage.name, &kit, stage.at, 0.0);
    }
}

fn light(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let at = BOX + Vec3::Y * INSIDE[1];
    let mesh = parts::light(detail).mesh(b, "light", |s| palette.of(s));
    b.node("light", &NodeSpec { casts: false, ..NodeSpec::mesh_at(mesh, at, 0.0) });
    let area = LightSpec {
        color: Vec3::new(1.0, 0.88, 0.68),
        intensity: 17.0,
        range: Some(12.0),
        kind: LightKind::Point,
    };
    let area = b.light("light", &area);
    let translation = at - Vec3::Y * 0.12;
    b.node("light-point", &NodeSpec { light: Some(area), translation, ..NodeSpec::default() });

    let spot = LightSpec {
        color: Vec3::new(1.0, 0.95, 0.86),
        intensity: 36.0,
        range: Some(14.0),
        kind: LightKind::Spot { inner_cone_angle: 0.24, outer_cone_angle: 0.44 },
    };
    let spot = b.light("spot", &spot);
    let housing = parts::housing(detail).mesh(b, "housing", |s| palette.of(s));
    let glass = parts::glass(detail).mesh(b, "glass", |s| palette.of(s));
    let (_, y, z) = TRUSS;
    for (x, aim) in [(0.2, OPEN.at), (2.4, DISC.at), (5.9, BALL.at), (8.2, WALL.at)] {
        let at = Vec3::new(x, y - 0.22, z);
        let rotation = path::look_along(aim - at);
        let spec = |mesh| NodeSpec { rotation, ..NodeSpec::mesh_at(mesh, at, 0.0) };
        b.node("housing", &spec(housing));
        b.node("glass", &NodeSpec { casts: false, ..spec(glass) });
        // Ahead of the housing, which would shade its own light.
        let translation = at + rotation * Vec3::NEG_Z * 0.12;
        b.node("spot", &NodeSpec { light: Some(spot), rotation, translation, ..NodeSpec::default() });
    }
    let fill = LightSpec {
        color: Vec3::new(0.72, 0.82, 1.0),
        intensity: 0.4,
        range: None,
        kind: LightKind::Directional,
    };
    let fill = b.light("fill", &fill);
    let rotation = path::look_along(Vec3::new(-0.35, -0.6, -1.0));
    let translation = Vec3::new(4.0, 8.0, 12.0);
    b.node("fill", &NodeSpec { light: Some(fill), rotation, translation, ..NodeSpec::default() });
}

#[cfg(test)]
mod tests;
