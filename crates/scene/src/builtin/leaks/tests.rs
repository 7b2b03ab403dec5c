//! The gallery as a file: valid, closed, outward, the same twice; what should touch does, what moves stays clear of the rest.

use std::sync::LazyLock;

use glam::Vec3;

use super::plan::*;
use super::{motion, partitions};
use crate::builtin::tests::document::{self, read};
use crate::builtin::{Detail, glb};
use crate::{Aabb, NoFiles, Scene};

const DETAIL: f32 = 0.1;

static SMALL: LazyLock<Vec<u8>> = LazyLock::new(|| glb("leaks", DETAIL).expect("the small gallery"));

fn loaded() -> Scene {
    crate::load("leaks.glb", &SMALL, &NoFiles).expect("loads")
}

fn is_cloth(name: &str) -> bool {
    name.ends_with("curtain")
}

#[test]
fn bytes_layout_and_triangle_counts_are_as_promised() {
    let hash = "f13bf7234b3730dd67e15c1e79a0a856ca5887dff9819a4993fcface63030120";
    document::assert_promises("leaks", DETAIL, hash, 60_000..=120_000, 10_000..=30_000);
}

#[test]
fn meshes_are_closed_and_outward() {
    for detail in [DETAIL, 1.0] {
        document::assert_closed(&read(&glb("leaks", detail).expect("gallery")), is_cloth);
    }
}

#[test]
fn vertex_normals_agree_with_faces() {
    document::assert_normals_agree(&read(&SMALL));
}

#[test]
fn loads_with_its_parts_and_no_warning() {
    let scene = loaded();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let slats: Vec<String> = (0..SLATS.0).map(|i| format!("slat-{i}")).collect();
    let moving: Vec<&str> = ["door", "cart"].into_iter().chain(slats.iter().map(String::as_str)).collect();
    document::assert_motion(&scene, "leaks", &moving, &["path-visit", "path-close"]);
    let sheets = scene.materials.iter().filter(|m| m.double_sided).count();
    assert_eq!(sheets, 2, "only curtains have two sides");
    let bounds = scene.bounds_world(&scene.pose(0.0));
    let reach = Vec3::new(HALL[0] + WALL, CEILING + 0.2, HALL[1] + WALL);
    assert!((bounds.max - reach).abs().max_element() < 1e-5, "{bounds:?}");
}

/// World boxes of the instances of nodes by name.
fn boxes(scene: &Scene, time: f64, is_meant: impl Fn(&str) -> bool) -> Vec<(String, Aabb)> {
    let pose = scene.pose(time);
    let name = |i: usize| scene.nodes[scene.instances[i].node as usize].name.clone();
    let named = (0..scene.instances.len()).map(|i| (name(i), scene.instance_bounds_world(&pose, i)));
    named.filter(|(name, _)| is_meant(name)).collect()
}

#[test]
fn volumes_that_touch_do_so_to_the_last_bit() {
    let scene = loaded();
    let all =
        boxes(&scene, 0.0, |name| name.starts_with("block") || name.starts_with("floor") || name == "water");
    let get = |name: &str| all.iter().find(|(n, _)| n == name).expect(name).1;
    // The floor's pieces are one plane without gaps or overlaps.
    let floors = ["floor-west", "floor-south", "floor-north", "floor-east"].map(get);
    assert!(floors.iter().all(|b| b.max.y == 0.0));
    let area: f32 = floors.iter().map(|b| (b.max.x - b.min.x) * (b.max.z - b.min.z)).sum();
    let [[x0, x1], [z0, z1]] = BASIN;
    let whole = 4.0 * (HALL[0] + WALL) * (HALL[1] + WALL) - (x1 - x0) * (z1 - z0);
    assert!((area - whole).abs() < 1e-3, "{area} is not {whole}");
    let water = get("water");
    assert_eq!((water.min.x, water.max.x), (get("floor-west").max.x, get("floor-east").min.x));
    assert_eq!((water.min.z, water.max.z), (get("floor-north").max.z, get("floor-south").min.z));
    // Blocks share faces, edges or corners, and no volume.
    let blocks: Vec<Aabb> = (0..8).map(|i| get(&format!("block-{i}"))).collect();
    let (mut faces, mut edges) = (0, 0);
    for (i, a) in blocks.iter().enumerate() {
        for b in &blocks[..i] {
            let overlap = a.max.min(b.max) - a.min.max(b.min);
            assert!(overlap.min_element() <= 0.0, "{a:?} and {b:?} overlap");
            let touching = overlap.min_element() == 0.0;
            let zeros = overlap.to_array().iter().filter(|&&o| o == 0.0).count();
            faces += usize::from(touching && zeros == 1);
            edges += usize::from(touching && zeros == 2);
        }
    }
    assert!(faces >= 8 && edges >= 3, "{faces} faces, {edges} edges");
}

#[test]
fn partitions_are_as_thin_as_they_should_be() {
    let thinnest = |kit: &crate::builtin::kit::Kit<super::palette::Stuff>| {
        // Pieces of a kit are merged by material, so the least distance between opposite planes tells.
        let mut least = f32::INFINITY;
        for (_, piece) in &kit.parts {
            for axis in 0..3 {
                let mut planes: Vec<f32> = piece.positions.iter().map(|p| p[axis]).collect();
                planes.sort_by(f32::total_cmp);
                least = planes.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 1e-4).fold(least, f32::min);
            }
        }
        least
    };
    let detail = Detail(1.0);
    for (kit, thickness) in [
        (partitions::bookcase(detail), BOARD),
        (partitions::closet(detail), BOARD),
        (partitions::slat(detail), 0.012 - 2.0 * 0.003),
    ] {
        let found = thinnest(&kit);
        assert!(found <= thickness + 1e-4, "{found} m instead of {thickness} m");
    }
}

#[test]
fn what_moves_passes_close_by_and_through_nothing() {
    let scene = loaded();
    let movers = |name: &str| name == "door" || name == "cart" || name.starts_with("slat");
    let still = document::still_triangles(&read(&SMALL), |name| !movers(name) && !is_cloth(name));
    let (mut nearest, mut slats) = (f32::INFINITY, f32::INFINITY);
    for step in 0..=60 {
        let time = f64::from(SECONDS) * f64::from(step) / 60.0;
        let moving = boxes(&scene, time, movers);
        for (name, b) in &moving {
            if name.starts_with("slat") {
                continue;
            }
            // Rolling on the floor and sliding over it are no collisions.
            let lifted = Aabb { min: b.min + Vec3::Y * 0.003, max: b.max };
            for t in &still {
                let other = Aabb::from_points(*t);
                let gap = (other.min - lifted.max).max(lifted.min - other.max).max_element();
                assert!(gap > 0.0, "{name} meets {other:?} at {time} s");
                nearest = nearest.min(gap);
            }
        }
        let mut levels: Vec<&Aabb> =
            moving.iter().filter(|(name, _)| name.starts_with("slat")).map(|(_, b)| b).collect();
        levels.sort_by(|a, b| a.min.y.total_cmp(&b.min.y));
        slats = levels.windows(2).map(|w| w[1].min.y - w[0].max.y).fold(slats, f32::min);
    }
    eprintln!("door and cart come as near as {nearest:.4} m, slats {slats:.4} m");
    assert!(nearest < 0.05 && slats > 0.0);
}

#[test]
fn cameras_keep_clear() {
    document::assert_cameras_keep_clear(
        &loaded(),
        &[("visit", motion::visit()), ("close", motion::close())],
        0.3,
    );
}
