//! Places the pages of many instances in the layers of one square texture.

use super::set::PageSize;

/// Where a page lies: its first texel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Placement {
    /// Layer of the texture.
    pub layer: u16,
    /// Along x, texels.
    pub x: u16,
    /// Along y, texels.
    pub y: u16,
}

/// Why pages were not placed. Nothing has changed then.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AtlasError {
    /// One page is larger than a layer.
    #[error(
        "atlas: a page of {width}×{height} texels does not fit a layer of {side}×{side}; make its charts with max_side at most {side}"
    )]
    PageTooLarge {
        /// Its width, texels.
        width: u16,
        /// Its height, texels.
        height: u16,
        /// Side of a layer, texels.
        side: u16,
    },
    /// No room in any layer.
    #[error(
        "atlas: no room for {needed} texels: {used} of {limit} are in use ({layers} layers of {side}×{side}); use coarser texels or fewer instances"
    )]
    Full {
        /// Texels of the pages that were to be placed.
        needed: u64,
        /// Texels in use.
        used: u64,
        /// Texels of all layers there may be.
        limit: u64,
        /// Layers there may be.
        layers: u16,
        /// Side of a layer, texels.
        side: u16,
    },
}

/// A rectangle of texels; ends are not part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Rectangle {
    y: u32,
    x: u32,
    y_end: u32,
    x_end: u32,
}

impl Rectangle {
    fn meets(&self, other: &Rectangle) -> bool {
        self.x < other.x_end && other.x < self.x_end && self.y < other.y_end && other.y < self.y_end
    }

    fn holds(&self, other: &Rectangle) -> bool {
        self.x <= other.x && other.x_end <= self.x_end && self.y <= other.y && other.y_end <= self.y_end
    }
}

/// One layer: what is taken, and every largest rectangle that is free (they overlap each other).
#[derive(Clone, Debug)]
struct Layer {
    taken: Vec<Rectangle>,
    free: Vec<Rectangle>,
    /// Something was removed since `free` was made.
    is_stale: bool,
}

impl Layer {
    fn new(side: u16) -> Layer {
        Layer { taken: Vec::new(), free: vec![whole(side)], is_stale: false }
    }

    /// The place that leaves the least room beside it, then the highest, then the leftmost.
    fn find(&mut self, page: PageSize, side: u16) -> Option<Rectangle> {
        if self.is_stale {
            self.is_stale = false;
            self.free = vec![whole(side)];
            for taken in std::mem::take(&mut self.taken) {
                self.take(taken);
            }
        }
        let (width, height) = (u32::from(page.width), u32::from(page.height));
        let fitting = self.free.iter().filter(|f| f.x_end - f.x >= width && f.y_end - f.y >= height);
        let best = fitting.min_by_key(|f| {
            let (beside, below) = (f.x_end - f.x - width, f.y_end - f.y - height);
            (beside.min(below), beside.max(below), f.y, f.x)
        })?;
        Some(Rectangle { x: best.x, y: best.y, x_end: best.x + width, y_end: best.y + height })
    }

    fn take(&mut self, taken: Rectangle) {
        let (met, mut kept): (Vec<_>, Vec<_>) = self.free.iter().partition(|f| f.meets(&taken));
        let mut parts: Vec<Rectangle> = Vec::new();
        for f in met {
            parts.extend(
                [
                    Rectangle { x_end: taken.x, ..f },
                    Rectangle { x: taken.x_end, ..f },
                    Rectangle { y_end: taken.y, ..f },
                    Rectangle { y: taken.y_end, ..f },
                ]
                .into_iter()
                .filter(|r| r.x < r.x_end && r.y < r.y_end),
            );
        }
        parts.sort_unstable();
        parts.dedup();
        for (i, part) in parts.iter().enumerate() {
            let inside = |(j, other): (usize, &Rectangle)| j != i && other.holds(part);
            if !parts.iter().enumerate().any(inside) && !kept.iter().any(|k: &Rectangle| k.holds(part)) {
                kept.push(*part);
            }
        }
        self.free = kept;
        self.taken.push(taken);
    }
}

fn whole(side: u16) -> Rectangle {
    Rectangle { x: 0, y: 0, x_end: u32::from(side), y_end: u32::from(side) }
}

/// Pages of many instances in the layers of one square texture. Pages of one instance need not lie together.
#[derive(Clone, Debug)]
pub struct Atlas {
    side: u16,
    most_layers: u16,
    layers: Vec<Layer>,
}

impl Atlas {
    /// An empty atlas of layers of `side` texels a side (at least 1), at most `most_layers` of them (at least 1).
    pub fn new(side: u16, most_layers: u16) -> Atlas {
        Atlas { side: side.max(1), most_layers: most_layers.max(1), layers: Vec::new() }
    }

    /// An empty atlas with the smallest side that is a power of two, at most `most_side`, and holds all pages in one layer
    /// when they are inserted in this order. If none does, the side is the largest power of two that is at most
    /// `most_side`, or `most_side` itself where a page is larger than that. Largest first fills best.
    pub fn for_pages(pages: &[PageSize], most_side: u16, most_layers: u16) -> Atlas {
        let most_side = most_side.max(1);
        let longest = pages.iter().map(|p| p.width.max(p.height)).max().unwrap_or(1);
        let area: u64 = pages.iter().map(|p| u64::from(p.area())).sum();
        let mut side = 1u32;
        while side < u32::from(longest) || u64::from(side) * u64::from(side) < area {
            side *= 2;
        }
        while side <= u32::from(most_side) {
            if Atlas::new(side as u16, 1).insert(pages).is_ok() {
                return Atlas::new(side as u16, most_layers);
            }
            side *= 2;
        }
        let power = 1u16 << most_side.ilog2();
        Atlas::new(if longest > power { most_side } else { power }, most_layers)
    }

    /// Side of a layer, texels.
    pub fn side(&self) -> u16 {
        self.side
    }

    /// Layers in use so far. It does not shrink.
    pub fn layers(&self) -> u16 {
        self.layers.len() as u16
    }

    /// Texels of the pages that are placed.
    pub fn used_texels(&self) -> u64 {
        let area = |r: &Rectangle| u64::from(r.x_end - r.x) * u64::from(r.y_end - r.y);
        self.layers.iter().flat_map(|l| &l.taken).map(area).sum()
    }

    /// Places pages, one after the other, in the first layer with room. A page without texels lies at 0.
    ///
    /// # Errors
    ///
    /// A page larger than a layer, or no room: then none is placed.
    pub fn insert(&mut self, pages: &[PageSize]) -> Result<Vec<Placement>, AtlasError> {
        let side = self.side;
        if let Some(page) = pages.iter().find(|p| p.width > side || p.height > side) {
            return Err(AtlasError::PageTooLarge { width: page.width, height: page.height, side });
        }
        let layers_before = self.layers.len();
        let mut placements = Vec::with_capacity(pages.len());
        for (i, &page) in pages.iter().enumerate() {
            let Some(placement) = self.insert_one(page) else {
                self.remove(&placements, &pages[..i]);
                self.layers.truncate(layers_before);
                let limit = u64::from(self.most_layers) * u64::from(side) * u64::from(side);
                let needed = pages.iter().map(|p| u64::from(p.area())).sum();
                return Err(AtlasError::Full {
                    needed,
                    used: self.used_texels(),
                    limit,
                    layers: self.most_layers,
                    side,
                });
            };
            placements.push(placement);
        }
        Ok(placements)
    }

    fn insert_one(&mut self, page: PageSize) -> Option<Placement> {
        if page.area() == 0 {
            return Some(Placement::default());
        }
        for index in 0..usize::from(self.most_layers) {
            if index == self.layers.len() {
                self.layers.push(Layer::new(self.side));
            }
            let layer = &mut self.layers[index];
            if let Some(found) = layer.find(page, self.side) {
                layer.take(found);
                return Some(Placement { layer: index as u16, x: found.x as u16, y: found.y as u16 });
            }
        }
        None
    }

    /// Frees pages that [`Atlas::insert`] placed. What does not lie there is left alone.
    pub fn remove(&mut self, placements: &[Placement], pages: &[PageSize]) {
        for (placement, page) in placements.iter().zip(pages) {
            let (x, y) = (u32::from(placement.x), u32::from(placement.y));
            let gone =
                Rectangle { x, y, x_end: x + u32::from(page.width), y_end: y + u32::from(page.height) };
            if let Some(layer) = self.layers.get_mut(usize::from(placement.layer))
                && let Some(at) = layer.taken.iter().position(|t| *t == gone)
            {
                layer.taken.remove(at);
                layer.is_stale = true;
            }
        }
    }
}
