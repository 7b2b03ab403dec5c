//! Area lights: everything in a posed scene that emits, and points chosen on it to be looked at from elsewhere.
//!
//! - takes: a [`Scene`], its [`Pose`], an [`Environment`] if there is one
//! - returns: [`LightSample`]s, each with the density of having been chosen, by area or by solid angle
//!
//! One sampler for every method that sends rays to lights, so that methods differ in what they do with the rays alone.
//! `README.md` has shapes, estimates and their sources.

mod choose;
mod environment;
mod figure;
mod shape;
#[cfg(test)]
mod tests;

use glam::Vec3;

pub use choose::{Chooser, Facing, Pick};
pub use environment::{Environment, EnvironmentError, MAX_RADIANCE, MAX_SIDE};
pub use figure::{LightFigure, LightForm, LightPlace, LightTriangle};
pub use shape::EmitterShape;

use crate::{Pose, Scene};
use shape::{Emission, Shape};

/// Triangles of a light beyond which it is refused ([`AreaLights::left_out`]): bounds the memory of a moment's lights.
pub const MAX_LIGHT_TRIANGLES: usize = 1 << 20;

/// All lights of a posed scene that have an area, in the order of their instances; the environment is the last.
///
/// Instances that emit are lights whether they are there or not, so that a light keeps its index over time.
pub struct AreaLights<'a> {
    scene: &'a Scene,
    lights: Vec<AreaLight>,
    environment: Option<(&'a Environment, Vec3, f32)>,
    /// Running sums of power, one a light.
    power: Vec<f32>,
    left_out: usize,
}

/// One light at one moment.
#[derive(Clone, Debug, PartialEq)]
struct AreaLight {
    instance: u32,
    shape: Shape,
    /// Mean over its area.
    radiance: Vec3,
    /// Luminance of that, not below 0.
    brightness: f32,
    /// Of its shape, m².
    area: f32,
    /// Shines from both sides of its surface.
    two_sided: bool,
}

/// What one looks at: a place on a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Index of the light, below [`AreaLights::len`].
    pub light: u32,
    /// Unit vector to it.
    pub to_light_world: Vec3,
    /// Metres; infinite for the environment.
    pub distance_m: f32,
    /// What arrives from there if nothing is between, W/(m² sr), RGB.
    pub radiance: Vec3,
    /// Probability density by solid angle, 1/sr, of the choice of the light and of the place on it; > 0.
    pub density_per_sr: f32,
    /// Unit normal of the light at that place, on the side that is seen; zero for the environment.
    pub normal_on_light_world: Vec3,
}

impl LightSample {
    /// A vector along which a shadow ray has to be free, in lengths of it: as far as the light, but for a little, so that the light
    /// does not shade itself.
    pub fn reach(&self) -> Vec3 {
        reach(self.to_light_world, self.distance_m)
    }
}

/// How long before a light rays end, or after it begin, in parts of the way.
pub const BEFORE_LIGHT: f32 = 1.0 / 2048.0;

/// A vector along which a ray has to be free that shall see a light so far away: [`LightSample::reach`].
pub fn reach(to_light_world: Vec3, distance_m: f32) -> Vec3 {
    const FAR_M: f32 = 1e6;
    to_light_world * (distance_m.min(FAR_M) * (1.0 - BEFORE_LIGHT))
}

/// Luminance of linear RGB with the primaries of sRGB (ITU-R BT.709).
pub fn luminance(color: Vec3) -> f32 {
    color.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

impl<'a> AreaLights<'a> {
    /// The lights of a scene in a pose.
    pub fn new(scene: &'a Scene, pose: &Pose) -> AreaLights<'a> {
        let mut left_out = 0;
        let mut lights = Vec::new();
        for (i, instance) in (0u32..).zip(&scene.instances) {
            let mesh = &scene.meshes[instance.mesh as usize];
            let emits = |part: &crate::Part| emitted(scene, part.material) != Vec3::ZERO;
            let triangles: usize =
                mesh.parts.iter().filter(|p| emits(p)).map(|p| p.triangle_count as usize).sum();
            if triangles == 0 {
                continue;
            }
            if triangles > MAX_LIGHT_TRIANGLES {
                left_out += 1;
                continue;
            }
            lights.push(AreaLight::of(scene, pose, i));
        }
        let mut this = AreaLights { scene, lights, environment: None, power: Vec::new(), left_out };
        this.sum_power();
        this
    }

    /// These, and light from all around. `pose` tells how large the scene is, hence how much of it the surroundings give.
    pub fn with_environment(mut self, environment: &'a Environment, pose: &Pose) -> AreaLights<'a> {
        let bounds = self.scene.bounds_world(pose);
        let radius_m = 0.5 * bounds.diagonal();
        self.environment = Some((environment, environment.mean_radiance(), radius_m));
        self.sum_power();
        self
    }

    fn sum_power(&mut self) {
        let mut sum = 0.0f32;
        self.power.clear();
        for light in 0..self.len() {
            sum += self.power_of(light);
            self.power.push(sum);
        }
    }

    /// How many there are, the environment included.
    pub fn len(&self) -> usize {
        self.lights.len() + usize::from(self.environment.is_some())
    }

    /// Whether nothing emits.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Emitting instances with too many triangles ([`MAX_LIGHT_TRIANGLES`]); they are seen but light nothing.
    pub fn left_out(&self) -> usize {
        self.left_out
    }

    /// The surroundings, if they shine.
    pub fn environment(&self) -> Option<&'a Environment> {
        self.environment.map(|(environment, ..)| environment)
    }

    /// Index into [`Scene::instances`] of a light; `None` for the environment.
    pub fn instance(&self, light: usize) -> Option<u32> {
        self.lights.get(light).map(|l| l.instance)
    }

    /// Radiant power of a light, W (luminance): π × area × radiance for surfaces, 4 π × π R² × radiance for surroundings of a scene of radius R.
    pub fn power_of(&self, light: usize) -> f32 {
        use std::f32::consts::PI;
        match self.lights.get(light) {
            Some(l) => PI * l.area * l.brightness * if l.two_sided { 2.0 } else { 1.0 },
            None => self
                .environment
                .map_or(0.0, |(_, mean, radius)| 4.0 * PI * PI * radius * radius * luminance(mean)),
        }
    }

    /// Centre and radius, metres, of a ball that holds the light; `None` for the environment and what is not there.
    pub fn bounds(&self, light: usize) -> Option<(Vec3, f32)> {
        self.lights.get(light).filter(|l| l.area > 0.0).map(|l| l.shape.ball())
    }

    /// Which lights differ from those of another moment of the same scene: moved, changed, came or went.
    pub fn changed_since(&self, before: &AreaLights<'_>) -> Vec<bool> {
        (0..self.len())
            .map(|i| match (self.lights.get(i), before.lights.get(i)) {
                (Some(now), Some(then)) => now != then,
                (None, None) => self.environment.is_some() != before.environment.is_some(),
                _ => true,
            })
            .collect()
    }

    /// Distance along a ray (unit direction) to the nearest light that shines towards its start, infinite for the environment; `None` if it
    /// meets none. Whether something stands before it is not asked.
    pub fn hit(&self, from_world: Vec3, direction_world: Vec3) -> Option<f32> {
        let surfaces = self.lights.iter().filter(|l| l.radiance != Vec3::ZERO);
        let nearest =
            surfaces.filter_map(|l| l.shape.hit(from_world, direction_world, l.two_sided)).reduce(f32::min);
        nearest.or_else(|| {
            let (environment, ..) = self.environment?;
            (environment.radiance(direction_world) != Vec3::ZERO).then_some(f32::INFINITY)
        })
    }

    /// A place on a light, seen from `position_world`; `None` if the chosen place cannot be seen from there whatever stands between
    /// (the light's back, or a side of it that is turned away): it counts as a sample without light.
    ///
    /// `u` in `[0, 1)³`: the first chooses the light (and of a light of triangles the triangle), the others the place.
    pub fn sample(&self, chooser: &Chooser, position_world: Vec3, u: [f32; 3]) -> Option<LightSample> {
        let (light, probability, rest) = chooser.choose(&self.power, u[0])?;
        let mut sample = self.sample_light(light, position_world, [rest, u[1], u[2]])?;
        sample.density_per_sr *= probability;
        Some(sample)
    }

    /// [`AreaLights::sample`] of one light; its density is that of the place alone.
    pub fn sample_light(&self, light: u32, position_world: Vec3, u: [f32; 3]) -> Option<LightSample> {
        let Some(l) = self.lights.get(light as usize) else {
            let (environment, ..) = self.environment.filter(|_| light as usize == self.lights.len())?;
            let (to_light_world, radiance, density_per_sr) = environment.sample([u[1], u[2]]);
            return (density_per_sr > 0.0).then_some(LightSample {
                light,
                to_light_world,
                distance_m: f32::INFINITY,
                radiance,
                density_per_sr,
                normal_on_light_world: Vec3::ZERO,
            });
        };
        let place = l.shape.sample(position_world, l.two_sided, u)?;
        let radiance = self.emitted_at(l, place.emission);
        Some(LightSample {
            light,
            to_light_world: place.direction,
            distance_m: place.distance,
            radiance,
            density_per_sr: place.density,
            normal_on_light_world: place.normal,
        })
    }

    /// A place on a light for receivers anywhere in a ball (centre and radius, metres), `u` as of [`AreaLights::sample`], the first the rest of the choice.
    /// All that any of them can see of the light has a density, so each may take it as a sample of its own: rays from it to all of them
    /// start in one point. Whether there is one goes by the first of `u` alone, so that receivers who then choose for themselves may move the others. `None` where they had better choose for themselves: of the environment, of a sphere that is near for the ball's size, where
    /// the ball lies on both sides of a light that shines from both.
    pub fn spot(&self, light: u32, (center, radius): (Vec3, f32), u: [f32; 3]) -> Option<LightSpot> {
        let l = self.lights.get(light as usize)?;
        let spot = l.shape.spot((center, radius), l.two_sided, u)?;
        Some(LightSpot {
            light,
            position_world: spot.position,
            normal_world: spot.normal,
            radiance: self.emitted_at(l, spot.emission),
            area_m2: spot.area,
        })
    }

    fn emitted_at(&self, light: &AreaLight, emission: Emission) -> Vec3 {
        match emission {
            Emission::Mean => light.radiance,
            Emission::Constant(radiance) => radiance,
            Emission::Textured(material, uv) => {
                crate::texture::emission(self.scene, &self.scene.materials[material as usize], &uv)
            }
        }
    }
}

/// A place on a light that several receivers share: [`AreaLights::spot`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSpot {
    /// Index of the light, below [`AreaLights::len`].
    pub light: u32,
    /// Metres.
    pub position_world: Vec3,
    /// Unit normal of the light there; of what shines from both sides, on that of the receivers.
    pub normal_world: Vec3,
    /// W/(m² sr), RGB.
    pub radiance: Vec3,
    /// One over the probability density of the place by area, m².
    pub area_m2: f32,
}

impl LightSpot {
    /// What a receiver sees of it; `None` from behind. The density is that of the place alone.
    #[inline]
    pub fn seen_from(&self, position_world: Vec3) -> Option<LightSample> {
        let (to_light_world, distance_m, density_per_sr, _) =
            shape::look(self.position_world, self.normal_world, self.area_m2, false, position_world)?;
        Some(LightSample {
            light: self.light,
            to_light_world,
            distance_m,
            radiance: self.radiance,
            density_per_sr,
            normal_on_light_world: self.normal_world,
        })
    }
}

/// The largest radiance that a material can emit.
fn emitted(scene: &Scene, material: u32) -> Vec3 {
    scene.materials.get(material as usize).filter(|m| !m.unlit).map_or(Vec3::ZERO, |m| m.emissive_factor)
}
