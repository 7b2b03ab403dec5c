//! The village as a file: valid, closed, outward, the same twice; as many flames as promised, things on the ground.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use glam::{Vec2, Vec3};

use super::motion;
use super::plan::*;
use crate::builtin::glb;
use crate::builtin::tests::document::{self, read};
use crate::{NoFiles, Scene};

const DETAIL: f32 = 0.1;

static SMALL: LazyLock<Vec<u8>> = LazyLock::new(|| glb("village", DETAIL).expect("the small village"));

fn loaded() -> Scene {
    crate::load("village.glb", &SMALL, &NoFiles).expect("loads")
}

/// Single layers, open on purpose.
fn is_sheet(name: &str) -> bool {
    name.ends_with("leaves") || ["land", "bedrock", "water", "awning-cloth", "moon"].contains(&name)
}

#[test]
fn bytes_layout_and_triangle_counts_are_as_promised() {
    let hash = "93fdcd9e7a4e837b63b0e99dcaebff04cfbb5172eecf93f29687f61eab85a43a";
    document::assert_promises("village", DETAIL, hash, 400_000..=600_000, 70_000..=120_000);
}

#[test]
fn meshes_are_closed_and_outward() {
    for detail in [DETAIL, 1.0] {
        let doc = read(&glb("village", detail).expect("village"));
        document::assert_closed(&doc, is_sheet);
        document::assert_pieces_outward(&doc, is_sheet);
    }
}

#[test]
fn land_and_bedrock_are_closed_together() {
    let doc = read(&SMALL);
    let mut edges: BTreeMap<_, i32> = BTreeMap::new();
    for mesh in doc.gltf.meshes().filter(|m| matches!(m.name(), Some("land" | "bedrock"))) {
        for [a, b, c] in document::triangles(&doc, &mesh).0 {
            for (p, q) in [(a, b), (b, c), (c, a)] {
                let [p, q] = [p, q].map(|p| (p + Vec3::ZERO).to_array().map(f32::to_bits));
                *edges.entry((p.min(q), p.max(q))).or_default() += if p < q { 1 } else { -1 };
            }
        }
    }
    assert!(edges.len() > 1000 && edges.values().all(|&balance| balance == 0));
}

#[test]
fn vertex_normals_agree_with_faces() {
    document::assert_normals_agree(&read(&SMALL));
}

#[test]
fn loads_with_its_parts_and_no_warning() {
    let scene = loaded();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    document::assert_motion(&scene, "village", &["sails", "sign-0", "sign-1"], &["path-lane", "path-roofs"]);
    assert!(scene.lights.is_empty(), "only areas emit");
    let mapped = scene.materials.iter().filter(|m| m.normal_texture.is_some()).count();
    assert!(mapped >= 3, "{mapped} materials with normal maps");
}

#[test]
fn flames_and_a_moon_emit_and_stand_still() {
    let scene = loaded();
    let lamps = document::lamps(&read(&SMALL), &scene);
    assert!(lamps.iter().all(|lamp| !lamp.moves));
    let flames = lamps.iter().filter(|lamp| lamp.name == "flame" && lamp.shape.is_none()).count();
    assert_eq!((flames, lamps.len()), (TORCHES.len() + 2 * PLOTS.len() + 3, flames + 1));
    assert!(flames >= 40);
    let moon = lamps.last().expect("the moon");
    assert_eq!((moon.name.as_str(), moon.shape.as_deref()), ("moon", Some("disc")));
    // It shines on the green.
    let pose = scene.pose(0.0);
    let world = pose.instances[moon.instance].world_from_mesh;
    let (at, along) = (Vec3::from(world.translation), world.transform_vector3(Vec3::NEG_Z));
    assert!(along.dot(-at.normalize()) > 0.99, "the moon shines along {along}");
}

#[test]
fn flames_burn_in_their_baskets() {
    let scene = loaded();
    let pose = scene.pose(0.0);
    let at = |i: usize| Vec3::from(pose.instances[i].world_from_mesh.translation);
    let name = |i: usize| scene.nodes[scene.instances[i].node as usize].name.as_str();
    let torches: Vec<usize> = (0..scene.instances.len()).filter(|&i| name(i).ends_with("torch")).collect();
    for lamp in document::lamps(&read(&SMALL), &scene).iter().filter(|lamp| lamp.name == "flame") {
        let p = at(lamp.instance);
        let held = torches.iter().any(|&i| {
            let holder = match name(i) {
                "torch" => Vec3::Y * super::things::STANDING,
                _ => super::things::ON_WALL,
            };
            pose.instances[i].world_from_mesh.transform_point3(holder).distance(p) < 1e-3
        });
        let fire = on_ground(KETTLE);
        assert!(held || p.distance(fire) < 0.4, "a flame without a torch at {p}");
    }
}

#[test]
fn what_stands_on_the_ground_reaches_into_it() {
    // Every foot is at the land's height as the land's mesh has it at full detail, or a little below.
    let scene = crate::load("village.glb", &glb("village", 1.0).expect("village"), &NoFiles).expect("loads");
    let pose = scene.pose(0.0);
    let land = scene.nodes.iter().position(|n| n.name == "land").expect("land") as u32;
    let land = scene.instances.iter().find(|i| i.node == land).expect("land").mesh as usize;
    let land = &scene.meshes[land];
    let height = |p: Vec2| {
        let inside = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| land.positions[v as usize]);
            let flat = [a, b, c].map(|q| Vec2::new(q.x, q.z));
            let area = (flat[1] - flat[0]).perp_dot(flat[2] - flat[0]);
            if a.y.min(b.y).min(c.y) <= BEDROCK || area.abs() < 1e-9 {
                return None;
            }
            let u = (p - flat[0]).perp_dot(flat[2] - flat[0]) / area;
            let v = (flat[1] - flat[0]).perp_dot(p - flat[0]) / area;
            (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some(a.y + (b.y - a.y) * u + (c.y - a.y) * v)
        };
        land.triangles.iter().find_map(inside)
    };
    let mut worst = 0.0_f32;
    for (i, instance) in scene.instances.iter().enumerate() {
        let name = scene.nodes[instance.node as usize].name.as_str();
        if !["barrel", "stall", "well", "torch", "cart", "fir-wood", "tree-wood", "fence"].contains(&name) {
            continue;
        }
        let at = Vec3::from(pose.instances[i].world_from_mesh.translation);
        let found = height(Vec2::new(at.x, at.z)).expect("on the land");
        worst = worst.max((at.y - found).abs());
        assert!((at.y - found).abs() < 0.05, "{name} at {at} stands {} m off the ground", at.y - found);
    }
    eprintln!("feet are at most {worst:.3} m off the ground");
}

#[test]
fn nothing_stands_in_a_house_or_in_the_pond() {
    let inside = |at: [f32; 2], margin: f32| {
        PLOTS.iter().any(|plot| {
            let half = DESIGNS[plot.design].half;
            let (s, c) = libm::sincosf(plot.turn);
            let d = Vec2::from(at) - Vec2::from(plot.at);
            let local = Vec2::new(c * d.x - s * d.y, s * d.x + c * d.y).abs();
            local.x < half[0] + margin && local.y < half[1] + margin
        })
    };
    let mut places: Vec<(&str, [f32; 2], f32)> = vec![("the well", WELL, 1.2), ("the kettle", KETTLE, 1.0)];
    places.extend(TORCHES.map(|at| ("a torch", at, 0.25)));
    places.extend(BARRELS.map(|at| ("a barrel", at, 0.33)));
    places.extend(CRATES.map(|(at, ..)| ("a crate", at, 0.55)));
    places.extend(CARTS.map(|(at, _)| ("a cart", at, 1.2)));
    places.extend(STALLS.map(|(at, _)| ("a stall", at, 1.5)));
    places.extend(STACKS.map(|(at, _)| ("a stack", at, 0.5)));
    // Crowns stay out of roofs.
    places.extend(TREES.map(|(at, _, scale)| ("a tree", at, 0.5 + 1.9 * scale)));
    for (what, at, margin) in places {
        assert!(!inside(at, margin), "{what} at {at:?} stands in a house");
        assert!(off_pond(Vec2::from(at)) > 1.05, "{what} at {at:?} stands in the pond");
    }
}

#[test]
fn cameras_keep_clear() {
    document::assert_cameras_keep_clear(
        &loaded(),
        &[("lane", motion::lane()), ("roofs", motion::roofs())],
        0.3,
    );
}
