//! What a program reads of an atlas: texels to upload, where pages lie, figures for debug views.

use std::collections::BTreeMap;
use std::sync::Arc;

use dapple_store::charts::{ChartSet, Placement};
use dapple_store::points::PointLayout;

use super::{BuildError, DirtyBand, SetState, VisibilityAtlas};

/// What a texel is made of, for debug views.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TexelInfo {
    /// Points that count, 0 … 8; 0 where nothing is.
    pub weights: u8,
    /// Weight of the heaviest, 1 … 256, or 0.
    pub heaviest: u16,
    /// Number of its chart within the instance + 1; 0 outside charts and for vertices with a texel each.
    pub chart: u32,
}

impl VisibilityAtlas {
    /// The points it was made for.
    pub fn layout(&self) -> &Arc<PointLayout> {
        &self.layout
    }

    /// Side of a layer, texels: 1024 or 2048. Never changes.
    pub fn side(&self) -> u32 {
        self.pages.side()
    }

    /// Number of layers. Grows while work goes on; then every row is dirty, so that a larger texture can be filled.
    pub fn layers(&self) -> u32 {
        self.pages.layers()
    }

    /// Texels `[old, new]` of a layer, rows from the top.
    ///
    /// # Panics
    /// If there is no such layer.
    pub fn texels(&self, layer: u32) -> &[[u8; 2]] {
        self.pages.texels(layer)
    }

    /// Texels `[old, new]` of all layers, one after the other, rows from the top.
    pub fn all_texels(&self) -> &[[u8; 2]] {
        self.pages.all_texels()
    }

    /// How many instances are ready.
    pub fn ready_count(&self) -> usize {
        self.sets.iter().filter(|state| matches!(state, SetState::Ready(_))).count()
    }

    /// Texels of all layers.
    pub fn texel_count(&self) -> usize {
        self.pages.texel_count()
    }

    /// Rows whose texels changed since the last call, from the first layer's top on. Few bands: rows between are bridged.
    pub fn take_dirty(&mut self) -> Vec<DirtyBand> {
        self.pages.take_dirty()
    }

    /// Instances that became ready since the last call, in the order in which they did. Until they are asked for they
    /// count as not shown ([`VisibilityAtlas::begin_update`]).
    pub fn take_ready(&mut self) -> Vec<u32> {
        std::mem::take(&mut self.ready)
    }

    /// Instances that could not be made ready, and why. They stay open.
    pub fn failed(&self) -> &[(u32, BuildError)] {
        &self.failed
    }

    /// The charts of an instance that is ready. Instances with the same mesh and scale share one.
    pub fn charts(&self, instance: u32) -> Option<&Arc<ChartSet>> {
        self.ready_set(instance).map(|ready| &ready.charts)
    }

    /// Where each page of an instance's charts lies: for its front and then, if its mesh is seen from both sides, once more for
    /// its back. Empty if it is not ready.
    pub fn placements(&self, instance: u32) -> &[Placement] {
        self.ready_set(instance).map_or(&[], |ready| &ready.placements)
    }

    /// Bytes on the heap: tables, sums, texels, charts, and what is being made; not the layout, which the store owns
    /// (15 bytes a point with its values).
    pub fn memory_bytes(&self) -> u64 {
        let lights = self.light_texels.as_ref().map_or(0, |texels| texels.bytes());
        let mut bytes = (self.pages.bytes() + lights) as u64;
        // Shared ones count once.
        let mut charts = BTreeMap::new();
        for state in &self.sets {
            let SetState::Ready(ready) = state else { continue };
            let bent = ready.bent.as_ref().map_or(0, |bent| bent.bytes());
            let lights = ready.lights.as_ref().map_or(0, |lights| lights.bytes());
            bytes += (ready.table.bytes() + ready.sums.bytes() + bent + lights) as u64;
            charts.insert(Arc::as_ptr(&ready.charts), ready.charts.memory_bytes());
        }
        bytes + charts.values().sum::<u64>() + self.job.as_ref().map_or(0, |job| job.memory_bytes())
    }

    /// What each texel of a layer is made of. Looks at all points: for debug views.
    pub fn texel_infos(&self, layer: u32) -> Vec<TexelInfo> {
        let area = self.side() as usize * self.side() as usize;
        let first = layer as usize * area;
        let mut infos = vec![TexelInfo::default(); area];
        for state in &self.sets {
            let SetState::Ready(ready) = state else { continue };
            for chart in 0..ready.charts.chart_count() {
                let (page, [x, y, width, height]) = ready.charts.chart_rectangle(chart);
                let places =
                    ready.placements.iter().skip(usize::from(page)).step_by(ready.charts.pages().len());
                for place in places.filter(|p| u32::from(p.layer) == layer) {
                    let (x, y) = (u32::from(place.x) + u32::from(x), u32::from(place.y) + u32::from(y));
                    for row in y..y + u32::from(height) {
                        let start = (row * self.side() + x) as usize;
                        for info in &mut infos[start..start + usize::from(width)] {
                            info.chart = chart + 1;
                        }
                    }
                }
            }
            for point in 0..ready.table.points() {
                let mut walk = ready.placed.walk();
                ready.table.for_each_run(point, |texel, weights| {
                    for (texel, &weight) in (texel..).zip(weights) {
                        let at = (walk.address(texel).0 as usize).wrapping_sub(first);
                        if let Some(info) = infos.get_mut(at) {
                            info.weights += 1;
                            info.heaviest = info.heaviest.max(u16::from(weight) + 1);
                        }
                    }
                });
            }
        }
        infos
    }
}
