//! What of the visibility of lights is shown, as texels of four lights each, where the pages of the atlas lie.

use dapple_store::charts::{ChartSet, PageSize, Placement};

use super::pages::{DirtyBand, PlacedPages, take_bands};

/// Lights in a texel.
pub const LIGHTS_A_TEXEL: usize = 4;

/// A step of neither side, in a texel of leans.
const NO_LEAN: u8 = 128;

/// Planes of a group where leans are shown: how much is seen of four lights, then where on the first two of them, and where on the others.
pub const PLANES_WITH_LEANS: usize = 3;

/// What a texel shows of one light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LightTexel {
    /// 255 all of it.
    pub(super) share: u8,
    /// 128 the middle, 1 and 255 the rim.
    pub(super) lean: [u8; 2],
}

impl LightTexel {
    /// What nobody has written.
    pub(super) const OPEN: LightTexel = LightTexel { share: 255, lean: [NO_LEAN; 2] };
}

/// What a texel of a plane shows that nobody has written: all of each light.
fn open(plane: usize) -> [u8; LIGHTS_A_TEXEL] {
    [if plane == 0 { 255 } else { NO_LEAN }; LIGHTS_A_TEXEL]
}

/// Texels of some lights, four lights a group; of each group one plane, or with leans three, of all layers of the atlas.
#[derive(Debug)]
pub(super) struct LightTexels {
    side: u32,
    /// Which lights, in the order of their places.
    lights: Vec<u32>,
    planes: Vec<Vec<[u8; LIGHTS_A_TEXEL]>>,
    /// Planes of a group.
    stride: usize,
    /// One for each row of each layer, for all groups together.
    dirty: Vec<bool>,
}

impl LightTexels {
    /// Everything is open and must be uploaded.
    pub(super) fn new(side: u32, texels: usize, lights: &[u32], has_leans: bool) -> LightTexels {
        let stride = if has_leans { PLANES_WITH_LEANS } else { 1 };
        let planes = lights.len().div_ceil(LIGHTS_A_TEXEL) * stride;
        LightTexels {
            side,
            lights: lights.to_vec(),
            planes: (0..planes).map(|plane| vec![open(plane % stride); texels]).collect(),
            stride,
            dirty: vec![true; texels / side.max(1) as usize],
        }
    }

    pub(super) fn lights(&self) -> &[u32] {
        &self.lights
    }

    pub(super) fn planes(&self) -> &[Vec<[u8; LIGHTS_A_TEXEL]>] {
        &self.planes
    }

    pub(super) fn has_leans(&self) -> bool {
        self.stride > 1
    }

    /// Makes room for so many texels of all layers.
    pub(super) fn grow(&mut self, texels: usize) {
        let rows = texels / self.side.max(1) as usize;
        if rows > self.dirty.len() {
            let planes = self.planes.iter_mut().enumerate();
            planes.for_each(|(plane, of)| of.resize(texels, open(plane % self.stride)));
            self.dirty.resize(rows, true);
            self.dirty.fill(true);
        }
    }

    /// The place of a light among those shown.
    pub(super) fn slot(&self, light: u32) -> Option<usize> {
        self.lights.iter().position(|shown| *shown == light)
    }

    pub(super) fn write(&mut self, slot: usize, address: u32, value: LightTexel) {
        let (first, place) = (slot / LIGHTS_A_TEXEL * self.stride, slot % LIGHTS_A_TEXEL);
        let texel = &mut self.planes[first][address as usize][place];
        let mut is_new = std::mem::replace(texel, value.share) != value.share;
        if self.has_leans() {
            let texel = &mut self.planes[first + 1 + place / 2][address as usize];
            let lean = &mut texel[place % 2 * 2..][..2];
            is_new |= *lean != value.lean;
            lean.copy_from_slice(&value.lean);
        }
        self.dirty[(address / self.side) as usize] |= is_new;
    }

    /// Writes all texels of a set: `value` takes a light and the number of a texel of the set, and gives none where nothing is known.
    pub(super) fn fill(
        &mut self,
        charts: &ChartSet,
        placed: &PlacedPages,
        texels: u32,
        value: impl Fn(u32, u32) -> Option<LightTexel>,
    ) {
        debug_assert!(texels.is_multiple_of(charts.texel_count().max(1)), "one side or both");
        let mut walk = placed.walk();
        for texel in 0..texels {
            let (address, _) = walk.address(texel);
            for slot in 0..self.lights.len() {
                self.write(slot, address, value(self.lights[slot], texel).unwrap_or(LightTexel::OPEN));
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
                for (plane, texels) in self.planes.iter_mut().enumerate() {
                    texels[start..start + usize::from(size.width)].fill(open(plane % self.stride));
                }
                self.dirty[row as usize] = true;
            }
        }
    }

    pub(super) fn take_dirty(&mut self) -> Vec<DirtyBand> {
        take_bands(&mut self.dirty, self.side)
    }

    pub(super) fn bytes(&self) -> usize {
        self.planes.iter().map(|plane| size_of_val(&plane[..])).sum::<usize>() + self.dirty.len()
    }
}
