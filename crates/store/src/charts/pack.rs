//! Packs charts into pages: shelves by height.

use super::set::PageSize;

/// Widths of a page that are tried, as multiples of the side of a square with the charts' area.
const WIDTHS: [f64; 12] = [1.0, 1.03, 1.06, 1.1, 1.15, 1.2, 1.27, 1.35, 1.45, 1.6, 1.8, 2.0];

/// With more charts than this one width is tried: shelves of many charts are full whatever the width.
const MANY: usize = 20_000;

/// Pages, and where each chart lies: page, x, y.
#[derive(Clone, Debug, Default)]
pub(super) struct Packed {
    pub(super) pages: Vec<PageSize>,
    pub(super) places: Vec<(u32, u16, u16)>,
}

impl Packed {
    /// Texels of all pages.
    pub(super) fn texel_count(&self) -> u64 {
        self.pages.iter().map(|p| u64::from(p.width) * u64::from(p.height)).sum()
    }
}

/// Packs rectangles (width, height, none longer than `max_side`) without overlap.
pub(super) fn pack(sizes: &[[u16; 2]], max_side: u16) -> Packed {
    let mut order: Vec<u32> = (0..sizes.len() as u32).collect();
    order.sort_unstable_by_key(|&i| {
        let [width, height] = sizes[i as usize];
        (std::cmp::Reverse((height, width)), i)
    });
    let area: f64 = sizes.iter().map(|s| f64::from(s[0]) * f64::from(s[1])).sum();
    let widest = sizes.iter().map(|s| s[0]).max().unwrap_or(1);
    let mut best: Option<Packed> = None;
    let tries = if sizes.len() > MANY { &WIDTHS[2..3] } else { &WIDTHS[..] };
    let mut last_width = 0;
    for factor in tries {
        let width = (area.sqrt() * factor).ceil().clamp(f64::from(widest), f64::from(max_side)) as u16;
        if width == last_width {
            continue;
        }
        last_width = width;
        let packed = shelve(sizes, &order, width, max_side);
        if best.as_ref().is_none_or(|b| packed.texel_count() < b.texel_count()) {
            best = Some(packed);
        }
    }
    best.unwrap_or_default()
}

/// A row of rectangles.
struct Shelf {
    page: u32,
    x: u16,
    y: u16,
}

fn shelve(sizes: &[[u16; 2]], order: &[u32], page_width: u16, max_side: u16) -> Packed {
    let mut packed = Packed { pages: Vec::new(), places: vec![(0, 0, 0); sizes.len()] };
    // Shelves with room left, oldest (tallest) first; those that ran full are dropped from the front.
    let mut shelves: Vec<Shelf> = Vec::new();
    let narrowest = sizes.iter().map(|s| s[0]).min().unwrap_or(1);
    for &i in order {
        let [width, height] = sizes[i as usize];
        let found = shelves.iter().position(|s| page_width - s.x >= width);
        let at = found.unwrap_or_else(|| {
            let on_last = packed.pages.last().is_some_and(|p| max_side - p.height >= height);
            if !on_last {
                packed.pages.push(PageSize { width: 0, height: 0 });
            }
            let last = packed.pages.len() - 1;
            let page = &mut packed.pages[last];
            shelves.push(Shelf { page: last as u32, x: 0, y: page.height });
            page.height += height;
            shelves.len() - 1
        });
        let shelf = &mut shelves[at];
        packed.places[i as usize] = (shelf.page, shelf.x, shelf.y);
        shelf.x += width;
        let page = &mut packed.pages[shelf.page as usize];
        page.width = page.width.max(shelf.x);
        if page_width - shelf.x < narrowest {
            shelves.remove(at);
        }
    }
    packed
}
