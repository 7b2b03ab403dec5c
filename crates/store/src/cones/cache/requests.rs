//! Stage 1: which texels all viewers together want, and the place each stands for ([Stadlbauer2023] sec. 2.1, *visibility*).

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::super::charting::ChartPlace;
use super::super::entry::{ConeError, check_rules};
use super::super::key::{BLOCK_TEXELS, BlockKey, KeyHash, SLABS, TexelKey, edge_of, floor, level_of};

/// Side of a tile of pixels.
const TILE: usize = 64;

/// Added to the distance of a place that lies in another texel, so that any place of its own is nearer.
const OUTSIDE: f32 = 8.0;

/// What a viewer sees in a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelPlace {
    /// Index of the instance.
    pub instance: u32,
    /// Index of the triangle.
    pub triangle: u32,
    /// Weights of its second and third corner.
    pub barycentrics: [f32; 2],
    /// Where that lies in its chart.
    pub place: ChartPlace,
    /// Edge of the pixel on the surface, metres.
    pub footprint_m: f32,
    /// How the normal that it is shaded with leans over its triangle: parts of that unit vector along the triangle's first edge and, in its
    /// plane, across it (towards the third corner), −1 … 1. The rest of it points to the side that is seen. Zero: it is the triangle's own.
    pub lean: [f32; 2],
}

/// What one viewer sees.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Pixels of a row, ≥ 1. For places that are no picture, their number.
    pub width: usize,
    /// Rows of pixels; `None` where there is nothing to light.
    pub pixels: &'a [Option<PixelPlace>],
}

/// Which texels a pixel needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LookUp {
    /// Texels are this many pixel footprints wide, 1/64 … 64. Default 1 (the *cache bias* of [Stadlbauer2023] sec. 4).
    pub bias: f32,
    /// Whether a pixel needs the 2×2 texels about it, to blend; otherwise only its own. Default true.
    pub blend: bool,
}

impl Default for LookUp {
    fn default() -> Self {
        LookUp { bias: 1.0, blend: true }
    }
}

impl LookUp {
    /// Whether the parameters are in range.
    ///
    /// # Errors
    ///
    /// The first that is not.
    pub fn check(&self) -> Result<(), ConeError> {
        let holds = (1.0 / 64.0..=64.0).contains(&self.bias);
        check_rules([("bias", f64::from(self.bias), holds, "it must be 1/64 to 64")])
    }
}

/// The place on the surface that a texel stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TexelPlace {
    /// Index of the triangle.
    pub triangle: u32,
    /// Weights of its second and third corner.
    pub barycentrics: [f32; 2],
    /// [`PixelPlace::lean`], in parts of 2¹⁵ − 1.
    lean: [i16; 2],
    /// Rank among those that ask: squared distance to the texel's centre, in texels, and more outside the texel.
    rank: f32,
}

impl TexelPlace {
    /// Whether it lies in its texel; otherwise in one beside it, because only a neighbour asked.
    pub fn is_inside(&self) -> bool {
        self.rank < OUTSIDE
    }

    /// How its shading normal leans over its triangle ([`PixelPlace::lean`]), to 2⁻¹⁶.
    pub fn lean(&self) -> [f32; 2] {
        self.lean.map(|part| f32::from(part) / f32::from(i16::MAX))
    }

    /// Nearest to the centre first, then lowest triangle, then the bits of all else: no order of pixels changes who wins.
    fn order(&self) -> (u32, u32, u32, u32, [i16; 2]) {
        let [v, w] = self.barycentrics;
        (self.rank.to_bits(), self.triangle, v.to_bits(), w.to_bits(), self.lean)
    }

    /// Takes the other place if that goes before this.
    pub(super) fn improve(&mut self, other: &TexelPlace) {
        if other.order() < self.order() {
            *self = *other;
        }
    }
}

/// Texels of one block that one tile of pixels wants.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockRequest {
    pub(super) key: BlockKey,
    /// A bit a texel.
    pub(super) wanted: u64,
    /// The first texel's place in [`TileRequests::places`]; the others follow in their order.
    pub(super) first: u32,
}

/// A tile of pixels of a view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Tile {
    view: usize,
    left: usize,
    top: usize,
}

/// What one tile of pixels wants, each texel once.
#[derive(Clone, Debug, Default)]
pub(super) struct TileRequests {
    tile: Tile,
    /// Pixels of a row of the tile, and all of them.
    across: usize,
    pixels: Vec<Option<PixelPlace>>,
    pub(super) blocks: Vec<BlockRequest>,
    pub(super) places: Vec<TexelPlace>,
}

/// What all viewers want. The same for any number of threads.
#[derive(Clone, Debug, Default)]
pub struct Requests {
    pub(super) tiles: Vec<TileRequests>,
    /// What they were gathered with.
    look_up: Option<LookUp>,
    /// No others have it; 0 of none.
    pub(super) name: u64,
}

/// Names for requests.
static NAMES: AtomicU64 = AtomicU64::new(1);

impl Requests {
    /// Collects what the viewers' pixels need, tile by tile, in the caller's thread pool. Pixels whose place is no number are
    /// left out.
    pub fn gather(views: &[View<'_>], look_up: &LookUp) -> Requests {
        let mut requests = Requests::default();
        requests.gather_again(views, look_up);
        requests
    }

    /// Turns what was gathered before into what [`Requests::gather`] would give now; tiles whose pixels are the same, to the bit, are not looked at
    /// again. Says whether all are. For that a copy of the pixels is kept, 56 bytes each.
    pub fn gather_again(&mut self, views: &[View<'_>], look_up: &LookUp) -> bool {
        let tiles = views.iter().enumerate().flat_map(|(view, View { width, pixels })| {
            let (width, rows) = ((*width).max(1), pixels.len().div_ceil((*width).max(1)));
            let across = width.div_ceil(TILE);
            (0..across * rows.div_ceil(TILE)).map(move |t| Tile {
                view,
                left: t % across * TILE,
                top: t / across * TILE,
            })
        });
        let tiles: Vec<Tile> = tiles.collect();
        let is_as_before = self.look_up == Some(*look_up) && self.tiles.len() == tiles.len();
        if self.look_up != Some(*look_up) {
            self.tiles.clear();
        }
        self.look_up = Some(*look_up);
        self.tiles.resize_with(tiles.len(), TileRequests::default);
        let each = self.tiles.par_iter_mut().zip(tiles);
        let same = each.map_init(Scratch::default, |scratch, (held, tile)| {
            let view = &views[tile.view];
            if held.is_of(tile, view) {
                return true;
            }
            scratch.gather(view, tile, look_up, held);
            false
        });
        let same = same.reduce(|| true, |a, b| a && b) && is_as_before;
        if !same || self.name == 0 {
            self.name = NAMES.fetch_add(1, Ordering::Relaxed);
        }
        same
    }

    /// Texels wanted, counted once in each tile of 64×64 pixels.
    pub fn texel_count(&self) -> usize {
        self.tiles.iter().map(|tile| tile.places.len()).sum()
    }
}

impl Tile {
    /// Pixels of each of its rows.
    fn rows<'v>(self, view: &View<'v>) -> impl Iterator<Item = &'v [Option<PixelPlace>]> {
        let (width, pixels) = (view.width.max(1), view.pixels);
        let rows = self.top..(self.top + TILE).min(pixels.len().div_ceil(width));
        rows.map(move |y| {
            let row = &pixels[y * width..((y + 1) * width).min(pixels.len())];
            &row[self.left.min(row.len())..(self.left + TILE).min(row.len())]
        })
    }
}

/// Whether pixels are the same to the bit.
fn are_same(a: &[Option<PixelPlace>], b: &[Option<PixelPlace>]) -> bool {
    let bits = |pixel: &PixelPlace| {
        let PixelPlace { instance, triangle, barycentrics: [v, w], place, footprint_m, lean: [x, y] } =
            *pixel;
        let ChartPlace { chart, uv: [s, t], depth, size, texel_m } = place;
        ([instance, triangle, chart], size, [v, w, s, t, depth, texel_m, footprint_m, x, y].map(f32::to_bits))
    };
    let same =
        |(a, b): (&Option<PixelPlace>, &Option<PixelPlace>)| a.as_ref().map(bits) == b.as_ref().map(bits);
    a.len() == b.len() && a.iter().zip(b).all(same)
}

impl TileRequests {
    /// Whether it is what this tile wants.
    fn is_of(&self, tile: Tile, view: &View<'_>) -> bool {
        let mut held = self.pixels.chunks(self.across.max(1));
        let mut rows = tile.rows(view).filter(|row| !row.is_empty());
        self.tile == tile
            && rows.all(|row| held.next().is_some_and(|held| are_same(held, row)))
            && held.next().is_none()
    }
}

/// The texels about a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nearby {
    /// Chart and level; x and y are not those of a texel.
    block: BlockKey,
    /// In texels of the level.
    at: [f32; 2],
    /// The texel that it lies in.
    own: [i32; 2],
    /// First and last texel along x and y that a place of the chart lies in.
    low: [i32; 2],
    high: [i32; 2],
}

impl Nearby {
    /// `None` if there is no level for it.
    pub(super) fn of(pixel: &PixelPlace, bias: f32) -> Option<Nearby> {
        let ChartPlace { chart, uv, depth, size, texel_m } = pixel.place;
        let level = level_of(pixel.footprint_m, texel_m, bias)?;
        let shrink = edge_of(-level);
        let at = uv.map(|v| v * shrink);
        if !(at[0].is_finite() && at[1].is_finite()) {
            return None;
        }
        let is_slab = chart & SLABS != 0;
        // Places of a chart lie half a texel within its rectangle.
        let (low, high) = if is_slab {
            ([i32::MIN; 2], [i32::MAX; 2])
        } else {
            let last = size.map(|s| floor((f32::from(s) - 0.5).max(0.5) * shrink));
            ([floor(0.5 * shrink); 2], last)
        };
        let slab = if is_slab { floor(depth * shrink) } else { 0 };
        let block = BlockKey { instance: pixel.instance, chart, level, slab, x: 0, y: 0 };
        Some(Nearby { block, at, own: at.map(floor), low, high })
    }

    /// The texel that the place lies in.
    pub(super) fn own(&self) -> TexelKey {
        self.block.texel_at(self.own[0], self.own[1])
    }

    /// Calls for each texel of the 2×2 whose centres are about the place, with its weight and its coordinates.
    pub(super) fn each_of_four(&self, mut visit: impl FnMut(TexelKey, f32, [i32; 2])) {
        let [u, v] = self.at.map(|v| v - 0.5);
        let (x0, y0) = (floor(u), floor(v));
        let (right, down) = ((u - x0 as f32).clamp(0.0, 1.0), (v - y0 as f32).clamp(0.0, 1.0));
        for (dy, weight_y) in [(0, 1.0 - down), (1, down)] {
            for (dx, weight_x) in [(0, 1.0 - right), (1, right)] {
                let at = [x0.saturating_add(dx), y0.saturating_add(dy)];
                let exists = (0..2).all(|k| (self.low[k]..=self.high[k]).contains(&at[k]));
                if exists && weight_x * weight_y > 0.0 {
                    visit(self.block.texel_at(at[0], at[1]), weight_x * weight_y, at);
                }
            }
        }
    }

    /// Rank of the place as that of a texel.
    fn rank(&self, texel: [i32; 2]) -> f32 {
        let from_centre = |k: usize| self.at[k] - (texel[k] as f32 + 0.5);
        let (x, y) = (from_centre(0), from_centre(1));
        // A place inside is at most ½ away along either axis.
        x * x + y * y + if texel == self.own { 0.0 } else { OUTSIDE }
    }
}

/// What a tile wants so far.
#[derive(Default)]
struct Scratch {
    /// Never walked through: the order is that of `blocks`.
    block_of: HashMap<BlockKey, u32, KeyHash>,
    blocks: Vec<Block>,
    places: Vec<TexelPlace>,
}

struct Block {
    key: BlockKey,
    wanted: u64,
    /// Indices into the tile's places, for the texels that are wanted.
    places: [u16; BLOCK_TEXELS],
}

// A tile's places are numbered in 16 bits.
const _: () = assert!(TILE * TILE * 5 <= 1 << 16);

impl Scratch {
    fn gather(&mut self, view: &View<'_>, tile: Tile, look_up: &LookUp, out: &mut TileRequests) {
        self.block_of.clear();
        self.blocks.clear();
        self.places.clear();
        let (mut across, mut pixels) = (0, std::mem::take(&mut out.pixels));
        pixels.clear();
        for row in tile.rows(view) {
            across = across.max(row.len());
            pixels.extend_from_slice(row);
            // The block that was asked last is likely to be asked again.
            let mut last = 0;
            for pixel in row.iter().flatten() {
                self.want(pixel, look_up, &mut last);
            }
        }
        let (blocks, places) = self.flatten();
        *out = TileRequests { tile, across, pixels, blocks, places };
    }

    fn want(&mut self, pixel: &PixelPlace, look_up: &LookUp, last: &mut usize) {
        let Some(nearby) = Nearby::of(pixel, look_up.bias) else { return };
        // What is no number leans nowhere.
        let lean = pixel.lean.map(|part| (part.clamp(-1.0, 1.0) * f32::from(i16::MAX)) as i16);
        let place =
            |rank| TexelPlace { triangle: pixel.triangle, barycentrics: pixel.barycentrics, lean, rank };
        let own = nearby.own();
        self.add(&own, &place(nearby.rank(own.xy())), last);
        if look_up.blend {
            nearby.each_of_four(|key, _, at| {
                if key != own {
                    self.add(&key, &place(nearby.rank(at)), last);
                }
            });
        }
    }

    fn add(&mut self, key: &TexelKey, place: &TexelPlace, last: &mut usize) {
        if self.blocks.get(*last).is_none_or(|block| block.key != key.block) {
            let next = self.blocks.len() as u32;
            *last = *self.block_of.entry(key.block).or_insert(next) as usize;
            if *last == self.blocks.len() {
                self.blocks.push(Block { key: key.block, wanted: 0, places: [0; BLOCK_TEXELS] });
            }
        }
        let block = &mut self.blocks[*last];
        let (texel, bit) = (usize::from(key.texel), 1u64 << key.texel);
        if block.wanted & bit == 0 {
            block.wanted |= bit;
            block.places[texel] = self.places.len() as u16;
            self.places.push(*place);
        } else {
            self.places[usize::from(block.places[texel])].improve(place);
        }
    }

    /// The places in the order of blocks and texels.
    fn flatten(&self) -> (Vec<BlockRequest>, Vec<TexelPlace>) {
        let mut places = Vec::with_capacity(self.places.len());
        let blocks = self
            .blocks
            .iter()
            .map(|block| {
                let first = places.len() as u32;
                places.extend(bits(block.wanted).map(|t| self.places[usize::from(block.places[t])]));
                BlockRequest { key: block.key, wanted: block.wanted, first }
            })
            .collect();
        (blocks, places)
    }
}

/// The numbers of the bits that are set, ascending.
pub(super) fn bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let next = (mask != 0).then(|| mask.trailing_zeros() as usize)?;
        mask &= mask - 1;
        Some(next)
    })
}
