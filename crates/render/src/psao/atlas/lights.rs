//! Visibility of lights in the atlas: of each light a sum for each texel, by the weights of visibility.

use dapple_store::charts::WEIGHT_SUM;
use dapple_store::light_visibility::{LEAN_STEPS, Lean, LightChange, LightVisibility, OPEN, SeenLight};
use dapple_store::points::PointSet;
use rayon::prelude::*;

use super::light_texels::{LIGHTS_A_TEXEL, LightTexel, LightTexels, PLANES_WITH_LEANS};
use super::mix::Mix;
use super::resolve::PointTexels;
use super::{BuildError, DirtyBand, ReadySet, SetState, VisibilityAtlas};
use crate::gbuffer::Sample;

/// Sum of a texel from which all of a light is seen; fits 16 bits.
const OPEN_SUM: u16 = OPEN as u16 * WEIGHT_SUM;

/// Bytes that a texel takes for each light, and more for where it lies what is seen.
const BYTES_A_SUM: u64 = 2;
const BYTES_A_LEAN: u64 = 4;

/// Layers of planes of lights that every card has room for beside its own spare one.
const MAX_LIGHT_LAYERS: usize = 255;

/// Exact sums of weight × value, light by light, one a texel of a set; open where no point counts.
#[derive(Clone, Debug)]
pub(super) struct LightSums {
    texels: usize,
    sums: Vec<u16>,
    /// Of weight × value × steps of leans, which fits 16 bits too; as many, or none.
    leans: Vec<[i16; 2]>,
}

/// By how much a point's value changes, and its value × lean.
#[derive(Clone, Copy)]
struct Difference {
    value: i32,
    lean: [i32; 2],
}

impl Difference {
    fn of(value: u8, lean: Lean) -> Difference {
        Difference { value: value.into(), lean: lean.0.map(|step| i32::from(step) * i32::from(value)) }
    }
}

impl LightSums {
    fn new(
        texels: usize,
        table: &PointTexels,
        (set, lights): (&PointSet, &LightVisibility),
        with_leans: bool,
    ) -> LightSums {
        let mut open = vec![OPEN_SUM; texels];
        for point in 0..set.len() {
            table.for_each_run(point, |texel, weights| open[texel as usize..][..weights.len()].fill(0));
        }
        let count = texels * lights.lights() as usize;
        let leans = vec![[0; 2]; if with_leans { count } else { 0 }];
        let mut sums = LightSums { texels, sums: Vec::with_capacity(count), leans };
        for light in 0..lights.lights() {
            sums.sums.extend_from_slice(&open);
            let values = &lights.of_light(light)[set.first as usize..][..set.len()];
            let first = light as usize * lights.points() + set.first as usize;
            for (point, value) in values.iter().enumerate() {
                let difference = Difference::of(*value, lights.lean(first + point));
                sums.add(table, light, point, difference, |_, _| ());
            }
        }
        sums
    }

    /// Adds the change of a point's value; gives each texel and what it shows now to `shown`.
    fn add(
        &mut self,
        table: &PointTexels,
        light: u32,
        point: usize,
        difference: Difference,
        mut shown: impl FnMut(u32, LightTexel),
    ) {
        let start = light as usize * self.texels;
        let Some(sums) = self.sums.get_mut(start..) else { return };
        let mut leans = self.leans.get_mut(start..);
        table.for_each_run(point, |first, weights| {
            for ((texel, sum), weight) in (first..).zip(&mut sums[first as usize..]).zip(weights) {
                // The true sum fits; modulo 2¹⁶ the way there does not matter.
                let weight = i32::from(*weight) + 1;
                *sum = sum.wrapping_add((weight * difference.value) as u16);
                let mut shows = LightTexel { share: value_of(*sum), ..LightTexel::OPEN };
                if let Some(lean) = leans.as_mut().and_then(|leans| leans.get_mut(texel as usize)) {
                    for (lean, by) in lean.iter_mut().zip(difference.lean) {
                        *lean = lean.wrapping_add((weight * by) as i16);
                    }
                    shows.lean = lean.map(|lean| lean_of(lean, *sum));
                }
                shown(texel, shows);
            }
        });
    }

    /// What a texel sees of a light; `None` if there is no such light.
    fn at(&self, light: u32, texel: u32) -> Option<LightTexel> {
        let index = light as usize * self.texels + texel as usize;
        let sum = *self.sums.get(index)?;
        let lean = |lean: &[i16; 2]| lean.map(|lean| lean_of(lean, sum));
        let lean = self.leans.get(index).map_or(LightTexel::OPEN.lean, lean);
        Some(LightTexel { share: value_of(sum), lean })
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.sums[..]) + size_of_val(&self.leans[..])
    }
}

/// A sum as a texel shows it, 255 all of a light.
fn value_of(sum: u16) -> u8 {
    let open = u32::from(OPEN_SUM);
    ((u32::from(sum) * 255 + open / 2) / open) as u8
}

/// A sum of values × steps as a texel shows it whose values have that sum: the middle of what is seen from its points. 128 the middle of the light, 1 and 255 its
/// rim.
fn lean_of(sum: i16, values: u16) -> u8 {
    // No more than the rim while sums are on the way.
    let rim = i32::from(LEAN_STEPS) * i32::from(values).max(1);
    (128 + (2 * 127 * i32::from(sum) + rim).div_euclid(2 * rim).clamp(-127, 127)) as u8
}

/// What is seen of a light where these texels are mixed; `None` if there is no such light.
fn seen(mix: &Mix, lights: &LightSums, light: u32) -> Option<SeenLight> {
    let (mut share, mut lean) = (0.0, [0.0f32; 2]);
    for &(texel, weight) in mix.texels() {
        let shown = lights.at(light, texel)?;
        share += f32::from(shown.share) * weight;
        (0..2).for_each(|k| lean[k] += (f32::from(shown.lean[k]) - 128.0) * weight);
    }
    Some(SeenLight { fraction: (share / 255.0).clamp(0.0, 1.0), lean: lean.map(|lean| lean / 127.0) })
}

impl VisibilityAtlas {
    /// Takes in how much of each light all points see, of instances that are ready and have none yet; to be called again when others are.
    /// 2 bytes a texel and light, 6 with leans.
    ///
    /// # Errors
    /// All instances that are ready would take more than [`AtlasParams::max_light_bytes`](super::AtlasParams::max_light_bytes): nothing is taken in.
    ///
    /// # Panics
    /// If there are not as many points as in the layout.
    pub fn resolve_lights(&mut self, lights: &LightVisibility) -> Result<(), BuildError> {
        assert_eq!(lights.points(), self.layout.len(), "one value a point and light");
        let texels = |state: &SetState| match state {
            SetState::Ready(ready) => ready.sums.len() as u64,
            _ => 0,
        };
        let (texels, limit) = (self.sets.iter().map(texels).sum::<u64>(), self.params.max_light_bytes);
        let needed = |a_texel: u64| (texels * a_texel).saturating_mul(lights.lights().into());
        if needed(BYTES_A_SUM) > limit {
            let needed = needed(BYTES_A_SUM);
            return Err(BuildError::TooManyLights { lights: lights.lights(), needed, limit });
        }
        // Where there is no room for all, how much is seen is worth more than where.
        let with_leans = lights.has_leans() && needed(BYTES_A_SUM + BYTES_A_LEAN) <= limit;
        let sets = self.layout.sets();
        let taken_in = self.sets.par_iter_mut().zip(sets).map(|(state, set)| match state {
            SetState::Ready(ready) if ready.lights.is_none() => {
                let sums = LightSums::new(ready.sums.len(), &ready.table, (set, lights), with_leans);
                ready.lights = Some(sums);
                true
            }
            _ => false,
        });
        let taken_in: Vec<bool> = taken_in.collect();
        self.has_leans = with_leans;
        let shown = self.shown_lights().to_vec();
        if self.light_texels.as_ref().is_some_and(|texels| texels.has_leans() != self.show_leans(&shown)) {
            self.light_texels = None;
            self.show_lights(&shown);
        }
        if let Some(texels) = &mut self.light_texels {
            texels.grow(self.pages.texel_count());
            for (state, _) in self.sets.iter().zip(taken_in).filter(|(_, is_new)| *is_new) {
                show(texels, state);
            }
        }
        Ok(())
    }

    /// Drops what [`VisibilityAtlas::resolve_lights`] took in of all instances, so that it takes in other values: of another set of lights, or
    /// such as came without their changes.
    pub fn forget_lights(&mut self) {
        for state in &mut self.sets {
            if let SetState::Ready(ready) = state {
                ready.lights = None;
            }
        }
        if let Some(texels) = &mut self.light_texels {
            self.sets.iter().for_each(|state| show(texels, state));
        }
    }

    /// Keeps texels of these lights from now on, for a card; of none if there are none. Nothing happens if they are those that are kept.
    ///
    /// 4 bytes a texel of all layers and four lights, 12 with leans.
    pub fn show_lights(&mut self, lights: &[u32]) {
        if self.shown_lights() == lights {
            return;
        }
        self.light_texels = (!lights.is_empty()).then(|| {
            let mut texels = LightTexels::new(
                self.pages.side(),
                self.pages.texel_count(),
                lights,
                self.show_leans(lights),
            );
            self.sets.iter().for_each(|state| show(&mut texels, state));
            texels
        });
    }

    /// Whether there are leans to be shown of so many lights, and a card has layers for them.
    fn show_leans(&self, lights: &[u32]) -> bool {
        let layers = self.pages.texel_count() / (self.pages.side() as usize).pow(2).max(1);
        let planes = lights.len().div_ceil(LIGHTS_A_TEXEL) * PLANES_WITH_LEANS;
        self.has_leans && planes * layers <= MAX_LIGHT_LAYERS
    }

    /// The lights that texels are kept of.
    pub fn shown_lights(&self) -> &[u32] {
        self.light_texels.as_ref().map_or(&[], |texels| texels.lights())
    }

    /// Texels of the shown lights, four lights a group; of each group those of all layers of the atlas, one after the other, rows from the top.
    /// A texel of 255 sees all of its light. Layers that came since [`VisibilityAtlas::resolve_lights`] was called last are not among them.
    ///
    /// Where leans are held ([`VisibilityAtlas::shows_leans`]) a group has [`PLANES_WITH_LEANS`](super::PLANES_WITH_LEANS): after that one, two with two leans a texel,
    /// 128 the middle of a light, 1 and 255 its rim.
    pub fn light_texels(&self) -> &[Vec<[u8; LIGHTS_A_TEXEL]>] {
        self.light_texels.as_ref().map_or(&[], |texels| texels.planes())
    }

    /// Whether texels say where on lights it lies what is seen of them.
    pub fn shows_leans(&self) -> bool {
        self.light_texels.as_ref().is_some_and(LightTexels::has_leans)
    }

    /// Rows of which texels of any group changed since the last call, as [`VisibilityAtlas::take_dirty`] has those of visibility.
    pub fn take_dirty_lights(&mut self) -> Vec<DirtyBand> {
        self.light_texels.as_mut().map_or(Vec::new(), LightTexels::take_dirty)
    }

    /// Takes over changed values where values have been taken in; indices are those of the present layout. Exact, as changes of visibility
    /// are.
    pub fn apply_lights(&mut self, changes: &[LightChange]) {
        let points = self.layout.len() as u32;
        if points == 0 {
            return;
        }
        let sets = self.layout.sets();
        for LightChange { index, old, new, old_lean, new_lean } in changes {
            let (light, point) = (index / points, index % points);
            let at = sets.partition_point(|set| set.first + set.len() as u32 <= point);
            let Some(set) = sets.get(at) else { continue };
            let SetState::Ready(ready) = &mut self.sets[at] else { continue };
            let ReadySet { table, lights: Some(lights), placed, .. } = &mut **ready else { continue };
            let [old, new] = [Difference::of(*old, *old_lean), Difference::of(*new, *new_lean)];
            let lean = [0, 1].map(|k| new.lean[k] - old.lean[k]);
            let difference = Difference { value: new.value - old.value, lean };
            let local = (point - set.first) as usize;
            let shown = self.light_texels.as_mut().and_then(|texels| Some((texels.slot(light)?, texels)));
            match shown {
                Some((slot, texels)) => {
                    let mut walk = placed.walk();
                    lights.add(table, light, local, difference, |texel, value| {
                        texels.write(slot, walk.address(texel).0, value);
                    });
                }
                None => lights.add(table, light, local, difference, |_, _| ()),
            }
        }
    }

    /// How much of a light is seen from a place of a triangle, 0 … 1: a mean of what is seen from the points around it by the weights of
    /// [`VisibilityAtlas::visibility`]; `None` where nothing is known of it. What changed is there at once: only visibility fades.
    pub fn light_fraction(
        &self,
        instance: u32,
        triangle: u32,
        barycentrics: [f32; 2],
        back: bool,
        light: u32,
    ) -> Option<f32> {
        let ready = self.ready_set(instance)?;
        let seen = seen(&ready.mix(triangle, barycentrics, back)?, ready.lights.as_ref()?, light)?;
        Some(seen.fraction)
    }

    /// What a sample sees of each of some lights into `shown`, one for each of `lights`; all of it where nothing is known.
    ///
    /// # Panics
    /// If the lists differ in length.
    pub fn look_up_lights(&self, sample: &Sample, lights: &[u32], shown: &mut [SeenLight]) {
        assert_eq!(lights.len(), shown.len(), "one a light");
        shown.fill(SeenLight::ALL);
        let Some(ready) = self.ready_set(sample.instance).filter(|_| sample.is_covered()) else { return };
        let Some(sums) = &ready.lights else { return };
        let Some(mix) = ready.mix(sample.triangle, sample.barycentrics, sample.is_back_face()) else {
            return;
        };
        for (shown, light) in shown.iter_mut().zip(lights) {
            *shown = seen(&mix, sums, *light).unwrap_or(SeenLight::ALL);
        }
    }
}

/// Writes the texels of a set that is ready.
fn show(texels: &mut LightTexels, state: &SetState) {
    if let SetState::Ready(ready) = state {
        let count = ready.sums.len() as u32;
        texels.fill(&ready.charts, &ready.placed, count, |light, texel| {
            ready.lights.as_ref()?.at(light, texel)
        });
    }
}
