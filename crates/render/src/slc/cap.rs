//! Light of cones, reflected: a fixed pattern of directions in each, and glTF's reflectance in lanes, of several cones at once.

use std::f32::consts::FRAC_1_PI;

use dapple_scene::ShadingPoint;
use dapple_store::cones::GRAZING_COSINE;
use dapple_store::points::orthonormal_basis;
use glam::Vec3;

use super::SlcShading;
use crate::cap_pattern::{EIGHT, FOUR, ONE, Pattern, SIXTEEN, SIXTY_FOUR};

/// A cone: light that comes, evenly, from all directions of a cap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cap {
    /// Unit axis, world.
    pub direction: Vec3,
    /// Cosine of the angle between axis and rim, −1 … 1.
    pub cos_angle: f32,
    /// What arrives through it, W/m².
    pub energy: Vec3,
    /// Energy ÷ fluence, above 0 and up to 1: with irradiance, the mean cosine of the light at the entry.
    pub mean_cosine: f32,
}

impl Cap {
    /// Irradiance on a surface with this unit normal, W/m², as if the cone did not cross the horizon: by the mean of its directions, which is
    /// (1 + cos a) / 2 long.
    pub(super) fn irradiance(&self, normal_world: Vec3) -> Vec3 {
        let cosine = normal_world.dot(self.direction).max(0.0) * 0.5 * (1.0 + self.cos_angle);
        self.energy * (cosine / self.mean_cosine)
    }
}

/// What an entry's energies are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// Irradiance E on the entry's surface with mean cosine c: L = Σ E · (Σ f cos / Σ cos' of what is diffuse, Σ f cos / n' c of gloss), n' of the
    /// directions above the entry's horizon.
    /// Diffuse light is exact for any shape of cone; gloss of grazing light is not lost among light from above.
    #[default]
    Ratio,
    /// Fluence: L = Σ Φ · Σ f cos / n ([Stadlbauer2023] sec. 3.2).
    Fluence,
}

/// Directions that a cone is shaded with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Samples {
    /// 1, 4, 8 or 16: the wider the cone and the smoother the surface, the more.
    #[default]
    Adaptive,
    /// Always so many: the largest of 1, 4, 8, 16 and 64 that is no more than this.
    Fixed(u32),
}

/// Directions that are shaded together. A cone of 64 fills them.
const LANES: usize = 64;
/// Lanes of a step: what the compiler makes vectors of.
const STEP: usize = 8;
/// Cones that wait to be shaded together.
const WAITING: usize = LANES;

/// A cone whose directions lie in the lanes.
#[derive(Clone, Copy, Default)]
struct Waiting {
    /// What each direction brings, times what of it is reflected, is radiance.
    energy: Vec3,
    /// Of that, times this, for gloss.
    gloss: f32,
    first: usize,
    count: usize,
}

/// Where cones of one surface after the other are shaded: made once a task, for clearing it would take as long as what is done in it.
pub(super) struct Lanes {
    x: [f32; LANES],
    y: [f32; LANES],
    z: [f32; LANES],
    diffuse: [f32; LANES],
    gloss: [f32; LANES],
    grazing: [f32; LANES],
    /// Squared roughness of the lobe that stands for the part of a cone about a direction.
    a2: [f32; LANES],
    waiting: [Waiting; WAITING],
}

impl Lanes {
    pub(super) fn new() -> Lanes {
        let empty = [0.0; LANES];
        Lanes {
            x: empty,
            y: empty,
            z: empty,
            diffuse: empty,
            gloss: empty,
            grazing: empty,
            a2: empty,
            waiting: [Waiting::default(); WAITING],
        }
    }
}

/// A light of a cone of several, from where it is shaded.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Toward {
    pub(super) light: u32,
    /// Unit vector to its centre, world.
    pub(super) direction: Vec3,
    /// How much it brings beside others, of any unit.
    pub(super) weight: f32,
    /// Its colour, of luminance 1, with a little of every channel.
    pub(super) tint: Vec3,
    /// 1 − the cosine of the angle that it is seen under, from its middle to its rim.
    pub(super) depth: f32,
}

/// A surface about to be shaded, with cones that wait for it: directions of many cones are worked on at once, as most cones have one alone.
pub(super) struct Lens<'a> {
    point: &'a ShadingPoint,
    n_dot_v: f32,
    n_dot_v_signed: f32,
    a2: f32,
    lambda_v: f32,
    /// 2 (1 − cos a) of cones from which on 4, 8 and 16 directions are needed.
    widths: [f32; 3],
    form: Form,
    samples: Samples,
    lanes: &'a mut Lanes,
    used: usize,
    count: usize,
    radiance: Vec3,
}

/// Normals that an entry's cones stand over.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ground {
    pub(super) normal: Vec3,
    pub(super) normal_shading: Vec3,
}

impl<'a> Lens<'a> {
    #[inline(always)]
    pub(super) fn of(point: &'a ShadingPoint, shading: &SlcShading, lanes: &'a mut Lanes) -> Lens<'a> {
        let n_dot_v_signed = point.normal_shading_world.dot(point.to_viewer_world);
        let n_dot_v = n_dot_v_signed.clamp(1e-3, 1.0);
        let a2 = point.reflectance.alpha * point.reflectance.alpha;
        // By the chord of the cone's angle, about the angle itself; perceptual roughness squared is alpha.
        let lobe = 0.04 + 0.6 * point.reflectance.alpha;
        Lens {
            point,
            n_dot_v,
            n_dot_v_signed,
            a2,
            lambda_v: (n_dot_v * n_dot_v * (1.0 - a2) + a2).sqrt(),
            widths: [0.25, 0.6, 1.2].map(|part| (part * lobe) * (part * lobe)),
            form: shading.form,
            samples: shading.samples,
            lanes,
            used: 0,
            count: 0,
            radiance: Vec3::ZERO,
        }
    }

    /// Adds a cone of an entry, of whose light this part counts.
    #[inline(always)]
    pub(super) fn add(&mut self, cap: &Cap, ground: &Ground, part: f32) {
        let needed = self.needed(cap);
        if self.used + (needed as usize).min(LANES) > LANES || self.count == WAITING {
            self.flush();
        }
        match needed {
            0..4 => self.spread(cap, ground, part, &*ONE),
            4..8 => self.spread(cap, ground, part, &*FOUR),
            8..16 => self.spread(cap, ground, part, &*EIGHT),
            16..64 => self.spread(cap, ground, part, &*SIXTEEN),
            64.. => self.spread(cap, ground, part, &*SIXTY_FOUR),
        }
    }

    /// Radiance that the light of all cones leaves towards the viewer.
    #[inline(always)]
    pub(super) fn radiance(mut self) -> Vec3 {
        self.flush();
        self.radiance
    }

    /// Directions that a cone needs on this surface.
    #[inline(always)]
    pub(super) fn needed(&self, cap: &Cap) -> u32 {
        match self.samples {
            Samples::Fixed(n) => n,
            Samples::Adaptive => {
                let width = 2.0 * (1.0 - cap.cos_angle);
                [1, 4, 8, 16][self.widths.iter().filter(|least| width >= **least).count()]
            }
        }
    }

    /// Puts a cone's directions into the lanes.
    #[allow(clippy::needless_range_loop)] // several lists of lanes at once
    #[inline(always)]
    fn spread<const N: usize>(&mut self, cap: &Cap, ground: &Ground, part: f32, pattern: &Pattern<N>) {
        let (first, axis) = (self.used, cap.direction);
        let lanes = first..first + N;
        let Lanes { x, y, z, a2, .. } = &mut *self.lanes;
        // Each direction shows the part of the cone about it, 1 − cos s = (1 − cos a) / N, half of which half vectors turn by: as much variance as s² / 8.
        // The paper's show themselves alone.
        let wider = match self.form {
            Form::Ratio => 0.25 * (1.0 - cap.cos_angle) / N as f32,
            Form::Fluence => 0.0,
        };
        a2[lanes.clone()].fill(self.a2 + wider);
        let (x, y, z) = (&mut x[lanes.clone()], &mut y[lanes.clone()], &mut z[lanes]);
        if N == 1 {
            (x[0], y[0], z[0]) = (axis.x, axis.y, axis.z);
        } else {
            let (tangent, bitangent) = orthonormal_basis(axis);
            let depth = 1.0 - cap.cos_angle;
            // Lobes of the paper's form are not made wider, and rings lie in their middle.
            let out = if self.form == Form::Fluence { 0.25 / N as f32 } else { 0.0 };
            for i in 0..N {
                let below = depth * (pattern.height[i] + out);
                let (up, radius) = (1.0 - below, (below * (2.0 - below)).max(0.0).sqrt());
                let (along, across) = (radius * pattern.cos[i], radius * pattern.sin[i]);
                x[i] = axis.x * up + tangent.x * along + bitangent.x * across;
                y[i] = axis.y * up + tangent.y * along + bitangent.y * across;
                z[i] = axis.z * up + tangent.z * along + bitangent.z * across;
            }
        }
        if N > 1 && self.form == Form::Ratio {
            lift::<N>(x, y, z, cap, ground.normal);
        }
        let (over, above) = match self.form {
            Form::Fluence => (N as f32, N as f32),
            Form::Ratio => {
                let (n, s) = (ground.normal, ground.normal_shading);
                let (mut cosines, mut open) = ([0.0f32; N], [0.0f32; N]);
                for i in 0..N {
                    let above = n.x * x[i] + n.y * y[i] + n.z * z[i] > 0.0;
                    let cosine = (s.x * x[i] + s.y * y[i] + s.z * z[i]).max(GRAZING_COSINE);
                    cosines[i] = if above { cosine } else { 0.0 };
                    open[i] = if above { 1.0 } else { 0.0 };
                }
                // Light that reached the entry came from above its horizon, wherever rounding puts the cone.
                (sum_of(&cosines).max(LEAST_COSINE * N as f32), sum_of(&open).max(LEAST_OPEN * N as f32))
            }
        };
        let gloss = over / (above * cap.mean_cosine);
        self.lanes.waiting[self.count] =
            Waiting { energy: cap.energy * (part / over), gloss, first, count: N };
        self.count += 1;
        self.used += N;
    }

    /// Adds a cone of an entry whose light comes from these lights, each in its own colour, instead of from all of its cap alike: at most as many as there are lanes.
    #[inline(always)]
    pub(super) fn add_toward(&mut self, cap: &Cap, ground: &Ground, part: f32, toward: &[Toward]) {
        let n = toward.len().min(LANES);
        if self.used + n > LANES || self.count + n > WAITING {
            self.flush();
        }
        let (mut over, mut all, mut tinted) = (0.0, 0.0, Vec3::ZERO);
        for light in &toward[..n] {
            let cosine = ground.normal_shading.dot(light.direction).max(GRAZING_COSINE);
            all += light.weight;
            over += light.weight * cosine;
            tinted += light.tint * (light.weight * cosine);
        }
        // Lights that are not those which shine may all graze the entry, which its own light does not.
        let most = over.max(0.5 * cap.mean_cosine * all);
        let gloss = most / (all.max(f32::MIN_POSITIVE) * cap.mean_cosine);
        let energy = cap.energy * (part * over / most.max(f32::MIN_POSITIVE));
        let tinted = tinted.max(Vec3::splat(f32::MIN_POSITIVE));
        for light in &toward[..n] {
            let Lanes { x, y, z, a2, waiting, .. } = &mut *self.lanes;
            let lane = self.used;
            (x[lane], y[lane], z[lane]) = light.direction.into();
            // What it fills of all directions, half of which half vectors turn by.
            a2[lane] = self.a2 + 0.25 * light.depth;
            let energy = energy * (light.tint * light.weight / tinted);
            waiting[self.count] = Waiting { energy, gloss, first: lane, count: 1 };
            self.count += 1;
            self.used += 1;
        }
    }

    /// Shades what is in the lanes.
    #[inline(always)]
    fn flush(&mut self) {
        if self.point.reflectance.specular {
            self.flush_glossy();
        } else {
            self.flush_matte();
        }
        (self.used, self.count) = (0, 0);
    }

    #[allow(clippy::needless_range_loop)] // several lists of lanes at once
    #[inline(always)]
    fn flush_matte(&mut self) {
        let Lanes { x, y, z, diffuse: cosines, waiting, .. } = &mut *self.lanes;
        let (n, s) = (self.point.normal_world, self.point.normal_shading_world);
        let steps = self.used.div_ceil(STEP);
        let [x, y, z] = [x, y, z].map(|lane| &lane.as_chunks::<STEP>().0[..steps]);
        for (((x, y), z), cosines) in x.iter().zip(y).zip(z).zip(cosines.as_chunks_mut::<STEP>().0) {
            for i in 0..STEP {
                let above = n.x * x[i] + n.y * y[i] + n.z * z[i] > 0.0;
                let cosine = (s.x * x[i] + s.y * y[i] + s.z * z[i]).max(0.0);
                cosines[i] = if above { cosine } else { 0.0 };
            }
        }
        let mut sum = Vec3::ZERO;
        for cone in &waiting[..self.count] {
            sum += cone.energy * sum_of(&cosines[cone.first..cone.first + cone.count]);
        }
        self.radiance += self.point.reflectance.diffuse * FRAC_1_PI * sum;
    }

    /// Schlick's fifth power f splits reflectance into three sums over directions: n·l (1 − f), D V n·l (1 − f), D V n·l f.
    #[allow(clippy::needless_range_loop)] // several lists of lanes at once
    #[inline(always)]
    fn flush_glossy(&mut self) {
        let Lanes { x, y, z, diffuse, gloss, grazing, a2: wide, waiting } = &mut *self.lanes;
        let (n, s, v) =
            (self.point.normal_world, self.point.normal_shading_world, self.point.to_viewer_world);
        let (a2, nv, nv_signed, lambda_v) = (self.a2, self.n_dot_v, self.n_dot_v_signed, self.lambda_v);
        let steps = self.used.div_ceil(STEP);
        let [x, y, z, wide] = [x, y, z, wide].map(|lane| &lane.as_chunks::<STEP>().0[..steps]);
        let [out_diffuse, out_gloss, out_grazing] =
            [&mut *diffuse, &mut *gloss, &mut *grazing].map(|lane| lane.as_chunks_mut::<STEP>().0);
        for step in 0..steps {
            let (x, y, z, wide) = (&x[step], &y[step], &z[step], &wide[step]);
            let (out_diffuse, out_gloss, out_grazing) =
                (&mut out_diffuse[step], &mut out_gloss[step], &mut out_grazing[step]);
            for i in 0..STEP {
                let (x, y, z) = (x[i], y[i], z[i]);
                let above = n.x * x + n.y * y + n.z * z > 0.0;
                let nl_signed = s.x * x + s.y * y + s.z * z;
                let nl = if above { nl_signed.max(0.0) } else { 0.0 };
                let vl = v.x * x + v.y * y + v.z * z;
                // h = (v + l) / |v + l|, |v + l|² = 2 + 2 v·l.
                let reciprocal = 1.0 / (2.0 + 2.0 * vl).max(1e-6).sqrt();
                let vh = ((1.0 + vl) * reciprocal).clamp(0.0, 1.0);
                let nh = ((nv_signed + nl_signed) * reciprocal).clamp(0.0, 1.0);
                let miss = 1.0 - vh;
                let f5 = (miss * miss) * (miss * miss) * miss;
                let f = (1.0 - nh) * (1.0 + nh) + nh * nh * wide[i];
                let nl_safe = nl.max(1e-3);
                let smith = nl_safe * lambda_v + nv * (nl_safe * nl_safe * (1.0 - a2) + a2).sqrt();
                // D V n·l in one quotient.
                let dv = (0.5 * FRAC_1_PI * wide[i]) * nl / (f * f * smith);
                out_diffuse[i] = nl * (1.0 - f5);
                out_gloss[i] = dv * (1.0 - f5);
                out_grazing[i] = dv * f5;
            }
        }
        let (mut matte, mut glossy, mut edge) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        for cone in &waiting[..self.count] {
            let lanes = cone.first..cone.first + cone.count;
            matte += cone.energy * sum_of(&diffuse[lanes.clone()]);
            glossy += cone.energy * (cone.gloss * sum_of(&gloss[lanes.clone()]));
            edge += cone.energy * (cone.gloss * sum_of(&grazing[lanes]));
        }
        let r = &self.point.reflectance;
        self.radiance += r.diffuse * (Vec3::ONE - r.f0) * FRAC_1_PI * matte + r.f0 * glossy + edge;
    }
}

/// Brings directions of a cone that reach below an entry's horizon above it. Light there came from above, from as high as the mean of its directions, which is
/// (1 + cos a) / 2 long, says: many lights along the horizon are not as far up as they are apart.
#[inline(always)]
pub(super) fn lift<const N: usize>(x: &mut [f32], y: &mut [f32], z: &mut [f32], cap: &Cap, n: Vec3) {
    let mut heights = [0.0f32; N];
    for i in 0..N {
        heights[i] = n.x * x[i] + n.y * y[i] + n.z * z[i];
    }
    if heights.iter().all(|height| *height > 0.0) {
        return;
    }
    let mean = (n.dot(cap.direction) * 0.5 * (1.0 + cap.cos_angle)).max(LEAST_COSINE);
    let flatter = mean * N as f32 / sum_of(&heights.map(f32::abs)).max(f32::MIN_POSITIVE);
    for i in 0..N {
        let height = (heights[i].abs() * flatter).min(1.0);
        let along = ((1.0 - height * height) / (1.0 - heights[i] * heights[i]).max(1e-6)).sqrt();
        let up = height - heights[i] * along;
        (x[i], y[i], z[i]) = (x[i] * along + n.x * up, y[i] * along + n.y * up, z[i] * along + n.z * up);
    }
}

/// Sum of lanes, four chains at a time: one would wait for each addition.
#[inline(always)]
fn sum_of(lane: &[f32]) -> f32 {
    if let [one] = lane {
        return *one;
    }
    let mut sums = [0.0f32; 4];
    for chunk in lane.chunks(4) {
        for (sum, value) in sums.iter_mut().zip(chunk) {
            *sum += value;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// Part of a cone above an entry's horizon below which it is not taken at its word.
const LEAST_OPEN: f32 = 0.125;
/// Mean cosine at an entry below which a cone is not taken at its word.
const LEAST_COSINE: f32 = 0.01;
