//! What of the visibility of lights is shown, as texels of four lights each, where the pages of the atlas lie.

use dapple_store::charts::{ChartSet, PageSize, Placement};

use super::pages::{DirtyBand, PlacedPages, take_bands};

/// Lights in a texel.
pub const LIGHTS_A_TEXEL: usize = 4;

/// What a texel shows that nobody has written: all of each light.
const OPEN: [u8; LIGHTS_A_TEXEL] = [255; LIGHTS_A_TEXEL];

/// Texels of some lights, four lights a group; of each group the layers of the atlas.
#[derive(Debug)]
pub(super) struct LightTexels {
    side: u32,
    /// Which lights, in the order of their places.
    lights: Vec<u32>,
    groups: Vec<Vec<[u8; LIGHTS_A_TEXEL]>>,
    /// One for each row of each layer, for all groups together.
    dirty: Vec<bool>,
}

impl LightTexels {
    /// Everything is open and must be uploaded.
    pub(super) fn new(side: u32, texels: usize, lights: &[u32]) -> LightTexels {
        let groups = lights.len().div_ceil(LIGHTS_A_TEXEL);
        LightTexels {
            side,
            lights: lights.to_vec(),
            groups: vec![vec![OPEN; texels]; groups],
            dirty: vec![true; texels / side.max(1) as usize],
        }
    }

    pub(super) fn lights(&self) -> &[u32] {
        &self.lights
    }

    pub(super) fn groups(&self) -> &[Vec<[u8; LIGHTS_A_TEXEL]>] {
        &self.groups
    }

    /// Makes room for so many texels of all layers.
    pub(super) fn grow(&mut self, texels: usize) {
        let rows = texels / self.side.max(1) as usize;
        if rows > self.dirty.len() {
            self.groups.iter_mut().for_each(|group| group.resize(texels, OPEN));
            self.dirty.resize(rows, true);
            self.dirty.fill(true);
        }
    }

    /// The place of a light among those shown.
    pub(super) fn slot(&self, light: u32) -> Option<usize> {
        self.lights.iter().position(|shown| *shown == light)
    }

    pub(super) fn write(&mut self, slot: usize, address: u32, value: u8) {
        let texel = &mut self.groups[slot / LIGHTS_A_TEXEL][address as usize][slot % LIGHTS_A_TEXEL];
        if *texel != value {
            *texel = value;
            self.dirty[(address / self.side) as usize] = true;
        }
    }

    /// Writes all texels of a set: `value` takes a light and the number of a texel of the set, and gives none where nothing is known.
    pub(super) fn fill(
        &mut self,
        charts: &ChartSet,
        placed: &PlacedPages,
        texels: u32,
        value: impl Fn(u32, u32) -> Option<u8>,
    ) {
        debug_assert!(texels.is_multiple_of(charts.texel_count().max(1)), "one side or both");
        let mut walk = placed.walk();
        for texel in 0..texels {
            let (address, _) = walk.address(texel);
            for slot in 0..self.lights.len() {
                self.write(slot, address, value(self.lights[slot], texel).unwrap_or(255));
            }
        }
    }

    /// Opens the texels of pages that are given back.
    pub(super) fn free(&mut self, placements: &[Placement], sizes: &[PageSize]) {
        for (place, size) in placements.iter().zip(sizes.iter().cycle()) {
            for y in 0..u32::from(size.height) {
                let row = u32::from(place.layer) * self.side + u32::from(place.y) + y;
                let start = (row * self.side + u32::from(place.x)) as usize;
                if row as usize >= self.dirty.len() {
                    continue;
                }
                for group in &mut self.groups {
                    group[start..start + usize::from(size.width)].fill(OPEN);
                }
                self.dirty[row as usize] = true;
            }
        }
    }

    pub(super) fn take_dirty(&mut self) -> Vec<DirtyBand> {
        take_bands(&mut self.dirty, self.side)
    }

    pub(super) fn bytes(&self) -> usize {
        self.groups.iter().map(|group| size_of_val(&group[..])).sum::<usize>() + self.dirty.len()
    }
}
