//! The extended field of view ([Neff2023] sec. 3.3): what a viewer sees or may soon see.

use dapple_scene::{PosedCamera, Projection};
use glam::Vec2;

use crate::psao::update::ConvexVolume;

/// Half an angle of view beyond which a pyramid is as good as a half-space, radians (89°).
const WIDEST: f32 = 1.553_343;

/// What a camera sees in a picture of that aspect ratio (width / height) with `margin_degrees` (0 … 90) more on every side; no
/// pyramid is wider than 178°. An orthographic view grows by the margin's tangent.
pub fn extended_view(camera: &PosedCamera, aspect: f32, margin_degrees: f32) -> ConvexVolume {
    let margin = margin_degrees.clamp(0.0, 90.0).to_radians();
    let tangent = |angle: f32| {
        let at = Vec2::from_angle(angle.min(WIDEST));
        at.y / at.x
    };
    let (projection, aspect) = match camera.projection {
        Projection::Perspective { yfov, near } => {
            let half_y = 0.5 * yfov;
            let half_x = libm::atanf(aspect * tangent(half_y));
            let (x, y) = (tangent(half_x + margin), tangent(half_y + margin));
            (Projection::Perspective { yfov: 2.0 * (half_y + margin).min(WIDEST), near }, x / y)
        }
        Projection::Orthographic { half_height, near, far } => {
            let half_height = half_height * (1.0 + tangent(margin));
            (Projection::Orthographic { half_height, near, far }, aspect)
        }
    };
    ConvexVolume::frustum(&PosedCamera { projection, ..*camera }, aspect, f32::INFINITY, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn the_margin_is_added_to_both_angles() {
        let camera = PosedCamera::look_at(Vec3::ZERO, Vec3::NEG_Z, 60f32.to_radians());
        let aspect = 16.0 / 9.0;
        // Half angles of the picture: 30° up, atan(16/9 · tan 30°) = 45.75° aside.
        for (margin, up, aside) in [(0.0, 30.0, 45.75), (20.0, 50.0, 65.75), (80.0, 89.0, 89.0)] {
            let view = extended_view(&camera, aspect, margin);
            let at = |x: f32, y: f32| {
                let tangent = |degrees: f32| degrees.to_radians().tan();
                10.0 * Vec3::new(tangent(x), tangent(y), -1.0)
            };
            for sign in [-1.0, 1.0] {
                assert!(
                    view.contains(at(0.0, sign * (up - 0.3))) && view.contains(at(sign * (aside - 0.3), 0.0))
                );
                assert!(!view.contains(at(0.0, sign * (up + 0.3))), "{margin}");
                assert!(!view.contains(at(sign * (aside + 0.3), 0.0)), "{margin}");
            }
            assert!(!view.contains(Vec3::Z), "behind");
        }
    }
}
