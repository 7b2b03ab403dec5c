//! Cameras and what they project.

use glam::{Affine3A, Mat3, Mat4, Vec2, Vec3, Vec4};

/// A camera of the scene, fixed to a node: it looks along −Z, Y up.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file, or a made-up one.
    pub name: String,
    /// Lens.
    pub projection: Projection,
}

/// The lens of a camera. The picture's aspect ratio comes from its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Perspective, infinite far plane.
    Perspective {
        /// Vertical field of view, radians, 0 … π.
        yfov: f32,
        /// Near plane distance, metres, > 0.
        near: f32,
    },
    /// Parallel.
    Orthographic {
        /// Half the height of the view, metres, > 0.
        half_height: f32,
        /// Near plane distance, metres.
        near: f32,
        /// Far plane distance, metres, > near.
        far: f32,
    },
}

/// A camera placed in the world at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosedCamera {
    /// Rigid transform: camera looks along −Z of its view space.
    pub world_from_view: Affine3A,
    /// Lens.
    pub projection: Projection,
}

impl PosedCamera {
    /// A perspective camera at `eye` that looks at `target`, Y up (Z up if it looks straight up or down).
    pub fn look_at(eye: Vec3, target: Vec3, yfov: f32) -> PosedCamera {
        let mut forward = (target - eye).normalize_or_zero();
        if forward == Vec3::ZERO {
            forward = Vec3::NEG_Z;
        }
        let up = if forward.y.abs() > 0.999 { Vec3::NEG_Z } else { Vec3::Y };
        let right = forward.cross(up).normalize();
        let world_from_view = Mat3::from_cols(right, right.cross(forward), -forward);
        PosedCamera {
            world_from_view: Affine3A::from_mat3_translation(world_from_view, eye),
            projection: Projection::Perspective { yfov, near: 0.02 },
        }
    }

    /// Where the camera is.
    pub fn eye_world(&self) -> Vec3 {
        self.world_from_view.translation.into()
    }

    /// The view matrix.
    pub fn view_from_world(&self) -> Affine3A {
        self.world_from_view.inverse()
    }

    /// The projection matrix for a picture of the given aspect ratio (width / height): x right, y up, −1 … 1;
    /// depth z/w is 1 at the near plane and falls to 0 at infinity (perspective) or the far plane.
    pub fn clip_from_view(&self, aspect: f32) -> Mat4 {
        match self.projection {
            Projection::Perspective { yfov, near } => {
                // The cotangent; glam's angles are the same on every machine.
                let half = Vec2::from_angle(0.5 * yfov);
                let f = half.x / half.y;
                Mat4::from_cols(
                    Vec4::new(f / aspect, 0.0, 0.0, 0.0),
                    Vec4::new(0.0, f, 0.0, 0.0),
                    Vec4::new(0.0, 0.0, 0.0, -1.0),
                    Vec4::new(0.0, 0.0, near, 0.0),
                )
            }
            Projection::Orthographic { half_height, near, far } => {
                let half_width = half_height * aspect;
                let depth = far - near;
                Mat4::from_cols(
                    Vec4::new(1.0 / half_width, 0.0, 0.0, 0.0),
                    Vec4::new(0.0, 1.0 / half_height, 0.0, 0.0),
                    Vec4::new(0.0, 0.0, 1.0 / depth, 0.0),
                    Vec4::new(0.0, 0.0, far / depth, 1.0),
                )
            }
        }
    }
}
