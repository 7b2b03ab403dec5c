//! The atrium: a two-storey hall with arcades, stairs and a gallery, in which boulders roll.

mod lamps;
mod motion;
mod parts;
mod plan;
mod textures;
mod things;

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Quat, Vec2, Vec3, Vec4};

use super::builder::*;
use super::physics::frame_times;
use super::shapes::{boulder, ring_slab, ring_slab_faces};
use super::{BuiltinError, Detail, path, physics};
use crate::LightKind;
use motion::{FRAMES, ROCKS, SECONDS};
use plan::*;

/// Deviation that dropped keys of a boulder may cause, metres and radians.
const KEY_TOLERANCE: (f32, f32) = (0.0005, 0.1 * PI / 180.0);

/// The materials by what they are.
struct Palette {
    stone: MaterialId,
    marble: MaterialId,
    plaster: MaterialId,
    floor: MaterialId,
    wood_floor: MaterialId,
    wood: MaterialId,
    brass: MaterialId,
    terracotta: MaterialId,
    glaze: MaterialId,
    earth: MaterialId,
    leaf: MaterialId,
    water: MaterialId,
    rocks: [MaterialId; ROCKS as usize],
    cloths: [MaterialId; 3],
    canvases: [MaterialId; 3],
    lattice: MaterialId,
    glow: MaterialId,
    iron: MaterialId,
}

/// What lights the hall.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Lit {
    /// Sun, lanterns and spot lights.
    Punctual,
    /// Globes and a panel that emit from their area; nothing else does.
    Areas,
}

/// Makes the scene.
pub(super) fn glb(detail: Detail) -> Result<Vec<u8>, BuiltinError> {
    make(detail, Lit::Punctual)
}

/// Makes the scene with area lights instead of its punctual ones.
pub(super) fn lamps(detail: Detail) -> Result<Vec<u8>, BuiltinError> {
    make(detail, Lit::Areas)
}

fn make(detail: Detail, lit: Lit) -> Result<Vec<u8>, BuiltinError> {
    let mut b = GlbBuilder::new();
    let palette = palette(&mut b, lit)?;
    build_structure(&mut b, &palette, detail);
    build_furniture(&mut b, &palette, detail);
    build_textiles(&mut b, &palette, detail);
    let animation = b.animation("atrium");
    match lit {
        Lit::Punctual => light(&mut b, &palette, animation, detail),
        Lit::Areas => lamps::light(&mut b, &palette, detail),
    }
    roll_boulders(&mut b, &palette, animation, detail);
    path::place_cameras(
        &mut b,
        animation,
        [("path-walk", motion::walk()), ("path-gallery", motion::flight())],
        FRAMES,
    );
    b.finish()
}

fn palette(b: &mut GlbBuilder, lit: Lit) -> Result<Palette, BuiltinError> {
    let size = [super::paint::SIZE; 2];
    let floor = b.texture("floor", size, &textures::floor(), false)?;
    let stone = b.texture("stone", size, &textures::stone(), false)?;
    let wood = b.texture("wood", size, &textures::wood(), false)?;
    let boards = b.texture("boards", size, &textures::boards(), false)?;
    let lattice = b.texture("lattice", size, &textures::lattice(), false)?;
    let textured =
        |texture, roughness| MaterialSpec { texture: Some(texture), roughness, ..Default::default() };
    let metal = |r: f32, g: f32, bl: f32, roughness: f32| MaterialSpec {
        metallic: 1.0,
        ..MaterialSpec::matt(r, g, bl, roughness)
    };
    let cloth =
        |r: f32, g: f32, bl: f32| MaterialSpec { double_sided: true, ..MaterialSpec::matt(r, g, bl, 0.95) };
    Ok(Palette {
        stone: b.material("stone", &textured(stone, 0.85)),
        marble: b.material("marble", &MaterialSpec::matt(0.64, 0.56, 0.45, 0.5)),
        plaster: b.material("plaster", &MaterialSpec::matt(0.70, 0.62, 0.51, 0.95)),
        floor: b.material("floor", &textured(floor, 0.35)),
        wood_floor: b.material(
            "wood-floor",
            &MaterialSpec { base_color: Vec4::new(1.0, 0.95, 0.85, 1.0), ..textured(boards, 0.55) },
        ),
        wood: b.material("wood", &textured(wood, 0.6)),
        brass: b.material("brass", &metal(0.80, 0.58, 0.27, 0.32)),
        terracotta: b.material("terracotta", &MaterialSpec::matt(0.52, 0.22, 0.11, 0.8)),
        glaze: b.material("glaze", &MaterialSpec::matt(0.10, 0.24, 0.34, 0.25)),
        earth: b.material("earth", &MaterialSpec::matt(0.07, 0.045, 0.03, 1.0)),
        leaf: b.material("leaf", &MaterialSpec::matt(0.10, 0.24, 0.06, 0.6)),
        water: b.material("water", &MaterialSpec::matt(0.04, 0.10, 0.12, 0.06)),
        rocks: [
            b.material("rock-gray", &MaterialSpec::matt(0.36, 0.35, 0.33, 0.9)),
            b.material("rock-red", &MaterialSpec::matt(0.42, 0.27, 0.20, 0.9)),
            b.material("rock-dark", &MaterialSpec::matt(0.22, 0.22, 0.24, 0.85)),
        ],
        cloths: [
            b.material("cloth-red", &cloth(0.52, 0.05, 0.045)),
            b.material("cloth-green", &cloth(0.06, 0.28, 0.11)),
            b.material("cloth-blue", &cloth(0.06, 0.12, 0.42)),
        ],
        canvases: [
            b.material("canvas-ochre", &MaterialSpec::matt(0.55, 0.36, 0.12, 0.8)),
            b.material("canvas-teal", &MaterialSpec::matt(0.09, 0.28, 0.28, 0.8)),
            b.material("canvas-violet", &MaterialSpec::matt(0.26, 0.11, 0.25, 0.8)),
        ],
        lattice: b.material(
            "lattice",
            &MaterialSpec { alpha_cutoff: Some(0.5), double_sided: true, ..textured(lattice, 0.7) },
        ),
        glow: b.material("lantern-glass", &lantern_glass(lit)),
        iron: b.material("iron", &metal(0.16, 0.15, 0.15, 0.5)),
    })
}

/// The lanterns' glass, dark where other lights are the only ones.
fn lantern_glass(lit: Lit) -> MaterialSpec {
    let emissive = if lit == Lit::Punctual { Vec3::new(4.0, 2.6, 1.2) } else { Vec3::ZERO };
    MaterialSpec { emissive, ..MaterialSpec::matt(0.9, 0.8, 0.6, 0.4) }
}

/// The point (x, z) at a height.
fn at(p: Vec2, y: f32) -> Vec3 {
    Vec3::new(p.x, y, p.y)
}

fn build_structure(b: &mut GlbBuilder, p: &Palette, detail: Detail) {
    let [floor, walls, ceiling] = parts::shell();
    let room = b.mesh("room", &[(&floor, p.floor), (&walls, p.stone), (&ceiling, p.plaster)]);
    b.node("room", &NodeSpec::mesh_at(room, Vec3::ZERO, 0.0));

    let faces = |faces| ring_slab_faces(ROOM + Vec2::splat(0.02), WELL, [SLAB_BOTTOM, GALLERY], faces);
    let (boards, rest) = (faces([true, false, false, false]), faces([false, true, true, true]));
    let slab = b.mesh("gallery-slab", &[(&boards, p.wood_floor), (&rest, p.plaster)]);
    b.node("gallery-slab", &NodeSpec::mesh_at(slab, Vec3::ZERO, 0.0));
    let out = Vec2::splat(0.17);
    let beam = ring_slab(COLUMNS + out, COLUMNS - out, [BEAM_BOTTOM, CEILING + 0.05]);
    let beam = b.mesh("beam", &[(&beam, p.plaster)]);
    b.node("beam", &NodeSpec::mesh_at(beam, Vec3::ZERO, 0.0));
    // Mouldings: bands that stand out from the slab's edge and from the beam towards the hall.
    let mut bands =
        ring_slab(WELL + Vec2::splat(0.02), WELL - Vec2::splat(0.07), [GALLERY - 0.13, GALLERY - 0.02]);
    for (depth, y0, y1) in [
        (0.04, BEAM_BOTTOM + 0.22, BEAM_BOTTOM + 0.29),
        (0.06, CEILING - 0.19, CEILING - 0.09),
        (0.11, CEILING - 0.10, CEILING + 0.02),
    ] {
        let face = COLUMNS - out;
        bands
            .append_at(&ring_slab(face + Vec2::splat(0.02), face - Vec2::splat(depth), [y0, y1]), Vec3::ZERO);
    }
    let bands = b.mesh("mouldings", &[(&bands, p.marble)]);
    b.node("mouldings", &NodeSpec::mesh_at(bands, Vec3::ZERO, 0.0));
    let beams = b.mesh("skylight-beams", &[(&parts::skylight_beams(detail), p.wood)]);
    b.node("skylight-beams", &NodeSpec::mesh_at(beams, Vec3::ZERO, 0.0));

    // Long arcades carry the corners; the short ones end inside them.
    let half = 0.5 * ARCADE_THICKNESS;
    let long = b.mesh("arcade-long", &[(&parts::arcade(6, half, detail), p.stone)]);
    let short = b.mesh("arcade-short", &[(&parts::arcade(3, 0.02 - half, detail), p.stone)]);
    for (mesh, name, turns) in
        [(long, "arcade-long", [0.0, PI]), (short, "arcade-short", [FRAC_PI_2, -FRAC_PI_2])]
    {
        for turn in turns {
            let out = if mesh == long { COLUMNS.y } else { COLUMNS.x };
            let center = rotation_y(turn) * Vec3::new(0.0, 0.0, out);
            b.node(name, &NodeSpec::mesh_at(mesh, center, turn));
        }
    }
    let lower = b.mesh("column-lower", &[(&parts::lower_column(detail), p.marble)]);
    let upper = b.mesh("column-upper", &[(&parts::upper_column(detail), p.marble)]);
    for place in column_places() {
        b.node("column-lower", &NodeSpec::mesh_at(lower, at(place, 0.0), 0.0));
        b.node("column-upper", &NodeSpec::mesh_at(upper, at(place, GALLERY), 0.0));
    }
    let archivolt = b.mesh("archivolt", &[(&parts::archivolt(detail), p.marble)]);
    let railing = b.mesh("railing", &[(&parts::railing(detail), p.brass)]);
    for bay in bays() {
        b.node("archivolt", &NodeSpec::mesh_at(archivolt, at(bay.center, 0.0), bay.turn));
        if !bay.stairs {
            b.node("railing", &NodeSpec::mesh_at(railing, at(bay.center, GALLERY), bay.turn));
        }
    }

    // The last tread reaches a little into the slab.
    let flight = super::shapes::stairs(STEPS, RISER, TREAD, STAIR_WIDTH, 0.32, 0.02);
    let flight = b.mesh("stairs", &[(&flight, p.marble)]);
    let rail = b.mesh("stair-railing", &[(&parts::stair_railing(detail), p.brass)]);
    for (side, turn) in [(1.0, 0.0), (-1.0, PI)] {
        let foot = Vec3::new(STAIR_FOOT_X + 0.006, 0.0, STAIR_Z) * side;
        b.node("stairs", &NodeSpec::mesh_at(flight, foot, turn));
        for z in [-1.0, 1.0] {
            let edge = Vec3::Z * (z * (0.5 * STAIR_WIDTH - 0.05));
            b.node("stair-railing", &NodeSpec::mesh_at(rail, foot + edge, turn));
        }
    }

    let low = b.mesh("pilaster-lower", &[(&parts::pilaster(SLAB_BOTTOM, detail), p.marble)]);
    let high = b.mesh("pilaster-upper", &[(&parts::pilaster(CEILING - GALLERY, detail), p.marble)]);
    let mut pilaster = |p: Vec2, turn: f32, upper: bool| {
        b.node("pilaster-lower", &NodeSpec::mesh_at(low, at(p, 0.0), turn));
        if upper {
            b.node("pilaster-upper", &NodeSpec::mesh_at(high, at(p, GALLERY), turn));
        }
    };
    for i in 0..=6 {
        let x = -COLUMNS.x + BAY * i as f32;
        pilaster(Vec2::new(x, -ROOM.y), 0.0, i % 2 == 0);
        pilaster(Vec2::new(x, ROOM.y), PI, i % 2 == 0);
    }
    for i in 0..=3 {
        let z = -COLUMNS.y + BAY * i as f32;
        pilaster(Vec2::new(-ROOM.x, z), FRAC_PI_2, i % 3 == 0);
        pilaster(Vec2::new(ROOM.x, z), -FRAC_PI_2, i % 3 == 0);
    }
}

fn build_furniture(b: &mut GlbBuilder, p: &Palette, detail: Detail) {
    let fine = things::vase([detail.facets(30, 8), detail.facets(4, 2)], detail);
    let coarse = things::vase([detail.facets(16, 6), detail.facets(2, 1)], detail);
    let clay = b.mesh("vase-clay", &[(&fine, p.terracotta)]);
    let glazed = b.mesh("vase-glazed", &[(&fine, p.glaze)]);
    let jars = [p.terracotta, p.glaze, p.brass].map(|m| b.mesh("jar", &[(&coarse, m)]));
    let pots: Vec<MeshId> = (0..2)
        .map(|i| {
            b.mesh("pot", &[(&things::pot(detail), p.terracotta), (&things::leaves(70 + i, detail), p.leaf)])
        })
        .collect();
    let earth =
        super::shapes::lathe(&[Vec2::new(0.35, 0.45), Vec2::new(0.35, 0.492), Vec2::new(0.0, 0.51)], 16);
    let earth = b.mesh("earth", &[(&earth, p.earth)]);
    let crates = b.mesh("crate", &[(&things::crate_box(detail), p.wood)]);
    let table = b.mesh("table", &[(&things::table(detail), p.wood)]);
    let bench = b.mesh("bench", &[(&things::bench(detail), p.marble)]);
    let screen = b.mesh(
        "lattice-screen",
        &[(&things::screen_filling(), p.lattice), (&things::screen_frame(detail), p.wood)],
    );
    let mut put = |name: &str, mesh: MeshId, place: &Place| {
        let spec =
            NodeSpec { scale: Vec3::splat(place.scale), ..NodeSpec::mesh_at(mesh, place.at, place.turn) };
        b.node(name, &spec);
    };
    for (i, place) in VASES.iter().enumerate() {
        put("vase", if i % 3 == 1 { glazed } else { clay }, place);
    }
    for (i, place) in POTS.iter().enumerate() {
        put("pot", pots[i % 2], place);
        put("earth", earth, place);
    }
    for place in CRATES {
        put("crate", crates, place);
    }
    for place in TABLES {
        put("table", table, place);
        // Small things on the table.
        for (i, along) in [-0.55_f32, 0.1, 0.42].into_iter().enumerate() {
            let offset = rotation_y(place.turn) * Vec3::new(along, 0.758, 0.18 * (i as f32 - 1.0));
            let scale = [0.42, 0.3, 0.24][i];
            put("jar", jars[i], &Place { at: place.at + offset, turn: 0.0, scale });
        }
    }
    for place in BENCHES {
        put("bench", bench, place);
    }
    for place in SCREENS {
        put("lattice-screen", screen, place);
    }
    let fountain =
        b.mesh("fountain", &[(&things::fountain(detail), p.marble), (&things::water(detail), p.water)]);
    b.node("fountain", &NodeSpec::mesh_at(fountain, Vec3::ZERO, 0.0));

    let door = b.mesh("door", &[(&parts::door(detail), p.wood)]);
    for (x, z, y, turn) in [
        (-ROOM.x, 0.0, 0.0, FRAC_PI_2),
        (ROOM.x, 0.0, 0.0, -FRAC_PI_2),
        (1.5 * BAY, ROOM.y, 0.0, PI),
        (2.5 * BAY, -ROOM.y, GALLERY, 0.0),
        (-2.5 * BAY, ROOM.y, GALLERY, PI),
    ] {
        b.node("door", &NodeSpec::mesh_at(door, Vec3::new(x, y, z), turn));
    }
    let (frame, canvas) = (things::picture_frame(1.2, 0.9), things::picture_canvas(1.2, 0.9));
    let pictures = p.canvases.map(|c| b.mesh("picture", &[(&frame, p.brass), (&canvas, c)]));
    let eye = GALLERY + 1.6;
    for (i, (x, z, y, turn)) in [
        (-1.5 * BAY, -ROOM.y, eye, 0.0),
        (0.5 * BAY, -ROOM.y, eye, 0.0),
        (-0.5 * BAY, ROOM.y, eye, PI),
        (1.5 * BAY, ROOM.y, eye + 0.1, PI),
        (-ROOM.x, 0.0, eye, FRAC_PI_2),
        (ROOM.x, -BAY, eye, -FRAC_PI_2),
        (0.5 * BAY, -ROOM.y, 1.8, 0.0),
        (-0.5 * BAY, ROOM.y, 1.8, PI),
        (ROOM.x, -BAY, 1.8, -FRAC_PI_2),
    ]
    .into_iter()
    .enumerate()
    {
        b.node("picture", &NodeSpec::mesh_at(pictures[i % 3], Vec3::new(x, y, z), turn));
    }
}

fn build_textiles(b: &mut GlbBuilder, p: &Palette, detail: Detail) {
    let rod_half = 0.5 * BAY + 0.12;
    let rod = b.mesh("rod", &[(&things::rod(rod_half, detail), p.brass)]);
    let height = BEAM_BOTTOM - 0.16;
    let mut curtains = Vec::new();
    for which in 0..2 {
        let cloth = things::curtain(which, detail);
        curtains.push(p.cloths.map(|c| b.mesh("curtain", &[(&cloth, c)])));
    }
    let bays = bays();
    let mut rods = std::collections::BTreeSet::new();
    for &(index, side, color, which) in CURTAINS {
        let bay = bays[index];
        // Behind the columns and the railing, as seen from the hall.
        let line = at(bay.center + bay.outward * 0.29, height);
        let along = rotation_y(bay.turn) * Vec3::X;
        let width = [0.85, 1.1][which];
        let offset = along * (side * 0.5 * (BAY - 0.18 - width));
        b.node("curtain", &NodeSpec::mesh_at(curtains[which][color], line + offset, bay.turn));
        if rods.insert(index) {
            b.node("rod", &NodeSpec::mesh_at(rod, line + Vec3::Y * 0.01, bay.turn));
        }
    }
    let banner = things::banner(detail);
    let banners = p.cloths.map(|c| b.mesh("banner-cloth", &[(&banner, c)]));
    let short = b.mesh("banner-rod", &[(&things::rod(0.52, detail), p.brass)]);
    for (i, x) in [-2.0 * BAY, 0.0, 2.0 * BAY].into_iter().enumerate() {
        for (side, turn) in [(1.0, PI), (-1.0, 0.0)] {
            let z = side * (COLUMNS.y - 0.36);
            let color = if side > 0.0 { [0, 2, 1][i] } else { [2, 0, 0][i] };
            b.node("banner", &NodeSpec::mesh_at(banners[color], Vec3::new(x, BEAM_BOTTOM + 0.2, z), turn));
            b.node("banner-rod", &NodeSpec::mesh_at(short, Vec3::new(x, BEAM_BOTTOM + 0.21, z), turn));
        }
    }
}

fn light(b: &mut GlbBuilder, p: &Palette, animation: AnimationId, detail: Detail) {
    let sun = LightSpec {
        color: Vec3::new(1.0, 0.93, 0.82),
        intensity: 3.2,
        range: None,
        kind: LightKind::Directional,
    };
    let sun = b.light("sun", &sun);
    let rotation = path::look_along(Vec3::new(0.42, -1.0, -0.30));
    let translation = Vec3::new(-5.0, 14.0, 4.0);
    b.node("sun", &NodeSpec { light: Some(sun), rotation, translation, ..NodeSpec::default() });

    let lamp = LightSpec {
        color: Vec3::new(1.0, 0.72, 0.42),
        intensity: 5.0,
        range: Some(9.0),
        kind: LightKind::Point,
    };
    let lamp = b.light("lantern", &lamp);
    let metal = b.mesh("lantern", &[(&things::lantern_metal(detail), p.brass)]);
    let glass = b.mesh("lantern-glass", &[(&things::lantern_glass(detail), p.glow)]);
    for &hook in LANTERNS {
        b.node("lantern", &NodeSpec::mesh_at(metal, hook, 0.0));
        b.node("lantern-glass", &NodeSpec { casts: false, ..NodeSpec::mesh_at(glass, hook, 0.0) });
        // Just below the finial, so that the lantern does not shade its own light.
        let translation = hook - Vec3::Y * 0.95;
        b.node("lantern-light", &NodeSpec { light: Some(lamp), translation, ..NodeSpec::default() });
    }

    let housing = b.mesh("spot-housing", &[(&things::spot_housing(detail), p.iron)]);
    let stem = b.mesh("spot-stem", &[(&things::spot_stem(CEILING - motion::SPOT_HEIGHT, detail), p.iron)]);
    let keys = 8 * SECONDS as u32;
    let times: Vec<f32> = (0..=keys).map(|i| i as f32 * SECONDS / keys as f32).collect();
    for (i, spot) in motion::spots().iter().enumerate() {
        let light = LightSpec {
            color: spot.color,
            intensity: spot.candela,
            range: Some(25.0),
            kind: LightKind::Spot { inner_cone_angle: 0.16, outer_cone_angle: 0.32 },
        };
        let name = format!("spot-{i}");
        let light = b.light(&name, &light);
        let mut rotations: Vec<Quat> = Vec::new();
        for &time in &times {
            let next = spot.rotation(time);
            let flipped = rotations.last().is_some_and(|last| last.dot(next) < 0.0);
            rotations.push(if flipped { -next } else { next });
        }
        let node = NodeSpec {
            light: Some(light),
            mesh: Some(housing),
            translation: spot.at,
            rotation: rotations[0],
            ..NodeSpec::default()
        };
        let node = b.node(&name, &node);
        b.node("spot-stem", &NodeSpec::mesh_at(stem, spot.at, 0.0));
        b.channel(animation, node, &times, Track::Rotation(&rotations), false);
    }
}

fn roll_boulders(b: &mut GlbBuilder, p: &Palette, animation: AnimationId, detail: Detail) {
    // Triangles of an icosphere fall by 4 a level.
    let level = if detail.0 > 0.5 {
        4
    } else if detail.0 > 0.15 {
        3
    } else {
        2
    };
    let rocks: Vec<MeshId> = (0..ROCKS)
        .map(|i| b.mesh("boulder", &[(&boulder(level, motion::rock_seed(i)), p.rocks[i as usize])]))
        .collect();
    let bodies = motion::boulders();
    let motions = physics::simulate(&solids(), &bodies, FRAMES);
    for (i, (body, motion)) in bodies.iter().zip(&motions).enumerate() {
        let spec = NodeSpec {
            mesh: Some(rocks[i % rocks.len()]),
            translation: body.position,
            rotation: motion.rotations[0],
            scale: Vec3::splat(body.radius),
            ..NodeSpec::default()
        };
        let node = b.node(&format!("boulder-{i}"), &spec);
        let kept = physics::thin_positions(&motion.positions, KEY_TOLERANCE.0);
        let values: Vec<Vec3> = kept.iter().map(|&k| motion.positions[k]).collect();
        b.channel(animation, node, &frame_times(&kept), Track::Translation(&values), false);
        let kept = physics::thin_rotations(&motion.rotations, KEY_TOLERANCE.1);
        let values: Vec<Quat> = kept.iter().map(|&k| motion.rotations[k]).collect();
        b.channel(animation, node, &frame_times(&kept), Track::Rotation(&values), false);
    }
}

#[cfg(test)]
mod tests;
