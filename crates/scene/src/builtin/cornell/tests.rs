//! The box and its stages as a file: valid, closed, outward, the same twice; stages lie too far apart to see each other.

use std::sync::LazyLock;

use glam::Vec3;

use super::motion;
use super::plan::*;
use crate::builtin::glb;
use crate::builtin::tests::document::{self, point_triangle_distance, read};
use crate::{Aabb, NoFiles, Scene};

const DETAIL: f32 = 0.1;

static SMALL: LazyLock<Vec<u8>> = LazyLock::new(|| glb("cornell", DETAIL).expect("the small box"));

fn loaded() -> Scene {
    crate::load("cornell.glb", &SMALL, &NoFiles).expect("loads")
}

#[test]
fn bytes_layout_and_triangle_counts_are_as_promised() {
    let hash = "ee464273fa0b5cad322b015e5dcdde8cb519cc6d9af288c233a9a4ce8d33f453";
    document::assert_promises("cornell", DETAIL, hash, 20_000..=60_000, 3_000..=20_000);
}

#[test]
fn meshes_are_closed_and_outward() {
    for detail in [DETAIL, 1.0] {
        document::assert_closed(&read(&glb("cornell", detail).expect("box")), |_| false);
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
    document::assert_motion(&scene, "cornell", &["tall-block", "cube"], &["path-box", "path-stages"]);
    let light = scene.materials.iter().find(|m| m.name == "light").expect("a light");
    assert!(light.emissive_factor.min_element() > 1.0);
}

#[test]
fn stages_see_nothing_but_themselves() {
    // Of everything that is not of the stage itself and lies above its top, nothing is within reach of a place on it that has
    // a closed form; those lie up to 0.6 m from the middle.
    const REACH: f32 = 0.6;
    let doc = read(&SMALL);
    for stage in [OPEN, DISC, WALL, BALL] {
        let others = document::still_triangles(&doc, |name| name != stage.name);
        let above = others.iter().filter(|t| t.iter().any(|p| p.y > stage.at.y + 1e-4));
        let nearest = above.map(|t| point_triangle_distance(stage.at, *t)).fold(f32::INFINITY, f32::min);
        eprintln!("{}: {nearest:.2} m from everything else", stage.name);
        assert!(nearest > 2.0 * REACH, "{}: something is {nearest} m away", stage.name);
    }
}

#[test]
fn what_hangs_is_hidden_or_out_of_reach() {
    // From the places under disc and ball, what holds them is farther than rays go or behind them.
    let doc = read(&SMALL);
    for (stage, radius, height, reach) in
        [(DISC, DISC_SIZE[0], DISC_SIZE[1], 0.6), (BALL, BALL_SIZE[0], BALL_SIZE[1], 0.6)]
    {
        let own = document::still_triangles(&doc, |name| name == stage.name);
        // Inside the cone from the place that touches disc or ball, nothing is seen but these.
        let slope = match stage.name == DISC.name {
            true => radius / height,
            false => radius / libm::sqrtf(height * height - radius * radius),
        };
        for t in own {
            let p = t.map(|p| p - stage.at);
            let is_above = p.iter().any(|p| p.y > 1e-4);
            let is_far = point_triangle_distance(Vec3::ZERO, p) > reach;
            let is_inside = p.iter().all(|p| p.x * p.x + p.z * p.z <= 1.001 * slope * slope * p.y * p.y);
            assert!(!is_above || is_far || is_inside, "{}: {p:?} is seen", stage.name);
        }
    }
}

#[test]
fn blocks_turn_and_slide_without_meeting() {
    let scene = loaded();
    let find = |name: &str| {
        let node = scene.nodes.iter().position(|n| n.name == name).expect(name) as u32;
        scene.instances.iter().position(|i| i.node == node).expect(name)
    };
    let [tall, short, cube] = ["tall-block", "short-block", "cube"].map(find);
    let mut turned = 0.0_f32;
    for step in 0..=60 {
        let pose = scene.pose(f64::from(SECONDS) * f64::from(step) / 60.0);
        let corners = |i: usize| -> Vec<Vec3> {
            let world = pose.instances[i].world_from_mesh;
            scene.vertex_positions(&pose, i).iter().map(|p| world.transform_point3(*p)).collect()
        };
        let inside = Aabb { min: BOX - Vec3::new(INSIDE[0], 1e-4, INSIDE[2]), max: BOX + Vec3::from(INSIDE) };
        for i in [tall, short, cube] {
            assert!(corners(i).iter().all(|&p| inside.distance_squared(p) == 0.0), "step {step}");
        }
        // Boxes around them, seen from above, do not meet but for the turned pair, whose circles do not.
        let reach = |i: usize| {
            let c = corners(i);
            let middle = c.iter().sum::<Vec3>() / c.len() as f32;
            let radius = c.iter().map(|p| Vec3::new(p.x - middle.x, 0.0, p.z - middle.z).length());
            (Vec3::new(middle.x, 0.0, middle.z), radius.fold(0.0, f32::max))
        };
        for (a, b) in [(tall, short), (tall, cube), (short, cube)] {
            let ((p, r), (q, s)) = (reach(a), reach(b));
            assert!(p.distance(q) > r + s, "step {step}");
        }
        let x = pose.instances[tall].world_from_mesh.matrix3.x_axis;
        turned = turned.max(libm::atan2f(-x.z, x.x));
    }
    assert!(turned > TALL.turn + 0.3);
}

#[test]
fn cameras_keep_clear() {
    document::assert_cameras_keep_clear(
        &loaded(),
        &[("box", motion::into_box()), ("stages", motion::stages())],
        0.3,
    );
}
