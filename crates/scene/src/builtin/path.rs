//! Smooth camera paths: a curve for the eye at constant speed, another for what it looks at.

use glam::{Mat3, Quat, Vec3};

use super::builder::{AnimationId, GlbBuilder, NodeSpec, Track};
use super::physics::frame_times;
use crate::PosedCamera;

/// A point of the uniform cubic B-spline with the given control points, whose ends it meets; `t` in 0 … 1.
/// It has continuous acceleration and stays within the hull of four neighbouring control points.
pub fn spline(control: &[Vec3], t: f32) -> Vec3 {
    let last = control.len().saturating_sub(1) as i64;
    // Tripled ends: one more span at either end, and the curve starts and ends at the outer control points.
    let spans = (last + 2) as f32;
    let s = (t.clamp(0.0, 1.0) * spans).min(spans - 1e-4);
    let i = s.floor();
    let f = s - i;
    let at = |k: i64| control.get((i as i64 + k - 2).clamp(0, last) as usize).copied().unwrap_or(Vec3::ZERO);
    let (f2, f3) = (f * f, f * f * f);
    let weights = [
        (1.0 - 3.0 * f + 3.0 * f2 - f3) / 6.0,
        (4.0 - 6.0 * f2 + 3.0 * f3) / 6.0,
        (1.0 + 3.0 * f + 3.0 * f2 - 3.0 * f3) / 6.0,
        f3 / 6.0,
    ];
    at(0) * weights[0] + at(1) * weights[1] + at(2) * weights[2] + at(3) * weights[3]
}

/// `frames + 1` points along [`spline`] at equal distances on the curve.
pub fn even_spline(control: &[Vec3], frames: u32) -> Vec<Vec3> {
    let fine = 16 * frames.max(64);
    let points: Vec<Vec3> = (0..=fine).map(|i| spline(control, i as f32 / fine as f32)).collect();
    even(&points, frames)
}

/// `steps + 1` points at equal distances along a line of points.
fn even(points: &[Vec3], steps: u32) -> Vec<Vec3> {
    let mut way = vec![0.0_f64];
    for pair in points.windows(2) {
        way.push(way[way.len() - 1] + f64::from(pair[0].distance(pair[1])));
    }
    let total = way[way.len() - 1];
    let mut segment = 0;
    (0..=steps)
        .map(|i| {
            let goal = total * f64::from(i) / f64::from(steps.max(1));
            while segment + 2 < way.len() && way[segment + 1] < goal {
                segment += 1;
            }
            let step = (way[segment + 1] - way[segment]).max(1e-12);
            points[segment].lerp(points[segment + 1], (((goal - way[segment]) / step) as f32).clamp(0.0, 1.0))
        })
        .collect()
}

/// `steps + 1` points at equal distances on the closed uniform cubic B-spline of control points; the last is the first.
pub fn even_loop(control: &[Vec3], steps: u32) -> Vec<Vec3> {
    let count = control.len().max(1);
    let at = |i: usize| control.get(i % count).copied().unwrap_or(Vec3::ZERO);
    let fine = 16 * steps.max(64);
    let points: Vec<Vec3> = (0..=fine)
        .map(|k| {
            let s = (k % fine) as f32 * count as f32 / fine as f32;
            let (i, f) = (s as usize, s - libm::floorf(s));
            let (f2, f3) = (f * f, f * f * f);
            let weights = [
                (1.0 - 3.0 * f + 3.0 * f2 - f3) / 6.0,
                (4.0 - 6.0 * f2 + 3.0 * f3) / 6.0,
                (1.0 + 3.0 * f + 3.0 * f2 - 3.0 * f3) / 6.0,
                f3 / 6.0,
            ];
            (0..4).fold(Vec3::ZERO, |p, j| p + at(i + j) * weights[j])
        })
        .collect();
    even(&points, steps)
}

/// Poses of a camera that moves along `eye` at constant speed and looks at a point that moves along `target` evenly in time:
/// `frames + 1` positions and rotations (neighbours in one hemisphere), upright.
pub fn fly(eye: &[Vec3], target: &[Vec3], frames: u32) -> (Vec<Vec3>, Vec<Quat>) {
    let positions = even_spline(eye, frames);
    let mut rotations: Vec<Quat> = Vec::with_capacity(positions.len());
    for (i, &position) in positions.iter().enumerate() {
        let look = spline(target, i as f32 / frames.max(1) as f32);
        let camera = PosedCamera::look_at(position, look, 1.0);
        let mut rotation = Quat::from_mat3a(&camera.world_from_view.matrix3).normalize();
        if rotations.last().is_some_and(|last| last.dot(rotation) < 0.0) {
            rotation = -rotation;
        }
        rotations.push(rotation);
    }
    (positions, rotations)
}

/// A rotation that brings −Z to a direction, Y as upright as possible.
pub fn look_along(direction: Vec3) -> Quat {
    let back = -direction.normalize_or(Vec3::NEG_Z);
    let right = Vec3::Y.cross(back).normalize_or(Vec3::X);
    Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back)).normalize()
}

/// Control points of a camera's eye and of what it looks at.
pub type Flight = (Vec<Vec3>, Vec<Vec3>);

/// Adds cameras that [`fly`], each along its control points of eye and target: a name and a key every frame.
pub fn place_cameras(b: &mut GlbBuilder, animation: AnimationId, paths: [(&str, Flight); 2], frames: u32) {
    let lens = b.camera("path", std::f32::consts::FRAC_PI_3, 0.05);
    let times = frame_times(&(0..=frames as usize).collect::<Vec<_>>());
    for (name, (eye, look)) in paths {
        let (positions, rotations) = fly(&eye, &look, frames);
        let spec = NodeSpec {
            camera: Some(lens),
            translation: positions[0],
            rotation: rotations[0],
            ..NodeSpec::default()
        };
        let node = b.node(name, &spec);
        b.channel(animation, node, &times, Track::Translation(&positions), false);
        b.channel(animation, node, &times, Track::Rotation(&rotations), false);
    }
}
