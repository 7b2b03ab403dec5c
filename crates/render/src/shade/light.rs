//! Punctual lights ([KHR_lights_punctual]) and the sun of scenes that have none.

use dapple_scene::{Light, LightKind, Pose, PosedLight, Scene};
use glam::{Vec2, Vec3};

use super::ShadeParams;

/// A light in the world, ready to be evaluated.
pub(crate) struct ActiveLight {
    pub(crate) kind: LightKind,
    pub(crate) position_world: Vec3,
    /// Unit, from the light.
    pub(crate) direction_world: Vec3,
    pub(crate) throws_shadow: bool,
    /// Candela or lux, RGB.
    pub(crate) intensity: Vec3,
    pub(crate) range: Option<f32>,
    /// Scale and offset of the cosine that fades a spot light.
    pub(crate) cone: (f32, f32),
}

/// Light that arrives at a place.
pub(super) struct Arriving {
    /// Unit, towards the light.
    pub(super) to_light: Vec3,
    /// Irradiance on a surface that faces the light (lux per channel).
    pub(super) intensity: Vec3,
}

impl ActiveLight {
    fn new(light: &Light, posed: &PosedLight, throws_shadow: bool) -> ActiveLight {
        let cone = match light.kind {
            LightKind::Spot { inner_cone_angle, outer_cone_angle } => {
                let (inner, outer) = (cosine(inner_cone_angle), cosine(outer_cone_angle));
                let scale = 1.0 / (inner - outer).max(0.001);
                (scale, -outer * scale)
            }
            LightKind::Directional | LightKind::Point => (0.0, 1.0),
        };
        ActiveLight {
            kind: light.kind,
            position_world: posed.position_world,
            direction_world: posed.direction_world,
            throws_shadow,
            intensity: posed.color * posed.intensity,
            range: light.range,
            cone,
        }
    }

    pub(super) fn arriving(&self, position_world: Vec3) -> Arriving {
        if self.kind == LightKind::Directional {
            return Arriving { to_light: -self.direction_world, intensity: self.intensity };
        }
        let offset = self.position_world - position_world;
        let distance_squared = offset.length_squared();
        let to_light = offset.normalize_or_zero();
        if to_light == Vec3::ZERO {
            return Arriving { to_light, intensity: Vec3::ZERO };
        }
        // max(min(1 − (d / range)⁴, 1), 0) / d²
        let window = self.range.map_or(1.0, |range| {
            let ratio = distance_squared / (range * range);
            (1.0 - ratio * ratio).clamp(0.0, 1.0)
        });
        let fade = (self.direction_world.dot(-to_light) * self.cone.0 + self.cone.1).clamp(0.0, 1.0);
        Arriving { to_light, intensity: self.intensity * (window * fade * fade / distance_squared) }
    }
}

/// The cosine through `libm`, equal on every machine.
fn cosine(angle: f32) -> f32 {
    Vec2::from_angle(angle).x
}

/// The lights that shine, in the pose's order; the default sun and its fill if there are none.
pub(crate) fn active_lights(scene: &Scene, pose: &Pose, params: &ShadeParams) -> Vec<ActiveLight> {
    let placed = pose.lights.iter().filter_map(|p| Some((scene.lights.get(p.light as usize)?, p)));
    let lights: Vec<ActiveLight> = placed
        .enumerate()
        .map(|(i, (light, posed))| ActiveLight::new(light, posed, i < params.max_shadowed_lights as usize))
        .collect();
    if !lights.is_empty() || !params.sun_without_lights {
        return lights;
    }
    let directional = |direction: Vec3, intensity: f32, throws_shadow: bool| {
        let light = Light {
            name: String::new(),
            color: Vec3::ONE,
            intensity,
            range: None,
            kind: LightKind::Directional,
        };
        let direction_world = direction.normalize();
        let posed =
            PosedLight { light: 0, position_world: Vec3::ZERO, direction_world, color: Vec3::ONE, intensity };
        ActiveLight::new(&light, &posed, throws_shadow)
    };
    // Lux such that white faces reach a radiance of 0.7 and 0.05.
    vec![
        directional(Vec3::new(-0.45, -1.0, -0.6), 2.2, params.max_shadowed_lights > 0),
        directional(Vec3::new(0.5, 0.3, 0.8), 0.16, false),
    ]
}

/// Irradiance (lux per channel) that one placed light gives a surface with a unit normal, without shadows. Colour and intensity are
/// those of the pose.
///
/// For a point light of intensity *I* at height *h* over a plane and distance *x* aside it is *I h* / (*h*² + *x*²)^(3/2).
pub fn light_irradiance(light: &Light, posed: &PosedLight, position_world: Vec3, normal_world: Vec3) -> Vec3 {
    let arriving = ActiveLight::new(light, posed, false).arriving(position_world);
    arriving.intensity * normal_world.dot(arriving.to_light).max(0.0)
}
