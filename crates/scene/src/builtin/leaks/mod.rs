//! The gallery of leaks: thin partitions, touching volumes, curtains and louvres, on which wrong light shows.

mod hall;
mod motion;
mod palette;
mod partitions;
mod plan;
mod things;

use std::f32::consts::FRAC_PI_2;

use glam::{Quat, Vec3};

use super::builder::*;
use super::kit::Kit;
use super::shapes::boulder;
use super::{BuiltinError, Detail, path};
use crate::LightKind;
use palette::{Palette, Stuff};
use plan::*;

/// Makes the scene.
pub(super) fn glb(detail: Detail) -> Result<Vec<u8>, BuiltinError> {
    let mut b = GlbBuilder::new();
    let palette = Palette::new(&mut b)?;
    build(&mut b, &palette, detail);
    furnish(&mut b, &palette, detail);
    hang(&mut b, &palette, detail);
    let animation = b.animation("leaks");
    animate(&mut b, &palette, animation, detail);
    light(&mut b, &palette, detail);
    let paths = [("path-visit", motion::visit()), ("path-close", motion::close())];
    path::place_cameras(&mut b, animation, paths, FRAMES);
    b.finish()
}

/// Adds a mesh and one node that carries it at the origin, both by one name.
fn stand(b: &mut GlbBuilder, palette: &Palette, name: &str, kit: &Kit<Stuff>) {
    let mesh = kit.mesh(b, name, |s| palette.of(s));
    b.node(name, &NodeSpec::mesh_at(mesh, Vec3::ZERO, 0.0));
}

fn build(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    for (name, kit) in hall::floors(detail) {
        stand(b, palette, name, &kit);
    }
    for (name, kit) in [
        ("shell", hall::shell(detail)),
        ("mezzanine", hall::mezzanine(detail)),
        ("stair", hall::stair(detail)),
        ("bookcase", partitions::bookcase(detail)),
        ("books", partitions::books(detail)),
        ("closet", partitions::closet(detail)),
        ("onyx", partitions::onyx(detail)),
        ("pictures", partitions::pictures(detail)),
        ("screen", partitions::screen(detail)),
        ("cabinet", partitions::cabinet(detail)),
    ] {
        stand(b, palette, name, &kit);
    }
}

fn furnish(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    for (i, kit) in things::blocks(detail).iter().enumerate() {
        stand(b, palette, &format!("block-{i}"), kit);
    }
    stand(b, palette, "contacts", &things::contacts(detail));
    stand(b, palette, "seats", &things::seats(detail));
    let cube = things::sunk(detail).mesh(b, "sunk-cube", |s| palette.of(s));
    let tilted = Quat::from_rotation_y(0.5) * Quat::from_rotation_x(0.62) * Quat::from_rotation_z(0.5);
    for (translation, rotation) in
        [(Vec3::new(7.6, 0.12, 0.55), tilted), (Vec3::new(-0.35, 0.1, 1.1), rotation_y(0.4))]
    {
        b.node("sunk-cube", &NodeSpec { rotation, ..NodeSpec::mesh_at(cube, translation, 0.0) });
    }
    // Triangles of an icosphere fall by 4 a level.
    let level = if detail.0 > 0.5 {
        4
    } else if detail.0 > 0.15 {
        3
    } else {
        2
    };
    let stones =
        [961, 962, 963].map(|seed| b.mesh("rock", &[(&boulder(level, seed), palette.of(Stuff::Rock))]));
    for (i, [x, y, z, radius]) in ROCKS.into_iter().enumerate() {
        let spec = NodeSpec {
            scale: Vec3::splat(radius),
            ..NodeSpec::mesh_at(stones[i % 3], Vec3::new(x, y, z), 1.3 * i as f32)
        };
        b.node("rock", &spec);
    }
}

fn hang(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let red = b.mesh("red-curtain", &[(&things::red_curtain(detail), palette.of(Stuff::RedCloth))]);
    let linen = b.mesh("linen-curtain", &[(&things::linen_curtain(detail), palette.of(Stuff::Linen))]);
    for (name, cloth, half, at, turn) in [
        ("red", red, 2.25, Vec3::new(-HALL[0] + 0.1, 3.56, 3.2), FRAC_PI_2),
        ("linen", linen, 1.35, Vec3::new(-7.45, 2.55, -1.12), 0.0),
    ] {
        b.node(&format!("{name}-curtain"), &NodeSpec::mesh_at(cloth, at, turn));
        let rod = things::rod(detail, half).mesh(b, &format!("{name}-rod"), |s| palette.of(s));
        b.node(&format!("{name}-rod"), &NodeSpec::mesh_at(rod, at + Vec3::Y * 0.012, turn));
    }
}

fn animate(b: &mut GlbBuilder, palette: &Palette, animation: AnimationId, detail: Detail) {
    let times: Vec<f32> = (0..=motion::KEYS).map(|i| SECONDS * i as f32 / motion::KEYS as f32).collect();
    let parts: Vec<f32> = times.iter().map(|t| t / SECONDS).collect();
    type Place = fn(f32) -> Vec3;
    let slides: [(_, _, Place); 2] =
        [("door", partitions::door(detail), motion::door), ("cart", things::cart(detail), motion::cart)];
    for (name, kit, place) in slides {
        let mesh = kit.mesh(b, name, |s| palette.of(s));
        let places: Vec<Vec3> = parts.iter().map(|&t| place(t)).collect();
        let node = b.node(name, &NodeSpec::mesh_at(mesh, places[0], 0.0));
        b.channel(animation, node, &times, Track::Translation(&places), false);
    }
    let mesh = partitions::slat(detail).mesh(b, "slat", |s| palette.of(s));
    let ([front, z0, z1, _], (count, low, step)) = (CABINET, SLATS);
    for i in 0..count {
        let turns: Vec<Quat> = parts.iter().map(|&t| motion::slat(t, i)).collect();
        let at = Vec3::new(front + 0.08, low + step * i as f32, 0.5 * (z0 + z1));
        let spec = NodeSpec { rotation: turns[0], ..NodeSpec::mesh_at(mesh, at, 0.0) };
        let node = b.node(&format!("slat-{i}"), &spec);
        b.channel(animation, node, &times, Track::Rotation(&turns), false);
    }
}

fn light(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let sun = LightSpec {
        color: Vec3::new(1.0, 0.95, 0.86),
        intensity: 3.4,
        range: None,
        kind: LightKind::Directional,
    };
    let sun = b.light("sun", &sun);
    let rotation = path::look_along(Vec3::new(0.36, -1.0, -0.30));
    let translation = Vec3::new(0.0, 12.0, 4.0);
    b.node("sun", &NodeSpec { light: Some(sun), rotation, translation, ..NodeSpec::default() });

    let lamp = |intensity: f32, range: f32| LightSpec {
        color: Vec3::new(1.0, 0.88, 0.70),
        intensity,
        range: Some(range),
        kind: LightKind::Point,
    };
    let (hanging, flat) = (b.light("pendant", &lamp(9.0, 8.0)), b.light("panel", &lamp(3.2, 5.0)));
    let glow = things::bulb(detail).mesh(b, "pendant-glow", |s| palette.of(s));
    for (i, [x, y, z]) in PENDANTS.into_iter().enumerate() {
        let at = Vec3::new(x, y, z);
        // Under the mezzanine's edge nothing hangs, so all cords end at the hall's ceiling.
        let name = format!("pendant-{i}");
        let shade = things::pendant(detail, CEILING - y).mesh(b, &name, |s| palette.of(s));
        b.node(&name, &NodeSpec::mesh_at(shade, at, 0.0));
        b.node("pendant-glow", &NodeSpec { casts: false, ..NodeSpec::mesh_at(glow, at, 0.0) });
        // Below the shade, so that it does not shade its own light.
        let translation = at - Vec3::Y * 0.05;
        b.node("pendant-light", &NodeSpec { light: Some(hanging), translation, ..NodeSpec::default() });
    }
    let panel = things::panel(detail).mesh(b, "panel", |s| palette.of(s));
    for [x, z] in PANELS {
        let at = Vec3::new(x, MEZZANINE.1[0], z);
        b.node("panel", &NodeSpec { casts: false, ..NodeSpec::mesh_at(panel, at, 0.0) });
        let translation = at - Vec3::Y * 0.1;
        b.node("panel-light", &NodeSpec { light: Some(flat), translation, ..NodeSpec::default() });
    }
    let wash = LightSpec {
        color: Vec3::new(1.0, 0.9, 0.76),
        intensity: 42.0,
        range: Some(12.0),
        kind: LightKind::Spot { inner_cone_angle: 0.3, outer_cone_angle: 0.62 },
    };
    let wash = b.light("wash", &wash);
    for (at, aim) in [
        (Vec3::new(-5.6, 4.8, 4.6), Vec3::new(-8.9, 1.6, 3.2)),
        (Vec3::new(-4.8, 4.8, 4.4), Vec3::new(-4.8, 1.2, 1.2)),
        (Vec3::new(5.4, 4.8, 4.2), Vec3::new(7.8, 0.9, 3.0)),
    ] {
        let rotation = path::look_along(aim - at);
        b.node("wash", &NodeSpec { light: Some(wash), rotation, translation: at, ..NodeSpec::default() });
    }
}

#[cfg(test)]
mod tests;
