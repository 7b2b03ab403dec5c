//! The atrium under area lights: the same hall, four lights that emit from their area, nothing else that shines.

use std::sync::LazyLock;

use glam::Vec3;

use super::super::lamps::{GLOBE, HOOKS, PANEL};
use super::super::motion;
use super::super::plan::LANTERNS;
use super::{DETAIL, is_sheet};
use crate::builtin::glb;
use crate::builtin::tests::document::{self, read};
use crate::{NoFiles, Scene};

static SMALL: LazyLock<Vec<u8>> = LazyLock::new(|| glb("atrium-lamps", DETAIL).expect("the small atrium"));

fn loaded() -> Scene {
    crate::load("atrium-lamps.glb", &SMALL, &NoFiles).expect("loads")
}

#[test]
fn bytes_layout_and_triangle_counts_are_as_promised() {
    let hash = "3f4b2bfea2ff9979e9be61f9cf1ae123f3835159ff4b90e85c00aafc1d89e44b";
    document::assert_promises("atrium-lamps", DETAIL, hash, 100_000..=300_000, 3_000..=40_000);
}

#[test]
fn meshes_are_closed_and_outward() {
    for detail in [DETAIL, 1.0] {
        let glb = glb("atrium-lamps", detail).expect("atrium");
        document::assert_closed(&read(&glb), |name| is_sheet(name) || name == "panel");
    }
    document::assert_normals_agree(&read(&SMALL));
}

#[test]
fn four_areas_emit_and_nothing_else_shines() {
    let scene = loaded();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert!(scene.lights.is_empty());
    let pose = scene.pose(0.0);
    let lamps = document::lamps(&read(&SMALL), &scene);
    let found: Vec<(&str, Option<&str>, bool)> =
        lamps.iter().map(|lamp| (lamp.name.as_str(), lamp.shape.as_deref(), lamp.moves)).collect();
    assert_eq!(
        found,
        [
            ("globe-0", Some("sphere"), false),
            ("globe-1", Some("sphere"), false),
            ("globe-2", Some("sphere"), false),
            ("panel", Some("rectangle"), false)
        ]
    );
    let at = |i: usize| Vec3::from(pose.instances[lamps[i].instance].world_from_mesh.translation);
    for (i, hook) in HOOKS.into_iter().enumerate() {
        assert_eq!(at(i), LANTERNS[hook] - Vec3::Y * GLOBE[1]);
    }
    let panel = pose.instances[lamps[3].instance].world_from_mesh;
    assert_eq!(at(3), PANEL.0);
    assert!(panel.transform_vector3(Vec3::NEG_Z).dot(Vec3::NEG_Y) > 0.9999, "it shines down");
    assert!(panel.transform_vector3(Vec3::X).x.abs() > 0.9999, "its long side lies along the hall");
}

#[test]
fn it_is_the_same_hall() {
    let plain = crate::load("atrium.glb", &glb("atrium", DETAIL).expect("atrium"), &NoFiles).expect("loads");
    let names = |scene: &Scene| -> Vec<String> {
        let other = ["spot", "sun", "lantern", "globe", "panel"];
        let names = scene.nodes.iter().map(|n| n.name.clone());
        names.filter(|name| !other.iter().any(|o| name.starts_with(o))).collect()
    };
    assert_eq!(names(&loaded()), names(&plain));
}

#[test]
fn cameras_keep_clear() {
    document::assert_cameras_keep_clear(
        &loaded(),
        &[("walk", motion::walk()), ("gallery", motion::flight())],
        0.3,
    );
}
