//! Which place of which triangle each texel of an image stands for: four sub-samples a texel, or the nearest place where a
//! triangle only touches it.

use dapple_scene::glam::DVec2;

use super::layout::{Patch, Sheet};

/// Sub-samples of a texel along each axis.
pub(crate) const SUB: usize = 2;

/// A place on one of a sheet's patches; the weights are those of the second and third corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OnPatch {
    pub(crate) patch: u32,
    pub(crate) weights: [f32; 2],
}

/// Rows of a sheet, with the patches that reach them.
pub(crate) struct Band {
    pub(crate) rows: std::ops::Range<u32>,
    pub(crate) patches: Vec<u32>,
}

/// Cuts a sheet into bands of so many rows; patches are in order in each.
pub(crate) fn bands(sheet: &Sheet, rows: u32) -> Vec<Band> {
    let count = sheet.height.div_ceil(rows);
    let mut bands: Vec<Band> = (0..count)
        .map(|i| Band { rows: i * rows..((i + 1) * rows).min(sheet.height), patches: Vec::new() })
        .collect();
    for (index, patch) in (0u32..).zip(&sheet.patches) {
        let ys = patch.corners.map(|c| f64::from(c.y));
        if !ys.iter().all(|y| y.is_finite()) {
            continue;
        }
        let low = ys.iter().copied().fold(f64::INFINITY, f64::min) - 1.5;
        let high = ys.iter().copied().fold(f64::NEG_INFINITY, f64::max) + 1.5;
        let band = |y: f64| (y.clamp(0.0, f64::from(sheet.height - 1)) as u32 / rows) as usize;
        for band in &mut bands[band(low)..=band(high)] {
            band.patches.push(index);
        }
    }
    bands
}

/// The places that a texel stands for.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Texel {
    /// One to four; none where nothing is near.
    pub(crate) places: Vec<OnPatch>,
    /// It lies outside of all triangles; its place is the one nearest to it.
    pub(crate) is_outside: bool,
}

/// The texels of a band, row by row.
pub(crate) fn rasterize(sheet: &Sheet, band: &Band) -> Vec<Texel> {
    let (width, first) = (sheet.width as usize, band.rows.start as usize);
    let height = band.rows.len();
    let mut owners = vec![u32::MAX; width * height * SUB * SUB];
    for &index in &band.patches {
        let corners = corners(&sheet.patches[index as usize]).map(|c| c * SUB as f64);
        cover(corners, width * SUB, first * SUB..(first + height) * SUB, |x, y| {
            let owner = &mut owners[(y - first * SUB) * width * SUB + x];
            // Patches lie apart; on a border the first one has it.
            if *owner == u32::MAX {
                *owner = index;
            }
        });
    }
    let mut texels = vec![Texel::default(); width * height];
    for (at, &patch) in owners.iter().enumerate().filter(|(_, owner)| **owner != u32::MAX) {
        let (x, y) = (at % (width * SUB), at / (width * SUB));
        let centre = DVec2::new(x as f64 + 0.5, (y + first * SUB) as f64 + 0.5) / SUB as f64;
        let weights = closest(corners(&sheet.patches[patch as usize]), centre).0;
        texels[y / SUB * width + x / SUB].places.push(OnPatch { patch, weights: inwards(weights) });
    }
    touch(sheet, band, &mut texels);
    texels
}

/// Gives texels that no sub-sample of a triangle falls into, but a bilinear read inside of one reaches, the place nearest to
/// them.
fn touch(sheet: &Sheet, band: &Band, texels: &mut [Texel]) {
    let (width, first) = (sheet.width as usize, band.rows.start as usize);
    let mut nearest: Vec<(f64, u32)> = texels
        .iter()
        .map(|texel| (if texel.places.is_empty() { f64::INFINITY } else { f64::NEG_INFINITY }, u32::MAX))
        .collect();
    for &index in &band.patches {
        let corners = corners(&sheet.patches[index as usize]);
        let low = corners[0].min(corners[1]).min(corners[2]) - 1.0;
        let high = corners[0].max(corners[1]).max(corners[2]) + 1.0;
        let clamp = |v: f64, limit: usize| v.clamp(0.0, limit as f64) as usize;
        let (columns, last) = (clamp(low.x, width)..clamp(high.x + 1.0, width), band.rows.end as usize);
        for y in clamp(low.y, last).max(first)..clamp(high.y + 1.0, last) {
            for x in columns.clone() {
                let at = (y - first) * width + x;
                if nearest[at].0 == f64::NEG_INFINITY {
                    continue;
                }
                let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let (_, place) = closest(corners, centre);
                let distance = place.distance_squared(centre);
                // A bilinear read reaches less than a texel along each axis.
                if distance < 2.0 && distance < nearest[at].0 {
                    nearest[at] = (distance, index);
                }
            }
        }
    }
    for (at, &(_, patch)) in nearest.iter().enumerate().filter(|(_, found)| found.1 != u32::MAX) {
        let centre = DVec2::new((at % width) as f64 + 0.5, (at / width + first) as f64 + 0.5);
        let weights = closest(corners(&sheet.patches[patch as usize]), centre).0;
        let places = vec![OnPatch { patch, weights: inwards(weights) }];
        texels[at] = Texel { places, is_outside: true };
    }
}

fn corners(patch: &Patch) -> [DVec2; 3] {
    patch.corners.map(|c| DVec2::new(f64::from(c.x), f64::from(c.y)))
}

/// Never quite on a border, where another surface may begin.
fn inwards([v, w]: [f64; 2]) -> [f32; 2] {
    [v, w].map(|x| (1e-3 / 3.0 + 0.999 * x.clamp(0.0, 1.0)) as f32)
}

/// Visits the samples (centres at ½) inside a triangle, of those columns and rows.
fn cover(
    corners: [DVec2; 3],
    columns: usize,
    rows: std::ops::Range<usize>,
    mut visit: impl FnMut(usize, usize),
) {
    let low = corners[0].y.min(corners[1].y).min(corners[2].y);
    let high = corners[0].y.max(corners[1].y).max(corners[2].y);
    let first = (low - 0.5).ceil().max(rows.start as f64) as usize;
    for y in first..rows.end {
        let level = y as f64 + 0.5;
        if level > high {
            break;
        }
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            if (a.y <= level) != (b.y <= level) {
                let x = a.x + (level - a.y) / (b.y - a.y) * (b.x - a.x);
                left = left.min(x);
                right = right.max(x);
            }
        }
        let mut x = (left - 0.5).ceil().max(0.0);
        while x + 0.5 <= right && x < columns as f64 {
            visit(x as usize, y);
            x += 1.0;
        }
    }
}

/// The place of a triangle that is closest to `p`: the weights of its second and third corner, and where it is.
fn closest([a, b, c]: [DVec2; 3], p: DVec2) -> ([f64; 2], DVec2) {
    let doubled = (b - a).perp_dot(c - a);
    if doubled != 0.0 {
        let (v, w) = ((p - a).perp_dot(c - a) / doubled, (b - a).perp_dot(p - a) / doubled);
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
            return ([v, w], p);
        }
    }
    let mut best = (f64::INFINITY, [0.0, 0.0], a);
    let edges =
        [(a, b, [0.0, 0.0], [1.0, 0.0]), (b, c, [1.0, 0.0], [0.0, 1.0]), (c, a, [0.0, 1.0], [0.0, 0.0])];
    for (from, to, from_weights, to_weights) in edges {
        let edge = to - from;
        let length = edge.length_squared();
        let t = if length > 0.0 { ((p - from).dot(edge) / length).clamp(0.0, 1.0) } else { 0.0 };
        let place = from + edge * t;
        let distance = place.distance_squared(p);
        if distance < best.0 {
            let mix = |k: usize| from_weights[k] + t * (to_weights[k] - from_weights[k]);
            best = (distance, [mix(0), mix(1)], place);
        }
    }
    (best.1, best.2)
}

#[cfg(test)]
mod tests {
    use dapple_scene::glam::Vec2;

    use super::*;

    fn sheet(width: u32, height: u32, triangles: &[[[f32; 2]; 3]]) -> Sheet {
        let patches = (0u32..)
            .zip(triangles)
            .map(|(triangle, corners)| Patch { copy: 0, triangle, corners: corners.map(Vec2::from) })
            .collect();
        Sheet { width, height, repeats: false, patches }
    }

    fn all(sheet: &Sheet, rows: u32) -> Vec<Texel> {
        bands(sheet, rows).iter().flat_map(|band| rasterize(sheet, band)).collect()
    }

    #[test]
    fn bands_do_not_matter() {
        let sheet = sheet(
            16,
            13,
            &[
                [[1.0, 1.0], [14.0, 2.0], [3.0, 11.0]],
                [[14.0, 2.0], [15.0, 12.0], [3.0, 11.0]],
                [[8.0, 0.0]; 3],
            ],
        );
        let whole = all(&sheet, 13);
        for rows in [1, 2, 5] {
            assert_eq!(all(&sheet, rows), whole, "{rows} rows a band");
        }
    }

    #[test]
    fn every_texel_that_a_read_reaches_has_a_place_near_it() {
        // Of all shapes, slivers too.
        let triangles = [
            [[2.2, 3.1], [9.7, 4.0], [5.0, 11.3]],
            [[20.0, 2.0], [20.3, 14.0], [20.1, 8.0]],
            [[12.0, 12.5], [18.0, 12.6], [12.0, 12.4]],
            [[25.5, 5.5], [25.6, 5.5], [25.5, 5.6]],
        ];
        let sheet = sheet(32, 16, &triangles);
        let texels = all(&sheet, 4);
        for (index, corners) in triangles.iter().enumerate() {
            let corners = corners.map(|c| DVec2::new(f64::from(c[0]), f64::from(c[1])));
            for i in 0..=40 {
                for j in 0..=40 - i {
                    let (v, w) = (f64::from(i) / 40.0, f64::from(j) / 40.0);
                    let p = corners[0] + (corners[1] - corners[0]) * v + (corners[2] - corners[0]) * w;
                    let base = (p - 0.5).floor();
                    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                        let texel = base + DVec2::new(dx, dy);
                        let share = (1.0 - (p - 0.5 - texel).abs()).max(DVec2::ZERO);
                        if share.x * share.y < 1e-9 {
                            continue;
                        }
                        let list = &texels[texel.y as usize * 32 + texel.x as usize].places;
                        assert!(!list.is_empty(), "triangle {index} at {p} reads an empty texel {texel}");
                        for place in list {
                            assert_eq!(place.patch as usize, index);
                            let [v, w] = place.weights.map(f64::from);
                            assert!(v > 0.0 && w > 0.0 && v + w < 1.0, "{place:?}");
                            let q =
                                corners[0] + (corners[1] - corners[0]) * v + (corners[2] - corners[0]) * w;
                            let apart = (q - texel - 0.5).abs().max_element();
                            assert!(apart < 1.42, "{q} stands for texel {texel}");
                        }
                    }
                }
            }
        }
        // A texel in the middle has all four of its places.
        assert_eq!(texels[6 * 32 + 5].places.len(), SUB * SUB);
        let far = texels[31].places.len() + texels[15 * 32].places.len();
        assert_eq!(far, 0, "nothing reads there");
    }

    #[test]
    fn neighbours_share_no_place() {
        let square = [[[2.0, 2.0], [12.0, 2.0], [12.0, 12.0]], [[2.0, 2.0], [12.0, 12.0], [2.0, 12.0]]];
        let sheet = sheet(16, 16, &square);
        let inner: usize = all(&sheet, 16).iter().filter(|texel| texel.places.len() == SUB * SUB).count();
        assert_eq!(inner, 100, "every texel inside, once");
    }
}
