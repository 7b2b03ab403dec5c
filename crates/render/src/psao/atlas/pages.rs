//! The layers that hold the pages of all instances: where each page lies, its texels, and what must be uploaded.

use std::ops::Range;

use dapple_store::charts::{Atlas, AtlasError, ChartSet, PageSize, Placement};

/// Rows of a layer whose texels changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DirtyBand {
    /// Index of the layer.
    pub layer: u32,
    /// The rows.
    pub y: Range<u32>,
}

/// Sides of layers, texels. No page is longer than the smaller.
const SIDES: [u16; 2] = [1024, 2048];

/// Most layers of an atlas: every graphics card takes 256, and a texture may get one more than are wanted of it.
pub const MAX_LAYERS: u16 = 255;

/// Texels a point, gaps between pages counted, by which the side is chosen.
const TEXELS_A_POINT: usize = 4;

/// Clean rows between two dirty ones up to which one upload is cheaper than two.
const BRIDGED_ROWS: u32 = 8;

/// What a texel shows that nobody has written.
const OPEN: [u8; 2] = [255, 255];

/// Square layers of texels `[old, new]`.
pub(super) struct Pages {
    side: u32,
    /// Sides are powers of two.
    side_log2: u32,
    /// Layer after layer, rows from the top. A texel's index is its *address*.
    texels: Vec<[u8; 2]>,
    /// One for each row of each layer.
    dirty: Vec<bool>,
    /// One bit a texel: whether a list of fading texels has it, so that none has it twice.
    listed: Vec<u64>,
    places: Atlas,
}

impl Pages {
    pub(super) fn for_points(points: usize) -> Pages {
        let wanted = points * TEXELS_A_POINT;
        let side = if wanted <= usize::from(SIDES[0]).pow(2) { SIDES[0] } else { SIDES[1] };
        let places = Atlas::new(side, MAX_LAYERS);
        let (side, side_log2) = (u32::from(side), side.ilog2());
        Pages { side, side_log2, texels: Vec::new(), dirty: Vec::new(), listed: Vec::new(), places }
    }

    pub(super) fn side(&self) -> u32 {
        self.side
    }

    pub(super) fn layers(&self) -> u32 {
        u32::from(self.places.layers())
    }

    pub(super) fn texel_count(&self) -> usize {
        self.texels.len()
    }

    pub(super) fn all_texels(&self) -> &[[u8; 2]] {
        &self.texels
    }

    pub(super) fn texels(&self, layer: u32) -> &[[u8; 2]] {
        let area = self.side as usize * self.side as usize;
        &self.texels[layer as usize * area..][..area]
    }

    pub(super) fn texel(&self, layer: u32, x: u32, y: u32) -> [u8; 2] {
        self.texels[self.address(layer, x, y) as usize]
    }

    fn address(&self, layer: u32, x: u32, y: u32) -> u32 {
        (layer * self.side + y) * self.side + x
    }

    pub(super) fn bytes(&self) -> usize {
        self.texels.len() * size_of::<[u8; 2]>() + self.dirty.len() + size_of_val(self.listed.as_slice())
    }

    /// Finds places for the pages of an instance; makes new layers if there is no room.
    pub(super) fn place(&mut self, sizes: &[PageSize]) -> Result<Vec<Placement>, AtlasError> {
        let placements = self.places.insert(sizes)?;
        let rows = (self.layers() * self.side) as usize;
        if rows > self.dirty.len() {
            self.texels.resize(rows * self.side as usize, OPEN);
            self.listed.resize(self.texels.len().div_ceil(64), 0);
            self.dirty.resize(rows, true);
            // A larger texture is a new one: everything must be uploaded.
            self.dirty.fill(true);
        }
        Ok(placements)
    }

    /// Writes the texels of a page; `value` takes their index within the page.
    pub(super) fn fill(&mut self, place: Placement, size: PageSize, value: impl Fn(u32) -> [u8; 2]) {
        let mut index = 0;
        for y in 0..u32::from(size.height) {
            let start =
                self.address(u32::from(place.layer), u32::from(place.x), u32::from(place.y) + y) as usize;
            for texel in &mut self.texels[start..start + usize::from(size.width)] {
                *texel = value(index);
                index += 1;
            }
            self.dirty[start / self.side as usize] = true;
        }
    }

    /// Gives back the places of pages, whose texels are open from now on. Lists of fading texels must be cleaned of those that are
    /// no longer listed.
    pub(super) fn free(&mut self, placements: &[Placement], sizes: &[PageSize]) {
        for (place, size) in placements.iter().zip(sizes) {
            self.fill(*place, *size, |_| OPEN);
            for y in 0..u32::from(size.height) {
                let start = self.address(u32::from(place.layer), u32::from(place.x), u32::from(place.y) + y);
                (start..start + u32::from(size.width)).for_each(|address| self.set_listed(address, false));
            }
        }
        self.places.remove(placements, sizes);
    }

    /// Goes on with the fade of all texels of a page that no list has, as [`Pages::advance`] does; those that go on
    /// fading join `fading`.
    pub(super) fn advance_page(
        &mut self,
        place: Placement,
        size: PageSize,
        progress: f32,
        fading: &mut Vec<u32>,
    ) {
        for y in 0..u32::from(size.height) {
            let start = self.address(u32::from(place.layer), u32::from(place.x), u32::from(place.y) + y);
            for address in start..start + u32::from(size.width) {
                if !self.is_listed(address) && self.mix(address, progress) {
                    self.set_listed(address, true);
                    fading.push(address);
                }
            }
        }
    }

    /// Makes old what listed texels show at `progress` of their fade, 0 … 1; those that are at its end leave the list.
    pub(super) fn advance(&mut self, fading: &mut Vec<u32>, progress: f32) {
        fading.retain(|&address| {
            let goes_on = self.mix(address, progress);
            if !goes_on {
                self.set_listed(address, false);
            }
            goes_on
        });
    }

    /// Makes old what a texel shows; whether it goes on fading.
    fn mix(&mut self, address: u32, progress: f32) -> bool {
        let [old, new] = &mut self.texels[address as usize];
        if old == new {
            return false;
        }
        if progress >= 1.0 {
            *old = *new;
            self.dirty[(address >> self.side_log2) as usize] = true;
            return false;
        }
        let shown = f32::from(*old) + progress * (f32::from(*new) - f32::from(*old));
        let before = std::mem::replace(old, (shown + 0.5) as u8);
        let goes_on = old != new;
        if *old != before {
            self.dirty[(address >> self.side_log2) as usize] = true;
        }
        goes_on
    }

    #[inline]
    pub(super) fn is_listed(&self, address: u32) -> bool {
        self.listed[address as usize / 64] >> (address % 64) & 1 != 0
    }

    #[inline]
    fn set_listed(&mut self, address: u32, listed: bool) {
        let bit = 1 << (address % 64);
        let word = &mut self.listed[address as usize / 64];
        *word = if listed { *word | bit } else { *word & !bit };
    }

    /// Gives new values to `count` texels of one row, the first at `address`. Addresses of those that did not fade before
    /// join `fading`.
    #[inline]
    pub(super) fn write<'a>(
        &'a mut self,
        address: u32,
        count: usize,
        fading: &'a mut Vec<u32>,
    ) -> RowWriter<'a> {
        let texels = self.texels[address as usize..][..count].iter_mut();
        let dirty = &mut self.dirty[(address >> self.side_log2) as usize];
        RowWriter { texels, address, dirty, listed: &mut self.listed, fading }
    }

    /// The rows that changed since the last call, joined to bands.
    pub(super) fn take_dirty(&mut self) -> Vec<DirtyBand> {
        take_bands(&mut self.dirty, self.side)
    }
}

/// The rows of layers of `side` rows that are marked, joined to bands; no row is marked afterwards.
pub(super) fn take_bands(dirty: &mut [bool], side: u32) -> Vec<DirtyBand> {
    let mut bands: Vec<DirtyBand> = Vec::new();
    for (layer, rows) in (0u32..).zip(dirty.chunks_mut(side as usize)) {
        for (y, row) in (0u32..).zip(rows) {
            if !std::mem::take(row) {
                continue;
            }
            match bands.last_mut() {
                Some(band) if band.layer == layer && y - band.y.end <= BRIDGED_ROWS => band.y.end = y + 1,
                _ => bands.push(DirtyBand { layer, y: y..y + 1 }),
            }
        }
    }
    bands
}

/// Writes values to neighbouring texels.
pub(super) struct RowWriter<'a> {
    texels: std::slice::IterMut<'a, [u8; 2]>,
    address: u32,
    dirty: &'a mut bool,
    listed: &'a mut [u64],
    fading: &'a mut Vec<u32>,
}

impl RowWriter<'_> {
    /// The value of the next texel; nothing happens after the last.
    #[inline]
    pub(super) fn next(&mut self, value: u8) {
        let Some(texel) = self.texels.next() else { return };
        let address = self.address;
        self.address += 1;
        if texel[1] == value {
            return;
        }
        let is_at_rest = texel[0] == texel[1];
        texel[1] = value;
        *self.dirty = true;
        let (word, bit) = (&mut self.listed[address as usize / 64], 1u64 << (address % 64));
        if is_at_rest && *word & bit == 0 {
            *word |= bit;
            self.fading.push(address);
        }
    }
}

/// Pages of one instance where they lie: from a number of a texel to its address.
#[derive(Clone, Debug)]
pub(super) struct PlacedPages {
    pages: Vec<PlacedPage>,
    side: u32,
}

#[derive(Clone, Copy, Debug)]
struct PlacedPage {
    first_texel: u32,
    width: u32,
    address: u32,
}

impl PlacedPages {
    /// `placements` are those of the charts' pages, once for each side.
    pub(super) fn new(charts: &ChartSet, placements: &[Placement], side: u32) -> PlacedPages {
        let mut first_texel = 0;
        let place = |(p, size): (&Placement, &PageSize)| {
            let first = first_texel;
            first_texel += size.area();
            PlacedPage {
                first_texel: first,
                width: u32::from(size.width),
                address: (u32::from(p.layer) * side + u32::from(p.y)) * side + u32::from(p.x),
            }
        };
        PlacedPages { pages: placements.iter().zip(charts.pages().iter().cycle()).map(place).collect(), side }
    }

    /// Number of the first texel of each page.
    pub(super) fn firsts(&self) -> impl Iterator<Item = u32> {
        self.pages.iter().map(|page| page.first_texel)
    }

    /// A walk over texels that mostly follow each other.
    #[inline]
    pub(super) fn walk(&self) -> Walk<'_> {
        Walk { placed: self, first: 0, width: 0, address: 0 }
    }
}

/// Remembers the row of the last texel.
pub(super) struct Walk<'a> {
    placed: &'a PlacedPages,
    first: u32,
    width: u32,
    address: u32,
}

impl Walk<'_> {
    /// Address of a texel, which must exist, and how many follow it up to the end of its row, itself counted.
    #[inline]
    pub(super) fn address(&mut self, texel: u32) -> (u32, u32) {
        let within = texel.wrapping_sub(self.first);
        if within < self.width {
            return (self.address + within, self.width - within);
        }
        let pages = &self.placed.pages;
        let at = if pages.len() == 1 { 0 } else { pages.partition_point(|p| p.first_texel <= texel) - 1 };
        let page = &pages[at];
        let row = (texel - page.first_texel) / page.width;
        self.first = page.first_texel + row * page.width;
        self.width = page.width;
        self.address = page.address + row * self.placed.side;
        let within = texel - self.first;
        (self.address + within, self.width - within)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dirty_rows_are_told_once() {
        let mut pages = Pages::for_points(1000);
        let size = PageSize { width: 10, height: 40 };
        let place = pages.place(&[size]).unwrap()[0];
        assert_eq!(pages.take_dirty(), [DirtyBand { layer: 0, y: 0..1024 }], "a new layer");
        pages.fill(place, size, |i| [i as u8, 7]);
        assert_eq!(pages.take_dirty(), [DirtyBand { layer: 0, y: 0..40 }]);
        let mut fading = Vec::new();
        for (x, y, value) in [(3, 1, 9), (4, 1, 9), (3, 5, 8), (3, 30, 1), (3, 31, 7)] {
            pages.write(pages.address(0, x, y), 1, &mut fading).next(value);
        }
        assert_eq!(pages.take_dirty(), [DirtyBand { layer: 0, y: 1..6 }, DirtyBand { layer: 0, y: 30..31 }]);
        assert!(pages.take_dirty().is_empty());
        assert_eq!(pages.texel(0, 3, 30), [(30 * 10 + 3) as u8, 1]);
    }

    #[test]
    fn no_texel_fades_twice_as_fast() {
        let mut pages = Pages::for_points(1000);
        let size = PageSize { width: 8, height: 1 };
        let place = pages.place(&[size]).unwrap()[0];
        let mut fading = Vec::new();
        // Away, back and away again.
        for value in [55, 255, 55] {
            pages.write(0, 1, &mut fading).next(value);
        }
        assert_eq!(fading, [0]);
        // Its page is asked to go on as well, and leaves it to the list.
        pages.advance(&mut fading, 0.25);
        pages.advance_page(place, size, 0.25, &mut fading);
        assert_eq!((pages.texel(0, 0, 0), fading.as_slice()), ([205, 55], [0].as_slice()));
        pages.advance(&mut fading, 1.0);
        assert_eq!((pages.texel(0, 0, 0), fading.len()), ([55, 55], 0));
        pages.write(0, 1, &mut fading).next(56);
        assert_eq!(fading, [0], "it can fade again");
    }
}
