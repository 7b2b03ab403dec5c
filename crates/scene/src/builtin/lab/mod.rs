//! The laboratory: machines, benches and a platform in a hall through which 23 people walk.

mod body;
mod building;
mod furniture;
mod gait;
mod machines;
mod motion;
mod palette;
mod plan;
mod route;
#[cfg(test)]
mod solids;
mod walkers;

use std::collections::BTreeMap;
use std::f32::consts::FRAC_PI_2;

use glam::{Quat, Vec3};

use super::builder::*;
use super::{BuiltinError, Detail, path};
use crate::LightKind;
use palette::{Palette, Stuff};
use plan::*;

/// Makes the scene.
pub(super) fn glb(detail: Detail) -> Result<Vec<u8>, BuiltinError> {
    let mut b = GlbBuilder::new();
    let palette = Palette::new(&mut b)?;
    let clothes = palette::clothes(&mut b);
    build_room(&mut b, &palette, detail);
    let animation = b.animation("lab");
    furnish(&mut b, &palette, animation, detail);
    light(&mut b, &palette, detail);
    walkers::place(&mut b, &clothes, animation, detail);
    let paths = [("path-aisle", motion::aisle()), ("path-crane", motion::crane())];
    path::place_cameras(&mut b, animation, paths, FRAMES);
    b.finish()
}

fn build_room(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let [floor, walls, ceiling] = building::shell();
    let room = [
        (&floor, palette.of(Stuff::Floor)),
        (&walls, palette.of(Stuff::Panel)),
        (&ceiling, palette.of(Stuff::Ceiling)),
    ];
    let room = b.mesh("room", &room);
    b.node("room", &NodeSpec::mesh_at(room, Vec3::ZERO, 0.0));
    for (name, kit) in [
        ("trim", building::trim(detail)),
        ("platform", building::platform(detail)),
        ("stairs-and-railings", building::climb(detail)),
        ("trusses", building::trusses(detail)),
        ("services", building::services(detail)),
    ] {
        let mesh = kit.mesh(b, name, |s| palette.of(s));
        b.node(name, &NodeSpec::mesh_at(mesh, Vec3::ZERO, 0.0));
    }
}

fn furnish(b: &mut GlbBuilder, palette: &Palette, animation: AnimationId, detail: Detail) {
    let mut meshes = BTreeMap::new();
    for kind in Kind::ALL {
        let kit = match kind {
            Kind::GlassBench => furniture::glass_bench(detail),
            Kind::ScreenBench => furniture::screen_bench(detail),
            Kind::Stool => furniture::stool(detail),
            Kind::Reactor => machines::reactor(detail),
            Kind::Rack => machines::rack(detail),
            Kind::Centrifuge => machines::centrifuge(detail),
            Kind::Coils => machines::coils(detail),
            Kind::Robot => machines::robot_base(detail),
            Kind::Shelf => furniture::shelf(detail),
            Kind::Pump => machines::pump(detail),
            Kind::Hood => furniture::hood(detail),
            Kind::Console => furniture::console(detail),
        };
        meshes.insert(kind, kit.mesh(b, kind.name(), |s| palette.of(s)));
    }
    let rotor = machines::rotor(detail).mesh(b, "rotor", |s| palette.of(s));
    let arm = machines::robot_arm(detail).mesh(b, "robot-arm", |s| palette.of(s));
    let times = motion::key_times();
    let (mut rotors, mut arms) = (0, 0);
    for item in ITEMS {
        let turn = FRAC_PI_2 * f32::from(item.quarters);
        let Some(&mesh) = meshes.get(&item.kind) else { continue };
        b.node(item.kind.name(), &NodeSpec::mesh_at(mesh, item.at, turn));
        let (name, mesh, turns): (String, MeshId, Vec<Quat>) = match item.kind {
            Kind::Centrifuge => {
                rotors += 1;
                let turns = (0..=motion::KEYS).map(|k| motion::rotor(k as f32 / motion::KEYS as f32, rotors));
                (format!("rotor-{}", rotors - 1), rotor, turns.collect())
            }
            Kind::Robot => {
                arms += 1;
                let turns = (0..=motion::KEYS)
                    .map(|k| rotation_y(turn) * motion::arm(k as f32 / motion::KEYS as f32, arms));
                (format!("robot-arm-{}", arms - 1), arm, turns.collect())
            }
            _ => continue,
        };
        let mut turns = turns;
        for k in 1..turns.len() {
            if turns[k - 1].dot(turns[k]) < 0.0 {
                turns[k] = -turns[k];
            }
        }
        let spec = NodeSpec { rotation: turns[0], ..NodeSpec::mesh_at(mesh, item.at, 0.0) };
        let node = b.node(&name, &spec);
        b.channel(animation, node, &times, Track::Rotation(&turns), false);
    }
}

fn light(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let daylight = LightSpec {
        color: Vec3::new(0.85, 0.92, 1.0),
        intensity: 1.1,
        range: None,
        kind: LightKind::Directional,
    };
    let daylight = b.light("daylight", &daylight);
    let rotation = path::look_along(Vec3::new(0.35, -1.0, -0.25));
    let translation = Vec3::Y * 12.0;
    b.node("daylight", &NodeSpec { light: Some(daylight), rotation, translation, ..NodeSpec::default() });

    let bulb = LightSpec {
        color: Vec3::new(1.0, 0.96, 0.88),
        intensity: 13.0,
        range: Some(11.0),
        kind: LightKind::Point,
    };
    let bulb = b.light("lamp", &bulb);
    let housing = building::lamp(detail).mesh(b, "lamp-housing", |s| palette.of(s));
    let glow = building::glow(detail).mesh(b, "lamp-glow", |s| palette.of(s));
    for place in building::lamp_places() {
        let at = Vec3::new(place.x, building::LAMP, place.y);
        b.node("lamp-housing", &NodeSpec::mesh_at(housing, at, 0.0));
        b.node("lamp-glow", &NodeSpec { casts: false, ..NodeSpec::mesh_at(glow, at, 0.0) });
        // Below the glass, so that the housing does not shade its own light.
        let translation = at - Vec3::Y * 0.08;
        b.node("lamp", &NodeSpec { light: Some(bulb), translation, ..NodeSpec::default() });
    }
    let spot = LightSpec {
        color: Vec3::new(1.0, 0.85, 0.65),
        intensity: 60.0,
        range: Some(12.0),
        kind: LightKind::Spot { inner_cone_angle: 0.25, outer_cone_angle: 0.5 },
    };
    let spot = b.light("spot", &spot);
    for (at, aim) in [
        (Vec3::new(7.4, 4.6, -2.2), Vec3::new(10.5, 0.8, -5.2)),
        (Vec3::new(0.2, 4.6, 2.0), Vec3::new(3.4, 0.8, 4.4)),
        (Vec3::new(-6.6, 4.6, 2.0), Vec3::new(-3.7, 0.8, -0.4)),
    ] {
        let rotation = path::look_along(aim - at);
        b.node("spot", &NodeSpec { light: Some(spot), rotation, translation: at, ..NodeSpec::default() });
    }
}

#[cfg(test)]
mod tests;
