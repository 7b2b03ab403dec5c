//! Messages as text.

use std::sync::{Arc, LazyLock};

use proptest::prelude::*;

use crate::work::{Setup, ToWorker};
use crate::{FromHost, FromViewer, Guest, GuestConfig, LightHead, LookCamera};
use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, PosedCamera, Scene, builtin};

static SCENE: LazyLock<Arc<Scene>> = LazyLock::new(|| {
    let glb = builtin::glb("cornell", 0.1).unwrap();
    Arc::new(dapple_scene::load("cornell.glb", &glb, &NoFiles).unwrap())
});

/// A host or worker of before has no tolerance of area lights.
#[test]
fn how_to_light_comes_through_with_and_without_a_tolerance() {
    let setup = Setup {
        points_per_m2: 60.0,
        seed: 1,
        rays: 16,
        rays_still: 0,
        radius_m: 0.6,
        cuts: true,
        area_lights: true,
        light_tolerance: Some(0.5),
        step_s: 0.05,
        ray_budget: None,
    };
    let told = ToWorker::Setup(setup).to_text();
    assert_eq!(ToWorker::parse(&told).unwrap(), ToWorker::Setup(setup));
    let before = ToWorker::Setup(Setup { light_tolerance: None, ..setup });
    assert!(!before.to_text().contains("light_tolerance"));
    assert_eq!(ToWorker::parse(&before.to_text()).unwrap(), before);
}

#[test]
fn cameras_come_through() {
    let camera = PosedCamera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(-4.0, 0.5, 0.0), 0.9);
    let told = LookCamera::of(&camera, 1.5);
    let posed = told.posed();
    assert!(posed.world_from_view.abs_diff_eq(camera.world_from_view, 1e-5));
    let down = PosedCamera::look_at(Vec3::Y, Vec3::ZERO, 0.9);
    assert!(LookCamera::of(&down, 1.0).posed().world_from_view.abs_diff_eq(down.world_from_view, 1e-5));
}

proptest! {
    #[test]
    fn any_text_is_a_message_or_an_error(text in ".{0,300}") {
        let _ = FromViewer::parse(&text);
        let _ = FromHost::parse(&text);
    }

    #[test]
    fn any_bytes_are_light_or_an_error(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let _ = LightHead::parse(&bytes);
        let mut led = bytes.clone();
        led.insert(0, b'L');
        let mut guest = Guest::new(SCENE.clone(), GuestConfig::default());
        guest.connected(0);
        let _ = guest.receive_bytes(&led, 5);
        let _ = guest.next(10);
    }
}
