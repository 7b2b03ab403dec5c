//! Which texels of a set a place reads, and how much of each: for values beside the texels that are shown.

use dapple_store::charts::{ChartSet, TEXEL_FRACTION};

use super::ReadySet;

/// Up to four texels of a set and how much each counts at a place.
pub(super) struct Mix {
    texels: [(u32, f32); 4],
    count: usize,
}

impl Mix {
    /// Numbers of texels, and their shares.
    pub(super) fn texels(&self) -> &[(u32, f32)] {
        &self.texels[..self.count]
    }
}

impl ReadySet {
    /// What a place of a triangle reads, as a card does it.
    pub(super) fn mix(&self, triangle: u32, barycentrics: [f32; 2], back: bool) -> Option<Mix> {
        let charts = &*self.charts;
        let corners = charts.corners().get(triangle as usize)?;
        // The back's texels follow the front's.
        let is_back = back && self.sums.len() > charts.texel_count() as usize;
        let first = if is_back { charts.texel_count() } else { 0 };
        let texel = |page: u16, x: u32, y: u32| first + nearest_texel(charts, usize::from(page), x, y);
        if charts.is_per_vertex() {
            let [b, c] = barycentrics;
            let whole = |at: u16| u32::from(at / TEXEL_FRACTION);
            let [ta, tb, tc] = corners.map(|uv| texel(uv.page, whole(uv.x), whole(uv.y)));
            return Some(Mix { texels: [(ta, 1.0 - b - c), (tb, b), (tc, c), (ta, 0.0)], count: 3 });
        }
        let (page, x, y) = charts.texel_at(triangle as usize, barycentrics);
        let split = |at: f32| {
            let at = (at - 0.5).max(0.0);
            (at as u32, at.fract())
        };
        let ((x, fx), (y, fy)) = (split(x), split(y));
        let texels = [
            (texel(page, x, y), (1.0 - fx) * (1.0 - fy)),
            (texel(page, x + 1, y), fx * (1.0 - fy)),
            (texel(page, x, y + 1), (1.0 - fx) * fy),
            (texel(page, x + 1, y + 1), fx * fy),
        ];
        Some(Mix { texels, count: 4 })
    }
}

/// Number of a texel of a page, the nearest one that there is.
fn nearest_texel(charts: &ChartSet, page: usize, x: u32, y: u32) -> u32 {
    let size = charts.pages()[page];
    let within = |at: u32, size: u16| at.min(u32::from(size).saturating_sub(1));
    charts.first_texel_of_page(page) + within(y, size.height) * u32::from(size.width) + within(x, size.width)
}
