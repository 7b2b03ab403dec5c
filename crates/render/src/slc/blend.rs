//! One sample's light: of the entries about it, by the shapes of lights that they see and by cones of the rest.

use dapple_scene::ShadingPoint;
use dapple_store::cones::{ConeEntry, LightSet, MOST_MOMENT_CONES, PixelPlace, Reader, luminance};
use glam::Vec3;

use super::cap::{Cap, Ground, Lanes, Lens, Toward};
use super::table::{CapTable, TableCap};
use super::{Blending, Caps, Form, SlcShading};
use crate::area_lights::{Arrival, ROUGH_ALPHA, Spot, Surface};

/// Part of a light from which on its highlight is that of all of it: nothing is seen of what lacks.
pub(super) const WHOLE: f32 = 0.97;

/// Most entries that a sample reads.
const ENTRIES: usize = 4;

/// Most cones of those.
const PARTS: usize = ENTRIES * MOST_MOMENT_CONES;

/// Reads and shades, for one task.
pub(super) struct Blender<'a, E> {
    table: &'a CapTable<'a, E>,
    shading: &'a SlcShading,
    reader: Reader<'a, E>,
    lanes: Lanes,
    /// Parts of lights of the sample at hand; those of the one before are left in it.
    parts: [Seen; PARTS],
    /// All lights from the sample at hand, and those of one cone.
    toward: Vec<Toward>,
    of_cone: Vec<Toward>,
}

/// An entry that a sample reads.
#[derive(Clone, Copy)]
struct Read<'a> {
    caps: &'a [TableCap],
    ground: Ground,
    weight: f32,
}

/// What several entries see of one light, each by its weight.
#[derive(Clone, Copy, Default)]
struct Seen {
    slot: usize,
    fraction: f32,
    /// Weight of entries that tell, and the last that did.
    told: f32,
    teller: usize,
    /// Of cones: their fluence, and that × direction.
    fluence: f32,
    moment: Vec3,
}

impl<'a, E: ConeEntry + Caps> Blender<'a, E> {
    pub(super) fn new(table: &'a CapTable<'a, E>, shading: &'a SlcShading) -> Self {
        let reader = Reader::new(table.cache, shading.look_up);
        let parts = [Seen::default(); PARTS];
        Blender {
            table,
            shading,
            reader,
            lanes: Lanes::new(),
            parts,
            toward: Vec::new(),
            of_cone: Vec::new(),
        }
    }

    /// Radiance that a sample reflects towards the viewer.
    #[inline(always)]
    pub(super) fn reflect(&mut self, point: &ShadingPoint, pixel: &PixelPlace) -> Vec3 {
        let mut reads = [None; ENTRIES];
        let count = self.read(point, pixel, &mut reads);
        let mut lens = Lens::of(point, self.shading, &mut self.lanes);
        let parts = &mut self.parts;
        let mut used = 0;
        let mut mean = Vec3::ZERO;
        let mut heaviest: Option<(f32, Vec3, &Read<'_>)> = None;
        // All lights from here, if one of the cones asks for them.
        let (toward, of_cone, mut has_looked) = (&mut self.toward, &mut self.of_cone, false);
        toward.clear();
        let shows_several = is_smooth(point) && self.shading.form == Form::Ratio;
        let each_apart = self.shading.blending == Blending::Cones || count == 1 || is_smooth(point);
        let widest = widest_part(point);
        // The light whose shape stands for a cone, what is seen of it, and for how much of the cone: the rest is the cone's.
        let shape_of = |cone: &TableCap| {
            let slot = cone.slot()?;
            let share = match (cone.is_whole, 1.0 - cone.cap.cos_angle <= widest) {
                (true, true) => 1.0,
                (false, false) => 0.0,
                _ => 1.0 - cone.settled,
            };
            (share > 0.0).then_some((slot, share))
        };
        let rest_of = |cone: &TableCap| {
            let share = shape_of(cone).map_or(0.0, |(_, share)| share);
            (share < 1.0).then(|| Cap { energy: cone.cap.energy * (1.0 - share), ..cone.cap })
        };
        for (teller, read) in (1..).zip(reads[..count].iter().flatten()) {
            let mut irradiance = Vec3::ZERO;
            for cone in read.caps {
                if let Some((slot, share)) = shape_of(cone) {
                    let at = parts[..used].iter().position(|part| part.slot == slot).unwrap_or(used);
                    // A sample reads no more cones of lights than there are places.
                    let Some(part) = parts.get_mut(at) else { continue };
                    if at == used {
                        *part = Seen { slot, ..Seen::default() };
                        used += 1;
                    }
                    part.add(&cone.cap, cone.fraction, read.weight * share);
                    if part.teller != teller {
                        (part.teller, part.told) = (teller, part.told + read.weight * share);
                    }
                }
                let Some(cap) = rest_of(cone) else { continue };
                if shows_several && cone.several != LightSet::NONE && lens.needed(&cap) >= LEAST_DIRECTIONS {
                    if !has_looked {
                        has_looked = true;
                        toward.extend(self.table.spots.iter().filter_map(|spot| toward_of(spot, point)));
                    }
                    of_cone.clear();
                    of_cone.extend(toward.iter().filter_map(|light| of_cone_of(light, cone, &read.ground)));
                    level(of_cone, &cone.cap, read.ground.normal);
                    if !of_cone.is_empty() {
                        lens.add_toward(&cap, &read.ground, read.weight, of_cone);
                        continue;
                    }
                }
                if each_apart {
                    lens.add(&cap, &read.ground, read.weight);
                } else {
                    irradiance += cap.irradiance(point.normal_shading_world);
                }
            }
            let part = read.weight * luminance(irradiance);
            mean += irradiance * read.weight;
            if part > 0.0 && heaviest.is_none_or(|(most, ..)| part > most) {
                heaviest = Some((part, irradiance, read));
            }
        }
        let mut radiance = Vec3::ZERO;
        if let Some((_, irradiance, read)) = heaviest {
            for cap in read.caps.iter().filter_map(rest_of) {
                lens.add(&cap, &read.ground, 1.0);
            }
            // Not more than four times of what the heaviest of four has, in any colour.
            radiance = lens.radiance()
                * (mean / irradiance.max(Vec3::splat(f32::MIN_POSITIVE))).min(Vec3::splat(4.0));
        } else if each_apart {
            radiance = lens.radiance();
        }
        if used > 0
            && let Some(table) = self.table.lights
        {
            let surface = Surface::of(point);
            for part in &parts[..used] {
                let arrival = table.arrival(part.slot, point.position_world, point.normal_shading_world);
                let Some(arrival) = arrival else { continue };
                radiance += surface.reflect(&part.cone(&arrival)) * part.fraction;
            }
        }
        radiance
    }

    /// Entries about a sample whose weight counts, and how many.
    #[inline(always)]
    fn read(
        &mut self,
        point: &ShadingPoint,
        pixel: &PixelPlace,
        reads: &mut [Option<Read<'a>>; ENTRIES],
    ) -> usize {
        let found = self.reader.read(pixel);
        let texel_m = (pixel.footprint_m * self.shading.look_up.bias).max(f32::MIN_POSITIVE);
        let mut count = 0;
        let mut plain = [0.0; ENTRIES];
        let (mut total, mut plain_total) = (0.0, 0.0);
        for &(id, weight) in found.entries() {
            let Some((site, caps)) = self.table.get(id) else { continue };
            // Entries on other faces, or off the plane, see other light.
            let facing = fourth(point.normal_world.dot(site.normal_world).max(0.0));
            let leaning = fourth(point.normal_shading_world.dot(site.normal_shading_world).max(0.0));
            let off = point.normal_world.dot(site.position_world - point.position_world) / texel_m;
            let near = weight * (facing * facing) * leaning / (1.0 + off * off);
            let ground = Ground { normal: site.normal_world, normal_shading: site.normal_shading_world };
            reads[count] = Some(Read { caps, ground, weight: near });
            plain[count] = weight;
            total += near;
            plain_total += weight;
            count += 1;
        }
        let mut kept = 0;
        for i in 0..count {
            let Some(mut read) = reads[i] else { continue };
            // Where none is like the place, any is better than darkness.
            read.weight =
                if total > 1e-4 * plain_total { read.weight / total } else { plain[i] / plain_total };
            if read.weight > 1e-3 {
                reads[kept] = Some(read);
                kept += 1;
            }
        }
        kept
    }
}

impl Seen {
    fn add(&mut self, cap: &Cap, fraction: f32, weight: f32) {
        self.fraction += weight * fraction;
        // Entries that see little of the light tell little of where that lies.
        let fluence = weight * luminance(cap.energy) / cap.mean_cosine;
        self.fluence += fluence;
        self.moment += cap.direction * (fluence * 0.5 * (1.0 + cap.cos_angle));
    }

    /// The cone of what is seen of a light that would arrive like this, with the irradiance of all of it.
    fn cone(&self, arrival: &Arrival) -> Arrival {
        match self.moment.try_normalize() {
            Some(direction) if self.fraction < WHOLE * self.told => {
                let cos_angle = (2.0 * self.moment.length() / self.fluence - 1.0).clamp(-1.0, 1.0);
                Arrival { direction, cos_angle, ..*arrival }
            }
            _ => *arrival,
        }
    }
}

/// 1 − cos a of the widest cone of a part of a light that one cone for all entries about a sample stands for. On smooth surfaces it is seen of wide
/// ones that each entry sees another part, which several cones may be.
fn widest_part(point: &ShadingPoint) -> f32 {
    if !is_smooth(point) {
        return f32::INFINITY;
    }
    // As wide as the lobe, about.
    let chord = 1.2 * (0.04 + 0.6 * point.reflectance.alpha);
    0.5 * chord * chord
}

/// A light as seen from a place; none if it turns its back to it.
#[inline(always)]
fn toward_of(spot: &Spot, point: &ShadingPoint) -> Option<Toward> {
    let offset = spot.center_world - point.position_world;
    let distance2 = offset.length_squared().max(f32::MIN_POSITIVE);
    let direction = offset / distance2.sqrt();
    let facing = if spot.facing == Vec3::ZERO { 1.0 } else { -spot.facing.dot(direction) };
    let sine2 = (spot.radius_m * spot.radius_m / distance2).min(1.0);
    // Inside of its ball it is all around.
    let weight = spot.strength * facing / distance2.max(spot.radius_m * spot.radius_m);
    (weight > 0.0).then_some(Toward {
        light: spot.light,
        direction,
        weight,
        tint: spot.tint,
        depth: 1.0 - (1.0 - sine2).sqrt(),
    })
}

/// A light as far as a cone may be of it: among those of the cone, above the entry's horizon, and not far beside the cone.
#[inline(always)]
fn of_cone_of(light: &Toward, cone: &TableCap, ground: &Ground) -> Option<Toward> {
    if !cone.several.may_hold(light.light) || ground.normal.dot(light.direction) <= 0.0 {
        return None;
    }
    let far = (1.0 - cone.cap.direction.dot(light.direction)) / (1.0 - cone.cap.cos_angle).max(1e-6);
    let near = (1.0 - far / BESIDE).max(0.0);
    (near > 0.0).then_some(Toward { weight: light.weight * near * near, ..*light })
}

/// Weighs lights of a cone so that they are as high above the entry in the mean as its light is: what grazes a smooth surface outshines the rest.
#[inline(always)]
pub(super) fn level(lights: &mut [Toward], cap: &Cap, normal: Vec3) {
    let (mut all, mut mean, mut square) = (0.0, 0.0, 0.0);
    for light in &*lights {
        let height = normal.dot(light.direction);
        all += light.weight;
        mean += light.weight * height;
        square += light.weight * height * height;
    }
    let mean = mean / all.max(f32::MIN_POSITIVE);
    let spread = square / all.max(f32::MIN_POSITIVE) - mean * mean;
    let lacks = normal.dot(cap.direction) * 0.5 * (1.0 + cap.cos_angle) - mean;
    let slope = lacks / (spread + LEAST_HEIGHTS);
    for light in lights {
        let height = normal.dot(light.direction) - mean;
        light.weight *= (1.0 + slope * height).clamp(1.0 / MOST_LEVELLED, MOST_LEVELLED);
    }
}

/// Mean square of heights that says nothing of them.
const LEAST_HEIGHTS: f32 = 1e-4;
/// Most that a light counts more or less for its height.
const MOST_LEVELLED: f32 = 20.0;
/// Directions from which on a cone of several lights is wide enough to be shaded as these.
const LEAST_DIRECTIONS: u32 = 4;
/// How much larger than a cone of several lights that part of all directions is which any of them may lie in: three times as wide.
const BESIDE: f32 = 9.0;

/// Whether a surface shows where light comes from: one entry's cones cannot stand for another's.
#[inline(always)]
fn is_smooth(point: &ShadingPoint) -> bool {
    point.reflectance.specular && point.reflectance.alpha < ROUGH_ALPHA
}

#[inline(always)]
fn fourth(v: f32) -> f32 {
    let v2 = v * v;
    v2 * v2
}
