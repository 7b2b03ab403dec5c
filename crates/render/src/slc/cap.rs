//! Light of one cone, reflected: a fixed pattern of directions in it, and glTF's reflectance in lanes.
//!
//! Also what area lights are shaded with ([`crate::area_lights`]).

use std::f32::consts::FRAC_1_PI;
use std::sync::LazyLock;

use dapple_scene::ShadingPoint;
use dapple_store::points::orthonormal_basis;
use glam::Vec3;

use super::SlcShading;

/// A cone: light that comes, evenly, from all directions of a cap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cap {
    /// Unit axis, world.
    pub direction: Vec3,
    /// Cosine of the angle between axis and rim, −1 … 1.
    pub cos_angle: f32,
    /// What arrives through it, W/m².
    pub energy: Vec3,
}

/// What an entry's energies are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// Irradiance on the entry's surface: L = Σ E · Σ f cos / Σ cos'. Diffuse light is exact for any shape of cone.
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

/// Directions evenly in a cap, by lanes: part of the cap's height, and the turn about the axis.
struct Pattern<const N: usize> {
    height: [f32; N],
    cos: [f32; N],
    sin: [f32; N],
}

impl<const N: usize> Pattern<N> {
    /// A spiral of golden turns, the same for all: patterns that differ from sample to sample would be noise.
    fn new() -> Pattern<N> {
        const GOLDEN_TURN: f64 = 2.399_963_229_728_653;
        let mut pattern = Pattern { height: [0.0; N], cos: [1.0; N], sin: [0.0; N] };
        for i in 0..N {
            let turn = i as f64 * GOLDEN_TURN;
            pattern.height[i] = ((i as f64 + 0.5) / N as f64) as f32;
            pattern.cos[i] = libm::cos(turn) as f32;
            pattern.sin[i] = libm::sin(turn) as f32;
        }
        if N == 1 {
            pattern.height[0] = 0.0;
        }
        pattern
    }
}

static ONE: LazyLock<Pattern<1>> = LazyLock::new(Pattern::new);
static FOUR: LazyLock<Pattern<4>> = LazyLock::new(Pattern::new);
static EIGHT: LazyLock<Pattern<8>> = LazyLock::new(Pattern::new);
static SIXTEEN: LazyLock<Pattern<16>> = LazyLock::new(Pattern::new);
static SIXTY_FOUR: LazyLock<Pattern<64>> = LazyLock::new(Pattern::new);

/// Sums over a cone's directions, of what reflectance is made of: n·l (1 − f), D V n·l (1 − f), D V n·l f with f Schlick's fifth power, n·l,
/// and n'·l of the entry's normal.
#[derive(Clone, Copy, Default)]
struct Sums {
    diffuse: f32,
    gloss: f32,
    grazing: f32,
    cosine: f32,
    entry: f32,
}

/// A surface about to be shaded.
pub(crate) struct Lens<'a> {
    point: &'a ShadingPoint,
    n_dot_v: f32,
    a2: f32,
}

impl<'a> Lens<'a> {
    pub(crate) fn of(point: &'a ShadingPoint) -> Lens<'a> {
        let n_dot_v = point.normal_shading_world.dot(point.to_viewer_world).clamp(1e-3, 1.0);
        Lens { point, n_dot_v, a2: point.reflectance.alpha * point.reflectance.alpha }
    }

    /// Radiance that the cone's light leaves towards the viewer.
    pub(super) fn shade(&self, cap: &Cap, entry_normal: Vec3, shading: &SlcShading) -> Vec3 {
        let count = match shading.samples {
            Samples::Fixed(n) => n,
            Samples::Adaptive => self.needed(cap),
        };
        self.shade_as(cap, entry_normal, (count, shading.form, self.a2))
    }

    /// The same of irradiance on the point's own shading normal, with a gloss so wide that the directions of the pattern run into each
    /// other: each stands for its part of the cone. On smooth surfaces wide cones are mirrored whole, not as dots.
    pub(crate) fn shade_evenly(&self, cap: &Cap) -> Vec3 {
        let count = self.needed(cap);
        // Half vectors turn by half of what directions do; α is about the tangent of the lobe's half width.
        let part = (1.0 - cap.cos_angle) / (2 * count) as f32;
        let a2 = (self.a2 + part.max(0.0)).min(self.a2.max(1.0));
        self.shade_as(cap, self.point.normal_shading_world, (count, Form::Ratio, a2))
    }

    fn shade_as(&self, cap: &Cap, entry_normal: Vec3, (count, form, a2): (u32, Form, f32)) -> Vec3 {
        let (sums, n) = match count {
            0..4 => (self.sums(cap, entry_normal, a2, &*ONE), 1.0),
            4..8 => (self.sums(cap, entry_normal, a2, &*FOUR), 4.0),
            8..16 => (self.sums(cap, entry_normal, a2, &*EIGHT), 8.0),
            16..64 => (self.sums(cap, entry_normal, a2, &*SIXTEEN), 16.0),
            64.. => (self.sums(cap, entry_normal, a2, &*SIXTY_FOUR), 64.0),
        };
        let over = match form {
            Form::Fluence => n,
            // Light that reached the entry came from above its horizon, wherever rounding puts the cone.
            Form::Ratio => sums.entry.max(LEAST_COSINE * n),
        };
        let r = &self.point.reflectance;
        let reflected = match r.specular {
            true => {
                r.diffuse * (Vec3::ONE - r.f0) * (FRAC_1_PI * sums.diffuse)
                    + r.f0 * sums.gloss
                    + Vec3::splat(sums.grazing)
            }
            false => r.diffuse * (FRAC_1_PI * sums.cosine),
        };
        cap.energy * reflected / over
    }

    /// Directions that a cone needs on this surface.
    fn needed(&self, cap: &Cap) -> u32 {
        // Chord of the angle, about the angle itself; perceptual roughness squared is alpha.
        let angle = (2.0 * (1.0 - cap.cos_angle)).max(0.0).sqrt();
        match angle / (0.04 + 0.6 * self.point.reflectance.alpha) {
            q if q < 0.25 => 1,
            q if q < 0.6 => 4,
            q if q < 1.2 => 8,
            _ => 16,
        }
    }

    fn sums<const N: usize>(&self, cap: &Cap, entry_normal: Vec3, a2: f32, pattern: &Pattern<N>) -> Sums {
        let (tangent, bitangent) = orthonormal_basis(cap.direction);
        let in_frame = |v: Vec3| [v.dot(tangent), v.dot(bitangent), v.dot(cap.direction)];
        let shading = in_frame(self.point.normal_shading_world);
        let geometric = in_frame(self.point.normal_world);
        let viewer = in_frame(self.point.to_viewer_world);
        let entry = in_frame(entry_normal);
        let depth = 1.0 - cap.cos_angle;
        let nv = self.n_dot_v;
        let lambda_v = (nv * nv * (1.0 - a2) + a2).sqrt();
        let mut lanes = [[0.0f32; N]; 5];
        #[allow(clippy::needless_range_loop)] // five lists of lanes at once
        for i in 0..N {
            let below = depth * pattern.height[i];
            let (z, radius) = (1.0 - below, (below * (2.0 - below)).max(0.0).sqrt());
            let (x, y) = (radius * pattern.cos[i], radius * pattern.sin[i]);
            let dot = |v: [f32; 3]| v[0] * x + v[1] * y + v[2] * z;
            let above = if dot(geometric) > 0.0 { 1.0f32 } else { 0.0 };
            let nl = dot(shading).max(0.0) * above;
            let vl = dot(viewer);
            // h = (v + l) / |v + l|, |v + l|² = 2 + 2 v·l.
            let reciprocal = 1.0 / (2.0 + 2.0 * vl).max(1e-6).sqrt();
            let vh = ((1.0 + vl) * reciprocal).clamp(0.0, 1.0);
            let nh = ((self.n_dot_v_signed() + dot(shading)) * reciprocal).clamp(0.0, 1.0);
            let miss = 1.0 - vh;
            let f5 = miss * miss * miss * miss * miss;
            let f = (1.0 - nh) * (1.0 + nh) + nh * nh * a2;
            let d = a2 * FRAC_1_PI / (f * f);
            let nl_safe = nl.max(1e-3);
            let v = 0.5 / (nl_safe * lambda_v + nv * (nl_safe * nl_safe * (1.0 - a2) + a2).sqrt());
            let dv = d * v * nl;
            lanes[0][i] = nl * (1.0 - f5);
            lanes[1][i] = dv * (1.0 - f5);
            lanes[2][i] = dv * f5;
            lanes[3][i] = nl;
            lanes[4][i] = dot(entry).max(0.0);
        }
        let [diffuse, gloss, grazing, cosine, entry] = lanes.map(|lane| sum_of(&lane));
        Sums { diffuse, gloss, grazing, cosine, entry }
    }

    fn n_dot_v_signed(&self) -> f32 {
        self.point.normal_shading_world.dot(self.point.to_viewer_world)
    }
}

/// Sum of lanes, four chains at a time: one would wait for each addition.
fn sum_of<const N: usize>(lane: &[f32; N]) -> f32 {
    let mut sums = [0.0f32; 4];
    for chunk in lane.chunks(4) {
        for (sum, value) in sums.iter_mut().zip(chunk) {
            *sum += value;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// Mean cosine at an entry below which a cone is not taken at its word.
const LEAST_COSINE: f32 = 0.01;
