//! Rust mirrors of the structures in the shaders. A test compares every offset.

use bytemuck::{Pod, Zeroable};
use dapple_scene::{PosedCamera, Projection};
use glam::{Affine3A, Mat3, Vec3};

/// `Screen` in `screen.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct ScreenUniform {
    pub(super) view_from_world_x: [f32; 4],
    pub(super) view_from_world_y: [f32; 4],
    pub(super) view_from_world_z: [f32; 4],
    pub(super) half_extent: [f32; 2],
    pub(super) size: [u32; 2],
    pub(super) span: [f32; 2],
    pub(super) is_parallel: u32,
    pub(super) is_half: u32,
    pub(super) depth: [f32; 2],
    pub(super) samples_per_metre: f32,
    pub(super) pad: f32,
}

impl ScreenUniform {
    /// Of a camera's picture with so many columns and rows.
    pub(super) fn new(camera: &PosedCamera, size: (u32, u32)) -> ScreenUniform {
        let (half_height, is_parallel, depth) = match camera.projection {
            Projection::Perspective { yfov, near } => (libm::tan(0.5 * f64::from(yfov)), false, [near, 0.0]),
            Projection::Orthographic { half_height, near, far } => {
                (f64::from(half_height), true, [far, far - near])
            }
        };
        let aspect = f64::from(size.0) / f64::from(size.1);
        let [x, y, z] =
            Mat3::from(camera.world_from_view.matrix3).to_cols_array_2d().map(|[x, y, z]| [x, y, z, 0.0]);
        ScreenUniform {
            view_from_world_x: x,
            view_from_world_y: y,
            view_from_world_z: z,
            half_extent: [(half_height * aspect) as f32, half_height as f32],
            size: [size.0, size.1],
            span: [size.0 as f32, size.1 as f32],
            is_parallel: u32::from(is_parallel),
            is_half: 0,
            depth,
            samples_per_metre: 0.5 * size.1 as f32 / half_height as f32,
            pad: 0.0,
        }
    }

    /// Of the same picture at half the resolution.
    pub(super) fn half(self) -> ScreenUniform {
        ScreenUniform {
            size: self.size.map(|side| side.div_ceil(2)),
            span: self.span.map(|side| 0.5 * side),
            is_half: 1,
            samples_per_metre: 0.5 * self.samples_per_metre,
            ..self
        }
    }
}

/// `SideParams` in `beside.wgsl`: the first camera's picture, and rows of the map from its view space to the second one's.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct SideUniform {
    pub(super) main: ScreenUniform,
    pub(super) side_from_main_x: [f32; 4],
    pub(super) side_from_main_y: [f32; 4],
    pub(super) side_from_main_z: [f32; 4],
}

impl SideUniform {
    pub(super) fn new(main: ScreenUniform, side_from_main: &Affine3A) -> SideUniform {
        let rows = side_from_main.matrix3.transpose();
        let [x, y, z] = [rows.x_axis, rows.y_axis, rows.z_axis].map(Vec3::from);
        let t = side_from_main.translation;
        let [x, y, z] = [x.extend(t.x), y.extend(t.y), z.extend(t.z)].map(|row| row.to_array());
        SideUniform { main, side_from_main_x: x, side_from_main_y: y, side_from_main_z: z }
    }
}

/// `BilateralParams` in `bilateral.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct BilateralUniform {
    pub(super) axis: [i32; 2],
    pub(super) taps: u32,
    pub(super) stride: u32,
    pub(super) tolerance_m: f32,
    pub(super) inverse_sigma: f32,
    pub(super) pad: [f32; 2],
}

/// `ObscuranceParams` in `obscurance.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct ObscuranceUniform {
    pub(super) radius_m: f32,
    pub(super) sigma_m: f32,
    pub(super) bias_m: f32,
    pub(super) beta: f32,
    pub(super) exponent: f32,
    pub(super) samples: u32,
    pub(super) turns: u32,
    pub(super) switch_log2: u32,
    pub(super) top_level: u32,
    pub(super) farthest_m: f32,
    pub(super) pad: [f32; 2],
}

/// `MinifyParams` in `minify.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct MinifyUniform {
    pub(super) size: [u32; 2],
    pub(super) filtering: u32,
    pub(super) pad: u32,
}

/// `ReconstructParams` in `reconstruct.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct ReconstructUniform {
    pub(super) axis: [i32; 2],
    pub(super) taps: u32,
    pub(super) stride: u32,
    pub(super) sharpness: f32,
    pub(super) pad_a: f32,
    pub(super) pad_b: [f32; 2],
}

/// `HbaoParams` in `hbao.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct HbaoUniform {
    pub(super) radius_m: f32,
    pub(super) directions: u32,
    pub(super) steps: u32,
    pub(super) bias: f32,
    pub(super) strength: f32,
    pub(super) is_mean: u32,
    pub(super) hidden_layers: u32,
    pub(super) looks: u32,
    pub(super) compensation: f32,
    pub(super) pad_a: f32,
    pub(super) pad_b: [f32; 2],
}

/// `GtaoParams` in `gtao.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct GtaoUniform {
    pub(super) radius_m: f32,
    pub(super) slices: u32,
    pub(super) steps: u32,
    pub(super) thickness_m: f32,
    pub(super) bias: f32,
    pub(super) pad_a: f32,
    pub(super) pad_b: [f32; 2],
}

/// `SsaoParams` in `ssao.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct SsaoUniform {
    pub(super) radius_m: f32,
    pub(super) samples: u32,
    pub(super) height_m: f32,
    pub(super) hidden_layers: u32,
    pub(super) compensation: f32,
    pub(super) pad_a: f32,
    pub(super) pad_b: [f32; 2],
    pub(super) offsets: [[f32; 4]; 256],
    pub(super) turns: [[f32; 4]; 128],
}

/// `BlurParams` in `blur.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct BlurUniform {
    pub(super) axis: [i32; 2],
    pub(super) half_width: u32,
    pub(super) inverse_sigma: f32,
    pub(super) middle: f32,
    pub(super) pad_a: f32,
    pub(super) pad_b: [f32; 2],
}

/// `ResolveParams` in `resolve.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct ResolveUniform {
    pub(super) full_size: [i32; 2],
    pub(super) is_half: u32,
    pub(super) pad: u32,
}

/// `PlaceParams` in `place.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct PlaceUniform {
    pub(super) guard: [i32; 2],
    pub(super) is_half: u32,
    pub(super) pad: f32,
}

/// `HalveParams` in `halve.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct HalveUniform {
    pub(super) full_size: [i32; 2],
    pub(super) pad: [f32; 2],
}
