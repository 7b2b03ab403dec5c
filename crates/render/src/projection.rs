//! The camera's matrices in double precision, with `libm`'s tangent so that they are equal on every machine.

use dapple_scene::{PosedCamera, Projection};
use glam::{Affine3A, DAffine3, DMat3, DMat4, DVec3, DVec4, Mat3};

use crate::RenderError;

/// The same map as [`PosedCamera::clip_from_view`], to the last bit of a double.
pub(crate) fn clip_from_view(projection: &Projection, aspect: f64) -> DMat4 {
    match *projection {
        Projection::Perspective { yfov, near } => {
            let f = 1.0 / libm::tan(0.5 * f64::from(yfov));
            perspective(f / aspect, f, f64::from(near))
        }
        Projection::Orthographic { half_height, near, far } => {
            let half_height = f64::from(half_height);
            orthographic(half_height * aspect, half_height, f64::from(near), f64::from(far))
        }
    }
}

/// Perspective with an infinite far plane; `fx`, `fy` are the cotangents of the half angles.
pub(crate) fn perspective(fx: f64, fy: f64, near: f64) -> DMat4 {
    DMat4::from_cols(
        DVec4::new(fx, 0.0, 0.0, 0.0),
        DVec4::new(0.0, fy, 0.0, 0.0),
        DVec4::new(0.0, 0.0, 0.0, -1.0),
        DVec4::new(0.0, 0.0, near, 0.0),
    )
}

/// Parallel projection of a box that is symmetric about the view axis.
pub(crate) fn orthographic(half_width: f64, half_height: f64, near: f64, far: f64) -> DMat4 {
    let depth = far - near;
    DMat4::from_cols(
        DVec4::new(1.0 / half_width, 0.0, 0.0, 0.0),
        DVec4::new(0.0, 1.0 / half_height, 0.0, 0.0),
        DVec4::new(0.0, 0.0, 1.0 / depth, 0.0),
        DVec4::new(0.0, 0.0, far / depth, 1.0),
    )
}

/// The same affine map in double precision.
pub(crate) fn widen(map: &Affine3A) -> DAffine3 {
    let linear: DMat3 = Mat3::from(map.matrix3).as_dmat3();
    let translation =
        DVec3::new(f64::from(map.translation.x), f64::from(map.translation.y), f64::from(map.translation.z));
    DAffine3::from_mat3_translation(linear, translation)
}

/// Clip space from world space for a picture of the given size, or why there is none.
pub(crate) fn clip_from_world(camera: &PosedCamera, width: u32, height: u32) -> Result<DMat4, RenderError> {
    let reason = match camera.projection {
        Projection::Perspective { yfov, near } => {
            if !(yfov > 0.0 && yfov < std::f32::consts::PI) {
                Some("the vertical field of view must lie between 0 and pi radians")
            } else if !(near > 0.0 && near.is_finite()) {
                Some("the near plane distance must be positive and finite")
            } else {
                None
            }
        }
        Projection::Orthographic { half_height, near, far } => {
            if !(half_height > 0.0 && half_height.is_finite()) {
                Some("half the height of the view must be positive and finite")
            } else if !(near.is_finite() && far.is_finite() && far > near) {
                Some("the far plane must lie behind the near plane, both finite")
            } else {
                None
            }
        }
    };
    if let Some(reason) = reason {
        return Err(RenderError::Camera { reason });
    }
    let aspect = f64::from(width) / f64::from(height);
    let world_from_view = widen(&camera.world_from_view);
    if !world_from_view.is_finite() || world_from_view.matrix3.determinant() == 0.0 {
        return Err(RenderError::Camera { reason: "its placement must be a finite, invertible transform" });
    }
    Ok(clip_from_view(&camera.projection, aspect) * DMat4::from(world_from_view.inverse()))
}

/// Distance along the view axis (metres) that belongs to a reverse-z depth; infinite for depth 0 of a perspective.
pub(crate) fn view_distance(projection: &Projection, depth: f32) -> f32 {
    match *projection {
        Projection::Perspective { near, .. } => near / depth,
        Projection::Orthographic { near, far, .. } => far - depth * (far - near),
    }
}
