//! Punctual lights (`KHR_lights_punctual`).

use glam::Vec3;

/// A light in its node's space: it shines along −Z.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Name in the file, or a made-up one.
    pub name: String,
    /// Linear RGB.
    pub color: Vec3,
    /// Candela for point and spot, lux for directional.
    pub intensity: f32,
    /// Distance at which the light has faded out, metres; `None` is unlimited.
    pub range: Option<f32>,
    /// What kind.
    pub kind: LightKind,
}

/// The three kinds of punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Parallel light from infinitely far.
    Directional,
    /// Equal in all directions.
    Point,
    /// A cone; half angles in radians, `0 ≤ inner < outer ≤ π/2`.
    Spot {
        /// Full intensity inside.
        inner_cone_angle: f32,
        /// Dark outside.
        outer_cone_angle: f32,
    },
}

/// A light placed in the world at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedLight {
    /// Index into [`crate::Scene::lights`].
    pub light: u32,
    /// Where it is.
    pub position_world: Vec3,
    /// Unit direction it shines in (from the light).
    pub direction_world: Vec3,
    /// Linear RGB: the light's, unless it was edited.
    pub color: Vec3,
    /// Candela for point and spot, lux for directional: the light's, unless it was edited.
    pub intensity: f32,
}
