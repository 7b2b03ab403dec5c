//! The look-up in Rust: what a fragment reads, as a graphics card does it.

use dapple_store::charts::{ChartUv, TEXEL_FRACTION};
use rayon::prelude::*;

use super::{Placement, ReadySet, SetState, VisibilityAtlas};
use crate::gbuffer::GBuffer;

impl VisibilityAtlas {
    /// Visibility 0 … 1 at a place of a triangle; `barycentrics` are the weights of the second and third corner. `fade` is
    /// how far the last update has been faded in, 0 … 1; `back` is whether the triangle is seen from its back. Open where
    /// nothing is ready or there are no points.
    pub fn visibility(
        &self,
        instance: u32,
        triangle: u32,
        barycentrics: [f32; 2],
        back: bool,
        fade: f32,
    ) -> f32 {
        let Some(ready) = self.ready_set(instance) else { return 1.0 };
        let Some(&corners) = ready.charts.corners().get(triangle as usize) else { return 1.0 };
        let placements = ready.placements_of(back);
        let value = if ready.charts.is_per_vertex() {
            let [b, c] = barycentrics;
            let corner = |uv| self.corner_value(placements, uv, fade);
            let [va, vb, vc] = corners.map(corner);
            va + b * (vb - va) + c * (vc - va)
        } else {
            let (page, x, y) = ready.charts.texel_at(triangle as usize, barycentrics);
            let Some(place) = placements.get(usize::from(page)) else { return 1.0 };
            self.bilinear(u32::from(place.layer), f32::from(place.x) + x, f32::from(place.y) + y, fade)
        };
        (value / 255.0).clamp(0.0, 1.0)
    }

    /// Visibility of each sample of a picture (1 for the background), in parallel in the caller's rayon pool.
    pub fn reconstruct(&self, gbuffer: &GBuffer, fade: f32) -> Vec<f32> {
        let samples = gbuffer.samples().par_iter().with_min_len(1024);
        samples
            .map(|s| match s.is_covered() {
                true => self.visibility(s.instance, s.triangle, s.barycentrics, s.is_back_face(), fade),
                false => 1.0,
            })
            .collect()
    }

    /// The texel that a corner lies on.
    fn corner_value(&self, placements: &[Placement], uv: ChartUv, fade: f32) -> f32 {
        let Some(place) = placements.get(usize::from(uv.page)) else { return 255.0 };
        let texel = |at: u16| u32::from(at / TEXEL_FRACTION);
        self.mix(
            u32::from(place.layer),
            u32::from(place.x) + texel(uv.x),
            u32::from(place.y) + texel(uv.y),
            fade,
        )
    }

    /// Four texels around a place, which is in texels with centres at halves.
    fn bilinear(&self, layer: u32, x: f32, y: f32, fade: f32) -> f32 {
        let last = (self.pages.side() - 1) as f32;
        let split = |at: f32| {
            let at = at - 0.5;
            let floor = at.floor();
            let texel = |t: f32| t.clamp(0.0, last) as u32;
            (texel(floor), texel(floor + 1.0), at - floor)
        };
        let ((x0, x1, fx), (y0, y1, fy)) = (split(x), split(y));
        let row = |y: u32| {
            let (a, b) = (self.mix(layer, x0, y, fade), self.mix(layer, x1, y, fade));
            a + fx * (b - a)
        };
        let (top, bottom) = (row(y0), row(y1));
        top + fy * (bottom - top)
    }

    /// A texel between old and new, 0 … 255.
    fn mix(&self, layer: u32, x: u32, y: u32, fade: f32) -> f32 {
        let [old, new] = self.pages.texel(layer, x, y).map(f32::from);
        old + fade * (new - old)
    }

    pub(super) fn ready_set(&self, instance: u32) -> Option<&ReadySet> {
        let sets = self.layout.sets();
        let at = sets.binary_search_by_key(&instance, |set| set.instance).ok()?;
        match &self.sets[at] {
            SetState::Ready(ready) => Some(ready),
            SetState::Open => None,
        }
    }
}

impl ReadySet {
    /// Placements of the pages of one side; the front's for the back of what is seen from one side only.
    pub(super) fn placements_of(&self, back: bool) -> &[Placement] {
        let pages = self.charts.pages().len();
        match back && self.placements.len() > pages {
            true => &self.placements[pages..],
            false => &self.placements[..pages],
        }
    }
}
