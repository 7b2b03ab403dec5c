//! Every shared scene loads with the triangles its table lists, and poses sensibly.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::{load_path, shared, use_scene};
use dapple_scene::CameraSource;
use dapple_scene::glam::Vec3;

/// Path, triangles of the default scene, joints of the largest skin, animations.
const SCENES: [(&str, usize, usize, usize); 23] = [
    ("sponza-dabrovic/sponza.obj", 66_450, 0, 0),
    ("pandora/pandora.obj", 60_810, 0, 0),
    ("zdm2/zdm2.glb", 58_772, 0, 0),
    ("godot-room/room.glb", 63_720, 0, 0),
    ("godot-living-room/living_room.glb", 5_088, 0, 0),
    ("webxr-garage/garage.gltf", 11_358, 0, 0),
    ("webxr-cave/cave.gltf", 5_894, 0, 0),
    ("vr-gallery/vr-gallery.glb", 1_930, 0, 0),
    ("house-alphamask/house.glb", 10_497, 0, 0),
    ("cornell-box-mcguire/cornellbox.obj", 13_056, 0, 0),
    ("cornell-box-emissive/CornellBox.glb", 36, 0, 0),
    ("stanford-bunny/stanford-bunny.obj", 69_451, 0, 0),
    ("DamagedHelmet/DamagedHelmet.glb", 15_452, 0, 0),
    ("NormalTangentTest/NormalTangentTest.glb", 7_774, 0, 0),
    ("anim-CesiumMan/CesiumMan.glb", 4_672, 19, 1),
    ("anim-Fox/Fox.glb", 576, 24, 3),
    ("anim-mannequiny/mannequiny.glb", 13_832, 45, 10),
    ("anim-RiggedSimple/RiggedSimple.glb", 188, 2, 1),
    ("anim-CesiumMilkTruck/CesiumMilkTruck.glb", 3_624, 0, 1),
    ("anim-BoxAnimated/BoxAnimated.glb", 254, 0, 1),
    ("anim-AnimatedMorphCube/AnimatedMorphCube.glb", 12, 0, 1),
    ("anim-AnimatedMorphSphere/AnimatedMorphSphere.glb", 960, 0, 1),
    ("anim-MorphStressTest/morph-stress-test.glb", 2_412, 0, 3),
];

#[test]
fn scenes_have_their_triangles() {
    let Some(folder) = shared("scenes") else { return };
    for (path, triangles, joints, animations) in SCENES {
        let scene = load_path(&folder.join(path)).unwrap_or_else(|error| panic!("{error}"));
        use_scene(&scene, path);
        assert_eq!(scene.triangle_count(), triangles, "{path}");
        assert_eq!(scene.skins.iter().map(|skin| skin.joints.len()).max().unwrap_or(0), joints, "{path}");
        assert_eq!(scene.animations.len(), animations, "{path}");
        assert_eq!(scene.active_animation, (animations > 0).then_some(0), "{path}");
        assert!(scene.auto_radius_m() > 0.0, "{path}");
        assert_eq!(scene.hash(), load_path(&folder.join(path)).unwrap().hash(), "{path}");
    }
}

#[test]
fn animated_scenes_stay_in_place() {
    let Some(folder) = shared("scenes") else { return };
    let skins = folder.join("asset-generator-skin");
    let mut paths: Vec<_> = std::fs::read_dir(skins)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "gltf"))
        .collect();
    assert_eq!(paths.len(), 7);
    paths.sort();
    let animated = SCENES.iter().filter(|scene| scene.3 > 0).map(|scene| folder.join(scene.0));
    for path in paths.into_iter().chain(animated) {
        let mut scene = load_path(&path).unwrap_or_else(|error| panic!("{error}"));
        use_scene(&scene, path.to_str().unwrap());
        for animation in 0..scene.animations.len() as u32 {
            scene.active_animation = Some(animation);
            let duration = f64::from(scene.animations[animation as usize].duration());
            let first = scene.pose(0.0);
            let rest = scene.bounds_world(&first);
            let mut moved = false;
            for step in 0..8 {
                let pose = scene.pose(duration * (f64::from(step) + 0.4) / 8.0);
                let bounds = scene.bounds_world(&pose);
                let at =
                    format!("{} animation {animation} step {step}: {bounds:?} from {rest:?}", path.display());
                assert!(
                    bounds.diagonal() > 0.3 * rest.diagonal() && bounds.diagonal() < 3.0 * rest.diagonal(),
                    "{at}"
                );
                // Some walk or jump away from where they start.
                let near = rest.inflated(3.0 * rest.diagonal());
                assert!(near.intersects(&bounds) && near.distance_squared(bounds.center()) == 0.0, "{at}");
                let differs = |i| scene.vertex_positions(&pose, i) != scene.vertex_positions(&first, i);
                moved |= (0..scene.instances.len()).any(differs);
                for (i, posed) in pose.instances.iter().enumerate() {
                    assert!(!scene.instance_bounds_world(&pose, i).is_empty(), "{at}");
                    assert_eq!(
                        posed.deformed.is_some(),
                        scene.meshes[scene.instances[i].mesh as usize].is_deformable()
                    );
                }
            }
            // A turning wheel keeps its box, but its node turns.
            let nodes = |time| scene.pose(time).world_from_node;
            moved |= nodes(0.0) != nodes(0.3 * duration);
            assert!(moved || duration == 0.0, "{} animation {animation} moves nothing", path.display());
            let (a, b) = (scene.pose(0.37 * duration), scene.pose(0.37 * duration));
            for i in 0..scene.instances.len() {
                assert_eq!(
                    scene.vertex_positions(&a, i),
                    scene.vertex_positions(&b, i),
                    "same time, same pose"
                );
            }
        }
    }
}

#[test]
fn a_walking_man_has_the_size_of_a_man() {
    let Some(folder) = shared("scenes") else { return };
    let scene = load_path(&folder.join("anim-CesiumMan/CesiumMan.glb")).unwrap();
    for time in [0.0, 0.5, 1.0, 1.9] {
        let bounds = scene.bounds_world(&scene.pose(time));
        assert!((1.3..1.7).contains(&(bounds.max.y - bounds.min.y)), "{bounds:?}");
        assert!(bounds.min.y.abs() < 0.15, "feet on the floor: {bounds:?}");
    }
    let scale = scene.instances[0].rest_from_mesh.x_axis.x;
    assert!((0.9..1.1).contains(&scale), "{scale}");
}

#[test]
fn buildings_are_seen_from_inside_and_objects_from_outside() {
    let Some(folder) = shared("scenes") else { return };
    for (path, inside) in [
        ("sponza-dabrovic/sponza.obj", true),
        ("cornell-box-mcguire/cornellbox.obj", true),
        ("cornell-box-emissive/CornellBox.glb", true),
        ("godot-room/room.glb", true),
        ("godot-living-room/living_room.glb", true),
        ("webxr-garage/garage.gltf", true),
        ("stanford-bunny/stanford-bunny.obj", false),
        ("DamagedHelmet/DamagedHelmet.glb", false),
        ("anim-CesiumMan/CesiumMan.glb", false),
    ] {
        let scene = load_path(&folder.join(path)).unwrap();
        let pose = scene.pose(0.0);
        let bounds = scene.bounds_world(&pose);
        let paths = scene.camera_paths();
        let orbit = paths.last().unwrap();
        assert!(matches!(orbit.source, CameraSource::Orbit(_)));
        let camera = orbit.camera(&scene, &pose);
        assert_eq!(bounds.distance_squared(camera.eye_world()) == 0.0, inside, "{path}: {:?}", orbit.source);
        assert!(camera.world_from_view.transform_vector3(Vec3::NEG_Z).is_normalized());
    }
}
