//! A hangar in which 28 drones fly, each with a light of its own: spheres, rectangles and discs, and rings that emit from their triangles.
//! All of its lights move, and many shine on every place: what a cache of few lights a place is worst at.

mod craft;
mod drones;
mod hall;
mod machines;
mod motion;
mod palette;
mod plan;
mod stores;

use std::collections::BTreeMap;
use std::f32::consts::PI;

use glam::{Quat, Vec3};

use super::builder::*;
use super::kit::Kit;
use super::movers::{self, Motion};
use super::{BuiltinError, Detail, path};
use palette::{Palette, Stuff};
use plan::*;

/// Makes the scene.
pub(super) fn glb(detail: Detail) -> Result<Vec<u8>, BuiltinError> {
    let mut b = GlbBuilder::new();
    let palette = Palette::new(&mut b)?;
    build(&mut b, &palette, detail);
    furnish(&mut b, &palette, detail);
    let animation = b.animation("hangar");
    run_machines(&mut b, &palette, animation, detail);
    launch(&mut b, &palette, animation, detail);
    let paths = [("path-aisle", motion::aisle()), ("path-roof", motion::roof())];
    path::place_cameras(&mut b, animation, paths, FRAMES);
    b.finish()
}

fn make(b: &mut GlbBuilder, palette: &Palette, name: &str, kit: &Kit<Stuff>) -> MeshId {
    kit.mesh(b, name, |s| palette.of(s))
}

fn build(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let [shell, skirting] = hall::shell(detail);
    for (name, kit) in [
        ("shell", shell),
        ("skirting", skirting),
        ("trusses", hall::trusses(detail)),
        ("doors", hall::doors(detail)),
        ("services", hall::services(detail)),
        ("rails", hall::rails(detail)),
        ("craft", craft::craft(detail)),
    ] {
        let mesh = make(b, palette, name, &kit);
        b.node(name, &NodeSpec::mesh_at(mesh, Vec3::ZERO, 0.0));
    }
}

fn furnish(b: &mut GlbBuilder, palette: &Palette, detail: Detail) {
    let meshes: BTreeMap<Store, MeshId> =
        Store::ALL.map(|kind| (kind, make(b, palette, kind.name(), &stores::store(detail, kind)))).into();
    for (side, row) in STORES.iter().enumerate() {
        for (kind, x) in row.iter().zip(BAY_X) {
            let Some(&mesh) = meshes.get(kind) else { continue };
            let (z, turn) = if side == 0 { (-BAY_Z, 0.0) } else { (BAY_Z, PI) };
            b.node(kind.name(), &NodeSpec::mesh_at(mesh, Vec3::new(x, 0.0, z), turn));
        }
    }
    let pallets = [0, 1, 2].map(|i| make(b, palette, "pallet", &machines::pallet(detail, i)));
    for (i, ([x, z], turn)) in PALLETS.into_iter().enumerate() {
        b.node("pallet", &NodeSpec::mesh_at(pallets[i % 3], Vec3::new(x, 0.0, z), turn));
    }
    let (at, turn, radius) = FAN;
    let stand = make(b, palette, "fan-stand", &machines::fan_stand(detail, radius, at.y));
    b.node("fan-stand", &NodeSpec::mesh_at(stand, Vec3::new(at.x, 0.0, at.z), turn));
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

fn run_machines(b: &mut GlbBuilder, palette: &Palette, animation: AnimationId, detail: Detail) {
    type Place = fn(f32) -> Vec3;
    let slides: [(_, _, Place); 2] = [
        ("bridge", hall::bridge(detail), motion::bridge),
        ("trolley", hall::trolley(detail), motion::trolley),
    ];
    for (name, kit, place) in slides {
        let mesh = make(b, palette, name, &kit);
        let places: Vec<Vec3> = motion::parts().map(place).collect();
        moving(b, animation, name, &NodeSpec::mesh_at(mesh, places[0], 0.0), Some(&places), None);
    }
    let (at, turn, radius) = FAN;
    let blades = make(b, palette, "fan", &machines::blades(detail, radius));
    let turns: Vec<Quat> = motion::parts().map(|t| rotation_y(turn) * motion::fan(t)).collect();
    moving(b, animation, "fan", &NodeSpec::mesh_at(blades, at, 0.0), None, Some(&turns));
}

fn launch(b: &mut GlbBuilder, palette: &Palette, animation: AnimationId, detail: Detail) {
    let kinds = [
        (Lamp::Sphere, "sphere", Some(Emitter::Sphere)),
        (Lamp::Ring, "ring", None),
        (Lamp::Rectangle, "rectangle", Some(Emitter::Rectangle)),
        (Lamp::Disc, "disc", Some(Emitter::Disc)),
    ];
    for (kind, name, emitter) in kinds {
        let body = make(b, palette, &format!("drone-{name}"), &drones::body(detail, kind));
        let (piece, lie, below) = drones::lamp(detail, kind);
        let mut lit: [Option<MeshId>; palette::COLOR_COUNT] = Default::default();
        for (i, drone) in DRONES.iter().enumerate().filter(|(_, drone)| drone.lamp == kind) {
            let mesh = match lit[drone.color] {
                Some(mesh) => mesh,
                None => {
                    let glow = palette::glow(b, kind, drone.color);
                    b.mesh(&format!("light-{name}-{}", drone.color), &[(&piece, glow)])
                }
            };
            lit[drone.color] = Some(mesh);
            let places = motion::fly(drone);
            let turns = motion::lean(&places);
            let spec = NodeSpec::mesh_at(body, places[0], 0.0);
            moving(b, animation, &format!("drone-{i}"), &spec, Some(&places), Some(&turns));
            let hung: Vec<Vec3> =
                places.iter().zip(&turns).map(|(&at, &turn)| at - turn * Vec3::Y * below).collect();
            let lain: Vec<Quat> = turns.iter().map(|&turn| turn * lie).collect();
            let spec = NodeSpec { emitter, ..NodeSpec::mesh_at(mesh, hung[0], 0.0) };
            moving(b, animation, &format!("light-{i}"), &spec, Some(&hung), Some(&lain));
        }
    }
}

#[cfg(test)]
mod tests;
