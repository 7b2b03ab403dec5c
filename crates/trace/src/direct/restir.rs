//! ReSTIR for direct light (\[Bitterli2020\]): choices among lights are handed on from frame to frame and from pixel to pixel.

use dapple_scene::ShadingPoint;
use dapple_scene::area_lights::{AreaLights, Pick};
use dapple_scene::glam::Vec3;

use super::reservoir::{Choice, Reservoir, Seen, Stream, resample};
use super::ris::{CHOICE, shaded};
use super::sequence::{Draws, Sequence, stream};
use super::{DirectCost, MAX_SAMPLES, Worker, is_open, origin, update, usable};
use crate::bvh::Tracer;
use crate::sampling::{hash, unit_interval};

/// In [`RestirView::previous_pixels`]: the pixel shows what was not in the previous picture.
pub const NO_PIXEL: u32 = u32::MAX;

/// Most neighbours of a pixel, and most passes over them.
const MAX_REUSE: u32 = 32;

/// Purposes of random numbers; those of passes over neighbours follow the last.
const TEMPORAL: u32 = CHOICE + 1;
const SPATIAL: u32 = CHOICE + 2;

/// How to reuse choices. Defaults are those of \[Bitterli2020\] but for the sampler, which is the best there is here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestirParams {
    /// New candidates a pixel and frame, 1 … [`MAX_SAMPLES`] (brought into that range), default 32.
    pub candidates: u32,
    /// How the lights of candidates are picked, default by fluence; \[Bitterli2020\]: by power.
    pub pick: Pick,
    /// How candidates spread, default on a lattice; \[Bitterli2020\]: at random.
    pub sequence: Sequence,
    /// Candidates that the past may count for at the most, in new ones; default 20. At 0 nothing is taken from previous frames.
    pub history: f32,
    /// Neighbours that each pass asks, 0 … 32; default 5, unbiased 3.
    pub neighbours: u32,
    /// Passes over neighbours, 0 … 32; default 2, unbiased 1.
    pub passes: u32,
    /// Radius of the disc that neighbours are chosen from, pixels of a picture 1080 high, default 30. It scales with the height, but is at least 2
    /// pixels.
    pub radius_px: f32,
    /// Cosine of the largest angle between the shading normals of pixels that share, default cos 25°.
    pub normal_cosine: f32,
    /// Largest difference of their distances from the eye, as part of the distance, default 0.1.
    pub depth_ratio: f32,
    /// Whether places that another pixel could not have chosen are weighed so that the mean is right, at a ray a source; default not, which
    /// darkens where visibility or normals change.
    pub unbiased: bool,
    /// Seed of all samples, default 0.
    pub seed: u64,
    /// Number of the frame, default 0; successive frames must differ in it.
    pub frame: u64,
}

impl Default for RestirParams {
    fn default() -> Self {
        RestirParams {
            candidates: 32,
            pick: Pick::Fluence,
            sequence: Sequence::Lattice,
            history: 20.0,
            neighbours: 5,
            passes: 2,
            radius_px: 30.0,
            normal_cosine: 0.906_307_8,
            depth_ratio: 0.1,
            unbiased: false,
            seed: 0,
            frame: 0,
        }
    }
}

impl RestirParams {
    /// The defaults of the unbiased variant.
    pub fn unbiased() -> RestirParams {
        RestirParams { neighbours: 3, passes: 1, unbiased: true, ..RestirParams::default() }
    }
}

/// A scene at one moment: for [`RestirView`] as it was in the previous frame.
#[derive(Clone, Copy)]
pub struct Past<'a> {
    /// What was in the way.
    pub tracer: &'a Tracer,
    /// What shone.
    pub lights: &'a AreaLights<'a>,
}

/// What one viewer sees.
#[derive(Clone, Copy)]
pub struct RestirView<'a> {
    /// Row by row.
    pub points: &'a [Option<ShadingPoint>],
    /// Pixels along a row, and rows.
    pub size: [usize; 2],
    /// Distances of points are from there.
    pub eye_world: Vec3,
    /// For each pixel, which pixel of the previous picture showed the same place, [`NO_PIXEL`] if none did. `None`: the same pixel.
    pub previous_pixels: Option<&'a [u32]>,
    /// For the unbiased variant where things move. Without it the present scene stands for the past one, which is right where nothing moved.
    pub past: Option<Past<'a>>,
}

/// What one viewer remembers between frames.
#[derive(Clone, Debug, Default)]
pub struct Restir {
    size: [usize; 2],
    held: Vec<Held>,
    points: Vec<Option<ShadingPoint>>,
}

/// A pixel's reservoir, and what is known of its choice there.
#[derive(Clone, Copy, Debug, Default)]
struct Held {
    reservoir: Reservoir,
    seen: Option<Seen>,
    /// Whether nothing stands between, once asked.
    open: Option<bool>,
}

impl Restir {
    /// One that remembers nothing.
    pub fn new() -> Restir {
        Restir::default()
    }

    /// Forgets the past: for cuts.
    pub fn clear(&mut self) {
        *self = Restir::default();
    }

    /// Writes the outgoing radiance of each point of a picture, in parallel in the caller's rayon pool; 0 where there is none. A picture of another
    /// size than the last begins anew.
    ///
    /// The result depends on the scene, the pictures since the beginning and `params` alone, not on the number of threads.
    ///
    /// # Panics
    ///
    /// If the points, the previous pixels or `out` are not as many as the size says.
    pub fn trace(
        &mut self,
        tracer: &Tracer,
        lights: &AreaLights<'_>,
        view: &RestirView<'_>,
        params: &RestirParams,
        out: &mut [Vec3],
    ) -> DirectCost {
        let count = view.points.len();
        assert_eq!(view.size[0].checked_mul(view.size[1]), Some(count), "a point for each pixel");
        assert_eq!(out.len(), count, "a radiance for each point");
        assert!(view.previous_pixels.is_none_or(|p| p.len() == count), "a previous pixel for each");
        if self.size != view.size {
            self.clear();
            self.size = view.size;
        }
        let pass = Pass { scene: Past { tracer, lights }, view, params };
        let mut held = vec![Held::default(); count];
        let mut cost = update(&mut held, params.pick, &|_| {}, |worker, i, held| {
            if let Some(point) = usable(view.points, i) {
                let new = pass.chosen_anew(worker, i, point);
                *held = pass.with_past(self, i, point, new, &mut worker.cost);
            }
        });
        for number in 0..params.passes.min(MAX_REUSE) {
            let before = held.clone();
            cost += update(&mut held, params.pick, &|_| {}, |worker, i, held| {
                if let Some(point) = usable(view.points, i) {
                    *held = pass.with_neighbours(&before, i, point, number, &mut worker.cost);
                }
            });
        }
        cost += update(&mut held, params.pick, &|_| {}, |worker, i, held| {
            if let (Some(point), Some(seen), None) = (usable(view.points, i), held.seen, held.open) {
                held.open = Some(is_open(tracer, origin(point), seen.reach, &mut worker.cost));
            }
        });
        for ((out, held), point) in out.iter_mut().zip(&held).zip(0..) {
            let lit = held.seen.filter(|_| held.open == Some(true));
            let reflected = lit.map_or(Vec3::ZERO, |s| shaded(s.value, held.reservoir.weight));
            *out = usable(view.points, point).map_or(Vec3::ZERO, |p| p.emitted + reflected);
        }
        self.held = held;
        self.points.clear();
        self.points.extend_from_slice(view.points);
        cost
    }
}

/// One frame of one viewer.
struct Pass<'a> {
    scene: Past<'a>,
    view: &'a RestirView<'a>,
    params: &'a RestirParams,
}

impl Pass<'_> {
    /// New candidates, one of them chosen; nothing of it is left if something stands between (reuse of visibility, \[Bitterli2020\] algorithm 5).
    fn chosen_anew(&self, worker: &mut Worker, pixel: usize, point: &ShadingPoint) -> Held {
        let params = self.params;
        let count = params.candidates.clamp(1, MAX_SAMPLES);
        let origin = origin(point);
        worker.chooser.aim(self.scene.lights, origin, point.normal_world);
        worker.cost.samples += u64::from(count);
        let draws = Draws::new(params.sequence, params.seed, pixel as u64, params.frame, count);
        let seed = stream(params.seed, pixel as u64, params.frame, CHOICE);
        let (reservoir, seen) =
            resample(self.scene.lights, &worker.chooser, point, origin, &draws, count, seed);
        let nothing = Reservoir { candidates: reservoir.candidates, ..Reservoir::default() };
        match seen {
            Some(s) if is_open(self.scene.tracer, origin, s.reach, &mut worker.cost) => {
                Held { reservoir, seen, open: Some(true) }
            }
            _ => Held { reservoir: nothing, seen: None, open: None },
        }
    }

    /// Combined with what the same place held in the previous frame.
    fn with_past(
        &self,
        before: &Restir,
        pixel: usize,
        point: &ShadingPoint,
        new: Held,
        cost: &mut DirectCost,
    ) -> Held {
        let most = self.params.history * new.reservoir.candidates;
        let previous = self.view.previous_pixels.map_or(pixel, |p| p[pixel] as usize);
        let (Some(held), Some(past_point)) = (before.held.get(previous), usable(&before.points, previous))
        else {
            return new;
        };
        if !(most > 0.0 && self.similar(point, past_point)) {
            return new;
        }
        let mut held = *held;
        held.reservoir.candidates = held.reservoir.candidates.min(most);
        let here = Source { held: &new, point, scene: self.scene };
        let there = Source { held: &held, point: past_point, scene: self.view.past.unwrap_or(self.scene) };
        let seed = stream(self.params.seed, pixel as u64, self.params.frame, TEMPORAL);
        combine(&[here, there], self.params.unbiased, seed, cost)
    }

    /// Combined with what some pixels nearby held before the pass.
    fn with_neighbours(
        &self,
        before: &[Held],
        pixel: usize,
        point: &ShadingPoint,
        number: u32,
        cost: &mut DirectCost,
    ) -> Held {
        let [width, height] = self.view.size;
        let radius = (self.params.radius_px * height as f32 / 1080.0).max(2.0);
        let seed = stream(self.params.seed, pixel as u64, self.params.frame, SPATIAL + number);
        let (x, y) = ((pixel % width) as f32, (pixel / width) as f32);
        let mut sources = vec![Source { held: &before[pixel], point, scene: self.scene }];
        for n in 0..self.params.neighbours.min(MAX_REUSE) {
            let [u, turns] = [1, 2].map(|d| unit_interval(hash(seed, u64::from(n), d)));
            let (sin, cos) = libm::sincosf(turns * std::f32::consts::TAU);
            let (x, y) = ((x + radius * u.sqrt() * cos).round(), (y + radius * u.sqrt() * sin).round());
            // Nothing if the radius is no number.
            if !(x >= 0.0 && y >= 0.0 && x < width as f32 && y < height as f32) {
                continue;
            }
            let other = y as usize * width + x as usize;
            if other != pixel
                && let Some(there) = usable(self.view.points, other)
                && self.similar(point, there)
            {
                sources.push(Source { held: &before[other], point: there, scene: self.scene });
            }
        }
        if sources.len() == 1 {
            return before[pixel];
        }
        combine(&sources, self.params.unbiased, seed, cost)
    }

    /// Whether two places may share: \[Bitterli2020\]'s tests.
    fn similar(&self, here: &ShadingPoint, there: &ShadingPoint) -> bool {
        let [d, e] = [here, there].map(|p| p.position_world.distance(self.view.eye_world));
        here.normal_shading_world.dot(there.normal_shading_world) >= self.params.normal_cosine
            && (d - e).abs() <= self.params.depth_ratio * d
    }
}

/// A pixel whose reservoir is combined with others.
struct Source<'a> {
    held: &'a Held,
    point: &'a ShadingPoint,
    scene: Past<'a>,
}

impl Source<'_> {
    /// What this pixel would make choices in proportion to: what arrives, if nothing stands between.
    fn target(&self, choice: &Choice, cost: &mut DirectCost) -> f64 {
        let origin = origin(self.point);
        cost.samples += 1;
        match choice.seen(self.scene.lights, self.point, origin) {
            Some(s) if is_open(self.scene.tracer, origin, s.reach, cost) => f64::from(s.target),
            _ => 0.0,
        }
    }
}

/// A reservoir for the first of the sources from those of all.
///
/// Biased it is \[Bitterli2020\] algorithm 4. Unbiased it is algorithm 6 with the weights of its sec. 4: of a place y that came from source s,
/// m = p̂ₛ(y) / Σ Mᵢ p̂ᵢ(y), where p̂ of a source that does not see y is 0.
fn combine(sources: &[Source<'_>], unbiased: bool, seed: u64, cost: &mut DirectCost) -> Held {
    let Some(target) = sources.first() else { return Held::default() };
    let at = origin(target.point);
    let candidates = sources.iter().map(|s| s.held.reservoir.candidates).sum::<f32>();
    let mut choices = Stream::new(seed);
    for (index, source) in sources.iter().enumerate() {
        let Reservoir { choice, weight, candidates } = source.held.reservoir;
        let Some(choice) = choice else { continue };
        // The pixel's own is as it was seen before.
        let seen = if index == 0 {
            source.held.seen
        } else {
            cost.samples += 1;
            choice.seen(target.scene.lights, target.point, at)
        };
        if let Some(seen) = seen {
            let weight = f64::from(seen.target) * f64::from(weight) * f64::from(candidates);
            choices.offer((index, choice, seen), weight);
        }
    }
    let nothing =
        Held { reservoir: Reservoir { candidates, ..Reservoir::default() }, seen: None, open: None };
    let Some((from, choice, seen)) = choices.chosen else { return nothing };
    let held = |share: f64, open: Option<bool>| {
        let weight = (choices.sum / f64::from(seen.target) * share) as f32;
        let reservoir = Reservoir { choice: Some(choice), weight, candidates };
        if weight.is_finite() { Held { reservoir, seen: Some(seen), open } } else { nothing }
    };
    let known = sources[from].held.open;
    if !unbiased {
        return held(1.0 / f64::from(candidates), known.filter(|_| from == 0));
    }
    let of_source = |index: usize, cost: &mut DirectCost| {
        let source = &sources[index];
        match (index == from, known) {
            (true, Some(false)) => 0.0,
            (true, Some(true)) => source.held.seen.map_or(0.0, |s| f64::from(s.target)),
            _ => source.target(&choice, cost),
        }
    };
    let own = of_source(from, cost);
    if own <= 0.0 {
        return nothing;
    }
    let (mut sum, mut open) = (0.0, false);
    for (index, source) in sources.iter().enumerate() {
        let value = if index == from { own } else { of_source(index, cost) };
        sum += f64::from(source.held.reservoir.candidates) * value;
        open |= index == 0 && value > 0.0;
    }
    held(own / sum, Some(open))
}
