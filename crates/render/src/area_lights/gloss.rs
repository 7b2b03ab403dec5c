//! What a surface reflects of one cone of light whose irradiance on it is known: the twin of `gloss.wgsl`, and of `area_seen` in `reflect.wgsl`.

use std::f32::consts::FRAC_1_PI;

use dapple_scene::ShadingPoint;
use dapple_store::light_visibility::{SeenLight, lean_frame};
use dapple_store::points::orthonormal_basis;
use glam::Vec3;

use super::Arrival;
use crate::cap_pattern::{EIGHT, FOUR, ONE, Pattern, SIXTEEN};

/// Mean cosine below which a cone is not taken at its word.
const LEAST_COSINE: f32 = 0.01;

/// Lean, in angular radii, below which there is none: two steps of a texel.
const LEAST_LEAN: f32 = 1.0 / 64.0;

/// Alpha from which on it is not seen which part of a light is hidden.
pub(crate) const ROUGH_ALPHA: f32 = 0.36;

/// A surface about to be lit.
pub(crate) struct Surface<'a> {
    point: &'a ShadingPoint,
    n_dot_v_signed: f32,
    n_dot_v: f32,
    a2: f32,
}

/// Sums over a cone's directions, of what reflectance is made of: n·l (1 − f), D V n·l (1 − f), D V n·l f with f Schlick's fifth power, n·l above
/// the triangle, and n·l.
#[derive(Clone, Copy, Default)]
struct Sums {
    diffuse: f32,
    gloss: f32,
    grazing: f32,
    cosine: f32,
    over: f32,
}

impl<'a> Surface<'a> {
    #[inline(always)]
    pub(crate) fn of(point: &'a ShadingPoint) -> Surface<'a> {
        let n_dot_v_signed = point.normal_shading_world.dot(point.to_viewer_world);
        let a2 = point.reflectance.alpha * point.reflectance.alpha;
        Surface { point, n_dot_v_signed, n_dot_v: n_dot_v_signed.clamp(1e-3, 1.0), a2 }
    }

    /// Radiance that a cone's light leaves towards the viewer, of irradiance on the surface's shading normal. Gloss is so wide that the directions of the
    /// pattern run into each other: each stands for its part of the cone. On smooth surfaces wide cones are mirrored whole, not as dots.
    #[inline(always)]
    pub(crate) fn reflect(&self, arrival: &Arrival) -> Vec3 {
        let count = self.needed(arrival);
        // Each direction shows the part of the cone about it, 1 − cos s = (1 − cos a) / count, half of which half vectors turn by: as much variance as s² / 8.
        let part = (1.0 - arrival.cos_angle) / (4 * count) as f32;
        let a2 = (self.a2 + part.max(0.0)).min(self.a2.max(1.0));
        let sums = match count {
            1 => self.sums(arrival, a2, &ONE),
            4 => self.sums(arrival, a2, &FOUR),
            8 => self.sums(arrival, a2, &EIGHT),
            _ => self.sums(arrival, a2, &SIXTEEN),
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
        arrival.irradiance * reflected / sums.over.max(LEAST_COSINE * count as f32)
    }

    /// The cone of what is seen of a light, of the irradiance of all of it: it leans to where that lies, and is as much smaller as a part must be that lies there.
    /// Nothing is made of it on surfaces that are too rough to show it.
    pub(super) fn seen(&self, arrival: &Arrival, seen: &SeenLight) -> Arrival {
        let [x, y] = seen.lean;
        let far = (x * x + y * y).sqrt().min(1.0);
        let depth = 1.0 - arrival.cos_angle;
        // Beyond a hemisphere there is no side.
        if far < LEAST_LEAN || depth >= 1.0 || self.point.reflectance.alpha >= ROUGH_ALPHA {
            return *arrival;
        }
        let sine = (depth * (2.0 - depth)).max(0.0).sqrt();
        let [across, along] = lean_frame(arrival.direction);
        let leaning = arrival.direction + (across * x + along * y) * sine;
        // Not below the horizon: what is seen gives the irradiance that it gives.
        let normal = self.point.normal_shading_world;
        let lacks = (0.5 * normal.dot(arrival.direction) - normal.dot(leaning)).max(0.0);
        let Some(direction) = (leaning + normal * lacks).try_normalize() else { return *arrival };
        // A part in the middle of which all is symmetric may be the rim as well as the core; one at the rim has only so much room.
        let part = seen.fraction.max((1.0 - far) * (1.0 - far));
        Arrival { direction, cos_angle: 1.0 - depth * part, ..*arrival }
    }

    /// Directions that a cone needs on this surface, as [`Samples::Adaptive`](crate::slc::Samples::Adaptive).
    #[inline(always)]
    fn needed(&self, arrival: &Arrival) -> u32 {
        // Chord of the angle, about the angle itself; perceptual roughness squared is alpha.
        let angle = (2.0 * (1.0 - arrival.cos_angle)).max(0.0).sqrt();
        match angle / (0.04 + 0.6 * self.point.reflectance.alpha) {
            q if q < 0.25 => 1,
            q if q < 0.6 => 4,
            q if q < 1.2 => 8,
            _ => 16,
        }
    }

    #[inline(always)]
    fn sums<const N: usize>(&self, arrival: &Arrival, a2: f32, pattern: &Pattern<N>) -> Sums {
        let axis = arrival.direction;
        let (tangent, bitangent) = orthonormal_basis(axis);
        let depth = 1.0 - arrival.cos_angle;
        let (normal, flat, viewer) =
            (self.point.normal_shading_world, self.point.normal_world, self.point.to_viewer_world);
        let nv = self.n_dot_v;
        let lambda_v = (nv * nv * (1.0 - a2) + a2).sqrt();
        let mut sums = Sums::default();
        for i in 0..N {
            let below = depth * pattern.height[i];
            let (up, radius) = (1.0 - below, (below * (2.0 - below)).max(0.0).sqrt());
            let around = tangent * (radius * pattern.cos[i]) + bitangent * (radius * pattern.sin[i]);
            let light = axis * up + around;
            let cosine = normal.dot(light);
            let above = if flat.dot(light) > 0.0 { 1.0f32 } else { 0.0 };
            let nl = cosine.max(0.0) * above;
            let vl = viewer.dot(light);
            // h = (v + l) / |v + l|, |v + l|² = 2 + 2 v·l.
            let reciprocal = 1.0 / (2.0 + 2.0 * vl).max(1e-6).sqrt();
            let vh = ((1.0 + vl) * reciprocal).clamp(0.0, 1.0);
            let nh = ((self.n_dot_v_signed + cosine) * reciprocal).clamp(0.0, 1.0);
            let miss = 1.0 - vh;
            let f5 = miss * miss * miss * miss * miss;
            let f = (1.0 - nh) * (1.0 + nh) + nh * nh * a2;
            let d = a2 * FRAC_1_PI / (f * f);
            let nl_safe = nl.max(1e-3);
            let smith = 0.5 / (nl_safe * lambda_v + nv * (nl_safe * nl_safe * (1.0 - a2) + a2).sqrt());
            let dv = d * smith * nl;
            sums.diffuse += nl * (1.0 - f5);
            sums.gloss += dv * (1.0 - f5);
            sums.grazing += dv * f5;
            sums.cosine += nl;
            sums.over += cosine.max(0.0);
        }
        sums
    }
}
