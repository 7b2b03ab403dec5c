//! Reflects light of area lights by their shapes, with soft shadows from how much of each light points see.
//!
//! - takes: shading points ([`crate::shade::shading_points`]), an [`AreaLightTable`] of the moment, and for each point what is seen
//!   of each light ([`VisibilityAtlas::look_up_lights`](crate::psao::atlas::VisibilityAtlas::look_up_lights))
//! - returns: radiance that each point reflects of them; what surfaces emit themselves is [`crate::shade`]'s
//!
//! No ray is traced. Equations, parameters and failure cases in `README.md`.

mod arrival;
mod gloss;
#[cfg(feature = "gpu")]
pub(crate) mod table;
#[cfg(test)]
mod tests;

use std::f32::consts::FRAC_1_PI;

use dapple_scene::ShadingPoint;
use dapple_scene::area_lights::{AreaLights, LightFigure, LightForm, luminance};
use dapple_store::cones::LightSet;
use dapple_store::light_visibility::SeenLight;
use glam::Vec3;
use rayon::prelude::*;

pub use arrival::Arrival;
pub(crate) use gloss::{ROUGH_ALPHA, Surface};

/// Most lights that are shown.
pub const MAX_AREA_LIGHTS: usize = 64;

/// Most triangles of a light that is none of the simple forms and still told by them.
pub const MAX_TRIANGLES: usize = 16;

/// Most places that stand for a light of more triangles.
pub const MAX_PLACES: usize = 32;

/// Lights that are shown, and their forms at one moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AreaLightTable {
    /// Ascending.
    lights: Vec<u32>,
    /// A bit for each class ([`LightSet::class_of`]) of lights that are not shown: the environment, and those that there was no room for.
    hidden_classes: u32,
    entries: Vec<Option<Entry>>,
}

/// One light that shines.
#[derive(Clone, Debug, PartialEq)]
struct Entry {
    figure: LightFigure,
    /// Of a ball that holds it.
    center: Vec3,
    radius: f32,
}

impl Entry {
    /// Radius² of the disc that is as large as the light looks: from its front if it is flat with one side that shines, else from anywhere in the
    /// mean, where half of both sides and a fourth of a body's surface show. A ball about a long light is much larger.
    fn disc_m2(&self) -> f32 {
        let sides = if self.figure.two_sided { 2.0 } else { 1.0 };
        match &self.figure.form {
            LightForm::Sphere { radius, .. } => radius * radius,
            LightForm::Disc { radius, .. } => radius * radius / sides,
            LightForm::Quad { corners: [a, b, c, d], .. } => {
                (area(&[*a, *b, *c]) + area(&[*a, *c, *d])) * FRAC_1_PI / sides
            }
            LightForm::Triangles(triangles) => {
                triangles.iter().map(|triangle| area(&triangle.corners)).sum::<f32>()
                    * (0.25 * FRAC_1_PI * sides)
            }
            LightForm::Places(places) => {
                places.iter().map(|place| place.area_m2).sum::<f32>() * (0.25 * FRAC_1_PI * sides)
            }
        }
    }
}

/// Of a triangle, m².
fn area([a, b, c]: &[Vec3; 3]) -> f32 {
    0.5 * (*b - *a).cross(*c - *a).length()
}

/// Least of a channel of a light's colour.
const LEAST_TINT: f32 = 0.02;

/// A light as a point: see [`AreaLightTable::spots`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot {
    pub(crate) light: u32,
    pub(crate) center_world: Vec3,
    pub(crate) radius_m: f32,
    /// Luminance of its radiance × [`Entry::disc_m2`].
    pub(crate) strength: f32,
    /// Its colour, of luminance 1, with a little of every channel.
    pub(crate) tint: Vec3,
    /// Unit normal of the only side that shines; zero if all do.
    pub(crate) facing: Vec3,
}

impl AreaLightTable {
    /// The lights of a moment, without the environment: up to [`MAX_AREA_LIGHTS`] all of them, so that each keeps its place while it is dark
    /// or gone; of more the most powerful ones, of equals the first.
    pub fn new(lights: &AreaLights<'_>) -> AreaLightTable {
        let surfaces = lights.len() - usize::from(lights.environment().is_some());
        let mut shown: Vec<usize> = (0..surfaces).collect();
        if surfaces > MAX_AREA_LIGHTS {
            shown.sort_by(|a, b| lights.power_of(*b).total_cmp(&lights.power_of(*a)).then(a.cmp(b)));
            shown.truncate(MAX_AREA_LIGHTS);
            shown.sort_unstable();
        }
        let entry = |light: &usize| {
            let figure = lights.figure(*light, MAX_TRIANGLES, MAX_PLACES)?;
            let (center, radius) = figure.form.ball();
            (center.is_finite() && radius.is_finite()).then_some(Entry { figure, center, radius })
        };
        AreaLightTable {
            hidden_classes: (0..lights.len())
                .filter(|light| shown.binary_search(light).is_err())
                .fold(0, |classes, light| classes | 1 << LightSet::class_of(light as u32)),
            entries: shown.iter().map(entry).collect(),
            lights: shown.iter().map(|light| *light as u32).collect(),
        }
    }

    /// The lights that are shown, by their index in [`AreaLights`], ascending.
    pub fn lights(&self) -> &[u32] {
        &self.lights
    }

    /// Where a light is in [`AreaLightTable::lights`], if it is shown by its very form: not one that a few places stand for.
    pub fn slot_of_form(&self, light: u32) -> Option<usize> {
        // Mostly all lights are shown.
        let slot = match self.lights.get(light as usize) {
            Some(&same) if same == light => light as usize,
            _ => self.lights.binary_search(&light).ok()?,
        };
        let is_form = |entry: &Entry| !matches!(entry.figure.form, LightForm::Places(_));
        self.entries[slot].as_ref().is_some_and(is_form).then_some(slot)
    }

    /// Whether a set of several lights may hold one that is not shown.
    pub(crate) fn may_lack(&self, several: LightSet) -> bool {
        several.bits() & self.hidden_classes != 0
    }

    /// A bit for each class of lights that are not shown.
    pub(crate) fn hidden_classes(&self) -> u32 {
        self.hidden_classes
    }

    /// What of each light that shines tells where it is and how bright, for places that it is far from.
    pub(crate) fn spots(&self) -> impl Iterator<Item = Spot> {
        let spot = |(light, entry): (&u32, &Option<Entry>)| {
            let entry = entry.as_ref()?;
            let Entry { figure, center, radius } = entry;
            let facing = match &figure.form {
                LightForm::Disc { normal, .. } | LightForm::Quad { normal, .. } if !figure.two_sided => {
                    *normal
                }
                _ => Vec3::ZERO,
            };
            let brightness = luminance(figure.radiance);
            let (strength, tint) = (brightness * entry.disc_m2(), figure.radiance / brightness);
            // Of a channel that none of some lights has, what is told to be theirs is not lost.
            let tint = tint.max(Vec3::splat(LEAST_TINT));
            (strength > 0.0 && strength.is_finite() && tint.is_finite()).then_some(Spot {
                light: *light,
                center_world: *center,
                radius_m: *radius,
                strength,
                tint,
                facing,
            })
        };
        self.lights.iter().zip(&self.entries).filter_map(spot)
    }

    /// Whether no light shines.
    pub fn is_dark(&self) -> bool {
        self.entries.iter().all(Option::is_none)
    }

    /// What arrives of the light at a place of [`AreaLightTable::lights`] on a surface with that unit normal, with nothing in the way;
    /// `None` if nothing does.
    pub fn arrival(&self, slot: usize, position_world: Vec3, normal_world: Vec3) -> Option<Arrival> {
        let entry = self.entries.get(slot)?.as_ref()?;
        // A ball below the horizon.
        if normal_world.dot(entry.center - position_world) <= -entry.radius {
            return None;
        }
        arrival::arrive(&entry.figure, (entry.center, entry.radius), position_world, normal_world)
    }
}

/// Radiance that points reflect of area lights; 0 where there is no point. `look_up` is asked for what is seen of each of
/// [`AreaLightTable::lights`] at the point of an index. In parallel in the caller's rayon pool.
///
/// What points emit is not in it: a picture has that already ([`crate::shade::shade`]).
pub fn shade_area_lights(
    points: &[Option<ShadingPoint>],
    table: &AreaLightTable,
    look_up: impl Fn(usize, &mut [SeenLight]) + Sync,
) -> Vec<Vec3> {
    if table.is_dark() {
        return vec![Vec3::ZERO; points.len()];
    }
    let row = || vec![SeenLight::ALL; table.lights.len()];
    let reflect = |row: &mut Vec<SeenLight>, (i, point): (usize, &Option<ShadingPoint>)| match point {
        Some(point) => {
            look_up(i, row);
            reflect_one(point, table, row)
        }
        None => Vec3::ZERO,
    };
    points.par_iter().enumerate().with_min_len(256).map_init(row, reflect).collect()
}

fn reflect_one(point: &ShadingPoint, table: &AreaLightTable, seen: &[SeenLight]) -> Vec3 {
    let r = &point.reflectance;
    if r.diffuse == Vec3::ZERO && (r.f0 == Vec3::ZERO || !r.specular) {
        return Vec3::ZERO;
    }
    let surface = Surface::of(point);
    let mut sum = Vec3::ZERO;
    for (slot, seen) in seen.iter().enumerate() {
        if seen.fraction <= 0.0 {
            continue;
        }
        let arrival = table.arrival(slot, point.position_world, point.normal_shading_world);
        let Some(arrival) = arrival else { continue };
        sum += surface.reflect(&surface.seen(&arrival, seen)) * seen.fraction;
    }
    sum
}
