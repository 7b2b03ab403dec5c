//! Makes both sides of a seam read the same: where a smooth surface was cut to be laid flat, its two borders lie on texels of
//! different places and turns, and bilinear reads along them differ by a little that the eye finds at once.
//!
//! Our own. Texels at seams move as little as they can (in the mean square, each by its weight) so that reads along both borders
//! agree, on one image or on two.

use std::collections::{BTreeMap, HashMap};

use dapple_scene::Mesh;
use dapple_scene::glam::Vec2;

use super::fill::Planes;
use super::layout::{Patch, Sheet};
use super::plan::Copy;
use super::surfaces::Surfaces;

/// Least cosine between the normals of both sides for a surface to be smooth across an edge.
const SMOOTH: f32 = 0.9;

/// Weight of a difference between both sides against one to what was measured.
const AGREEMENT: f64 = 8.0;

/// Reads a texel of a seam.
const READS: f32 = 2.0;

/// Borders that are the same in the image too, to this part of a texel, are no seam.
const SAME: f32 = 1e-2;

const MOST_STEPS: usize = 60;
const TOLERANCE: f64 = 1e-3;

/// Texels that a read on one side of a seam takes, less those on the other side.
type Row = [(u32, f32); 8];

/// A texel of one of several images: the image in the upper half.
type Texel = u64;

/// A border of a seam: the image that it lies on, and where it begins and ends there.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Border {
    sheet: usize,
    ends: [Vec2; 2],
}

/// All seams of all images, also from one to another, and what was measured of the texels there.
pub(crate) struct Seams {
    /// Numbers of texels in `texels`.
    rows: Vec<Row>,
    /// Ascending.
    texels: Vec<Texel>,
    /// How well each of them is known.
    weights: Vec<f64>,
    /// For each channel, for each of them what was measured.
    measured: Vec<Vec<f64>>,
}

impl Seams {
    /// Finds the seams of sheets of so many channels.
    pub(crate) fn find(surfaces: &Surfaces<'_>, copies: &[Copy], sheets: &[Sheet], channels: usize) -> Seams {
        let mut reads = Vec::new();
        for (border, other) in seams(surfaces, copies, sheets) {
            add_reads(sheets, border, other, &mut reads);
        }
        Seams::of(&reads, channels)
    }

    fn of(reads: &[[(Texel, f32); 8]], channels: usize) -> Seams {
        let mut texels: Vec<Texel> = reads.iter().flatten().map(|(texel, _)| *texel).collect();
        texels.sort_unstable();
        texels.dedup();
        let number = |texel: Texel| texels.partition_point(|known| *known < texel) as u32;
        let rows = reads.iter().map(|row| row.map(|(texel, weight)| (number(texel), weight))).collect();
        let measured = vec![vec![0.0; texels.len()]; channels];
        Seams { rows, weights: vec![0.0; texels.len()], measured, texels }
    }

    /// Takes what was measured for a sheet. `weights` say how well each of its texels is known.
    pub(crate) fn take(&mut self, sheet: usize, planes: &Planes, weights: &[f32]) {
        let first = self.texels.partition_point(|texel| (texel >> 32) < sheet as u64);
        let of_sheet = self.texels[first..].iter().take_while(|texel| (*texel >> 32) == sheet as u64);
        for (number, texel) in (first..).zip(of_sheet) {
            let at = *texel as u32 as usize;
            self.weights[number] = f64::from(weights[at]);
            for (measured, channel) in self.measured.iter_mut().zip(&planes.channels) {
                measured[number] = f64::from(channel[at]);
            }
        }
    }

    /// Stitches. `put` is told of each texel: its sheet, its number there and what its channels are now.
    pub(crate) fn stitch(self, mut put: impl FnMut(usize, usize, &[f32])) {
        let solved: Vec<Vec<f64>> =
            self.measured.iter().map(|measured| solve(&self.rows, &self.weights, measured)).collect();
        let mut values = vec![0.0; solved.len()];
        for (number, texel) in self.texels.iter().enumerate() {
            for (value, solved) in values.iter_mut().zip(&solved) {
                *value = solved[number] as f32;
            }
            put((texel >> 32) as usize, *texel as u32 as usize, &values);
        }
    }
}

/// All edges at which a smooth surface continues elsewhere on the images.
fn seams(surfaces: &Surfaces<'_>, copies: &[Copy], sheets: &[Sheet]) -> Vec<(Border, Border)> {
    let mut by_copy: BTreeMap<u32, Vec<(usize, &Patch)>> = BTreeMap::new();
    for (sheet, patch) in sheets.iter().enumerate().flat_map(|(i, s)| s.patches.iter().map(move |p| (i, p))) {
        by_copy.entry(patch.copy).or_default().push((sheet, patch));
    }
    let mut places: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let mut seams = Vec::new();
    for (copy, patches) in by_copy {
        let instance = copies[copy as usize].members[0] as usize;
        let mesh = surfaces.mesh_of(instance);
        let index = surfaces.scene.instances[instance].mesh;
        let places = places.entry(index).or_insert_with(|| weld(mesh));
        seams_of(mesh, places, &patches, &mut seams);
    }
    seams
}

fn seams_of(mesh: &Mesh, places: &[u32], patches: &[(usize, &Patch)], seams: &mut Vec<(Border, Border)>) {
    // Ends in order, whether the triangle runs from the higher to the lower, patch, corner.
    let mut edges: Vec<(u32, u32, bool, u32, u8)> = Vec::with_capacity(3 * patches.len());
    for (number, (_, patch)) in (0u32..).zip(patches) {
        let corners = mesh.triangles[patch.triangle as usize].map(|v| places[v as usize]);
        for k in 0..3u8 {
            let (from, to) = (corners[usize::from(k)], corners[usize::from(k + 1) % 3]);
            if from != to {
                edges.push((from.min(to), from.max(to), from > to, number, k));
            }
        }
    }
    edges.sort_unstable();
    for around in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let &[(_, _, false, one, at), (_, _, true, two, other)] = around else { continue };
        // From the lower end to the higher on both sides.
        let (ends, other_ends) = ([at, (at + 1) % 3], [(other + 1) % 3, other]);
        let (one, two) = (patches[one as usize], patches[two as usize]);
        let border = |(sheet, patch): (usize, &Patch), ends: [u8; 2]| Border {
            sheet,
            ends: ends.map(|k| patch.corners[usize::from(k)]),
        };
        let (a, b) = (border(one, ends), border(two, other_ends));
        let is_same =
            a.sheet == b.sheet && (0..2).all(|i| (a.ends[i] - b.ends[i]).abs().max_element() < SAME);
        let normal = |patch: &Patch, k: u8| {
            mesh.normals[mesh.triangles[patch.triangle as usize][usize::from(k)] as usize]
        };
        let is_smooth = (0..2).all(|i| normal(one.1, ends[i]).dot(normal(two.1, other_ends[i])) > SMOOTH);
        if is_smooth && !is_same {
            seams.push((a, b));
        }
    }
}

/// For each vertex the first at its place.
fn weld(mesh: &Mesh) -> Vec<u32> {
    let mut known: HashMap<[u32; 3], u32> = HashMap::new();
    let place = |(index, position): (u32, &dapple_scene::glam::Vec3)| {
        *known.entry(position.to_array().map(|x| (x + 0.0).to_bits())).or_insert(index)
    };
    (0u32..).zip(&mesh.positions).map(place).collect()
}

/// Reads along a seam.
fn add_reads(sheets: &[Sheet], one: Border, other: Border, reads: &mut Vec<[(Texel, f32); 8]>) {
    let length = |border: Border| (border.ends[1] - border.ends[0]).length();
    let length = length(one).max(length(other));
    if !length.is_finite() {
        return;
    }
    let count = (length * READS).ceil().clamp(1.0, 1e5) as u32;
    for i in 0..count {
        let t = (i as f32 + 0.5) / count as f32;
        let at = |border: Border| taps(sheets, border.sheet, border.ends[0].lerp(border.ends[1], t));
        let (one, other) = (at(one), at(other));
        let side = |k: usize| if k < 4 { one[k] } else { (other[k - 4].0, -other[k - 4].1) };
        reads.push(std::array::from_fn(side));
    }
}

/// The four texels of a bilinear read.
fn taps(sheets: &[Sheet], sheet: usize, at: Vec2) -> [(Texel, f32); 4] {
    let (width, height) = (sheets[sheet].width, sheets[sheet].height);
    let low = (at - 0.5).floor();
    let f = at - 0.5 - low;
    let clamp = |v: f32, count: u32| u64::from((v.max(0.0) as u32).min(count - 1));
    std::array::from_fn(|k| {
        let (dx, dy) = ((k & 1) as f32, (k >> 1) as f32);
        let (x, y) = (clamp(low.x + dx, width), clamp(low.y + dy, height));
        let weight = (1.0 - (dx - f.x).abs()) * (1.0 - (dy - f.y).abs());
        ((sheet as u64) << 32 | (y * u64::from(width) + x), weight)
    })
}

/// Minimises Σ weight (x − measured)² + [`AGREEMENT`] Σ (row · x)² by conjugate gradients.
fn solve(rows: &[Row], weights: &[f64], measured: &[f64]) -> Vec<f64> {
    let n = measured.len();
    let mut diagonal = weights.to_vec();
    for (texel, weight) in rows.iter().flatten() {
        diagonal[*texel as usize] += AGREEMENT * f64::from(weight * weight);
    }
    let multiply = |x: &[f64], product: &mut [f64]| {
        for ((product, x), weight) in product.iter_mut().zip(x).zip(weights) {
            *product = weight * x;
        }
        for row in rows {
            let difference: f64 = row.iter().map(|(t, w)| f64::from(*w) * x[*t as usize]).sum();
            for (texel, weight) in row {
                product[*texel as usize] += AGREEMENT * f64::from(*weight) * difference;
            }
        }
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut x = measured.to_vec();
    let mut product = vec![0.0; n];
    multiply(&x, &mut product);
    let mut residual: Vec<f64> = (0..n).map(|i| weights[i] * measured[i] - product[i]).collect();
    let scaled = |residual: &[f64]| residual.iter().zip(&diagonal).map(|(r, d)| r / d).collect::<Vec<f64>>();
    let mut step = scaled(&residual);
    let mut size = dot(&residual, &step);
    let first = size;
    for _ in 0..MOST_STEPS {
        if size.is_nan() || size <= TOLERANCE * TOLERANCE * first {
            break;
        }
        multiply(&step, &mut product);
        let curvature = dot(&step, &product);
        if curvature.is_nan() || curvature <= 0.0 {
            break;
        }
        let length = size / curvature;
        for i in 0..n {
            x[i] += length * step[i];
            residual[i] -= length * product[i];
        }
        let towards = scaled(&residual);
        let new_size = dot(&residual, &towards);
        let turn = new_size / size;
        size = new_size;
        for i in 0..n {
            step[i] = towards[i] + turn * step[i];
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two borders along which a ramp was measured with an offset, the right one on `other` of two sheets: the rows, what was
    /// measured of each texel, and each texel's place.
    fn ramps(other: usize) -> (Vec<Row>, Vec<f64>, Vec<(usize, usize)>) {
        let sheets = vec![Sheet { width: 32, height: 16, ..Sheet::default() }; 2];
        let (a, b) =
            ([Vec2::new(8.3, 3.0), Vec2::new(8.3, 13.0)], [Vec2::new(24.1, 2.6), Vec2::new(25.6, 12.6)]);
        let mut reads = Vec::new();
        // On the right the border is shifted and slants.
        add_reads(&sheets, Border { sheet: 0, ends: a }, Border { sheet: other, ends: b }, &mut reads);
        assert_eq!(reads.len(), 21);
        let mut seams = Seams::of(&reads, 1);
        let mut planes = Planes::new(32, 16, 1);
        for (at, value) in planes.channels[0].iter_mut().enumerate() {
            *value = if at % 32 < 16 { 0.4 } else { 0.5 } + 0.02 * (at / 32) as f32;
        }
        for sheet in [0, 1] {
            seams.take(sheet, &planes, &[1.0; 32 * 16]);
        }
        assert!(seams.weights.iter().all(|weight| *weight == 1.0), "all are taken");
        let places = seams.texels.iter().map(|t| ((t >> 32) as usize, *t as u32 as usize % 32)).collect();
        let measured = seams.measured[0].clone();
        let (rows, mut told) = (seams.rows.clone(), Vec::new());
        let expected = solve(&rows, &vec![1.0; measured.len()], &measured);
        seams.stitch(|_, _, values| told.push(values[0]));
        assert!(told.iter().zip(&expected).all(|(told, expected)| *told == *expected as f32));
        (rows, measured, places)
    }

    #[test]
    fn both_sides_of_a_seam_read_the_same() {
        for other in [0, 1] {
            let (rows, measured, places) = ramps(other);
            let is_left = |i: usize| places[i].1 < 16;
            assert!((0..places.len()).all(|i| is_left(i) || places[i].0 == other));
            let read = |values: &[f64], row: &Row| -> f64 {
                row.iter().map(|(t, w)| f64::from(*w) * values[*t as usize]).sum()
            };
            let after = solve(&rows, &vec![1.0; measured.len()], &measured);
            for row in &rows {
                assert!((read(&measured, row) + 0.1).abs() < 0.02, "{}", read(&measured, row));
                assert!(read(&after, row).abs() < 0.02, "{}", read(&after, row));
            }
            let moved: Vec<f64> = after.iter().zip(&measured).map(|(a, b)| a - b).collect();
            assert!(moved.iter().sum::<f64>().abs() < 1e-2, "both sides meet half way");
            assert!(moved.iter().all(|m| m.abs() < 0.08));
            // A side of little weight does the moving.
            let light: Vec<f64> = (0..measured.len()).map(|i| if is_left(i) { 1.0 } else { 0.01 }).collect();
            let after = solve(&rows, &light, &measured);
            let left = (0..measured.len()).filter(|i| is_left(*i)).map(|i| (after[i] - measured[i]).abs());
            assert!(left.fold(0.0, f64::max) < 0.01);
        }
    }
}
