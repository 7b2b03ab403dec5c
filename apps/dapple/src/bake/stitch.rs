//! Makes both sides of a seam read the same: where a smooth surface was cut to be laid flat, its two borders lie on texels of
//! different places and turns, and bilinear reads along them differ by a little that the eye finds at once.
//!
//! Our own. Texels at seams move as little as they can (in the mean square, each by its weight) so that reads along both borders
//! agree.

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

/// Stitches all seams of a sheet. `weights` say how well each texel is known.
pub(crate) fn stitch(
    surfaces: &Surfaces<'_>,
    copies: &[Copy],
    sheet: &Sheet,
    weights: &[f32],
    planes: &mut Planes,
) {
    let mut rows = Vec::new();
    for (border, other) in seams(surfaces, copies, sheet) {
        add_rows(planes, border, other, &mut rows);
    }
    let mut texels: Vec<u32> = rows.iter().flatten().map(|(texel, _)| *texel).collect();
    texels.sort_unstable();
    texels.dedup();
    for row in &mut rows {
        for (texel, _) in row {
            *texel = texels.partition_point(|t| *t < *texel) as u32;
        }
    }
    let weights: Vec<f64> = texels.iter().map(|&t| f64::from(weights[t as usize])).collect();
    for channel in &mut planes.channels {
        let measured: Vec<f64> = texels.iter().map(|&t| f64::from(channel[t as usize])).collect();
        for (&texel, value) in texels.iter().zip(solve(&rows, &weights, &measured)) {
            channel[texel as usize] = value as f32;
        }
    }
}

/// A border of a seam: where it begins and ends on the image.
type Border = [Vec2; 2];

/// All edges at which a smooth surface continues elsewhere on the image.
fn seams(surfaces: &Surfaces<'_>, copies: &[Copy], sheet: &Sheet) -> Vec<(Border, Border)> {
    let mut by_copy: BTreeMap<u32, Vec<&Patch>> = BTreeMap::new();
    for patch in &sheet.patches {
        by_copy.entry(patch.copy).or_default().push(patch);
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

fn seams_of(mesh: &Mesh, places: &[u32], patches: &[&Patch], seams: &mut Vec<(Border, Border)>) {
    // Ends in order, whether the triangle runs from the higher to the lower, patch, corner.
    let mut edges: Vec<(u32, u32, bool, u32, u8)> = Vec::with_capacity(3 * patches.len());
    for (number, patch) in (0u32..).zip(patches) {
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
        let border = |patch: &Patch, ends: [u8; 2]| ends.map(|k| patch.corners[usize::from(k)]);
        let (a, b) = (border(one, ends), border(two, other_ends));
        let is_same = (0..2).all(|i| (a[i] - b[i]).abs().max_element() < SAME);
        let normal = |patch: &Patch, k: u8| {
            mesh.normals[mesh.triangles[patch.triangle as usize][usize::from(k)] as usize]
        };
        let is_smooth = (0..2).all(|i| normal(one, ends[i]).dot(normal(two, other_ends[i])) > SMOOTH);
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
fn add_rows(planes: &Planes, [a, b]: Border, [c, d]: Border, rows: &mut Vec<Row>) {
    let length = (b - a).length().max((d - c).length());
    if !length.is_finite() {
        return;
    }
    let reads = (length * READS).ceil().clamp(1.0, 1e5) as u32;
    for i in 0..reads {
        let t = (i as f32 + 0.5) / reads as f32;
        let (one, other) = (taps(planes, a.lerp(b, t)), taps(planes, c.lerp(d, t)));
        let side = |k: usize| if k < 4 { one[k] } else { (other[k - 4].0, -other[k - 4].1) };
        rows.push(std::array::from_fn(side));
    }
}

/// The four texels of a bilinear read.
fn taps(planes: &Planes, at: Vec2) -> [(u32, f32); 4] {
    let low = (at - 0.5).floor();
    let f = at - 0.5 - low;
    let clamp = |v: f32, count: usize| (v.max(0.0) as usize).min(count - 1);
    std::array::from_fn(|k| {
        let (dx, dy) = ((k & 1) as f32, (k >> 1) as f32);
        let (x, y) = (clamp(low.x + dx, planes.width), clamp(low.y + dy, planes.height));
        let weight = (1.0 - (dx - f.x).abs()) * (1.0 - (dy - f.y).abs());
        ((y * planes.width + x) as u32, weight)
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

    /// Two borders along which a ramp was measured with an offset: reads agree after, and the mean stays.
    #[test]
    fn both_sides_of_a_seam_read_the_same() {
        let mut planes = Planes::new(32, 16, 1);
        for y in 0..16 {
            for x in 0..32 {
                planes.channels[0][y * 32 + x] = if x < 16 { 0.4 } else { 0.5 } + 0.02 * y as f32;
            }
        }
        // On the right the border is shifted and slants.
        let (a, b): (Border, Border) =
            ([Vec2::new(8.3, 3.0), Vec2::new(8.3, 13.0)], [Vec2::new(24.1, 2.6), Vec2::new(25.6, 12.6)]);
        let mut rows = Vec::new();
        add_rows(&planes, a, b, &mut rows);
        assert_eq!(rows.len(), 21);
        let read = |values: &[f64], row: &Row| -> f64 {
            row.iter().map(|(t, w)| f64::from(*w) * values[*t as usize]).sum()
        };
        let measured: Vec<f64> = planes.channels[0].iter().map(|&v| f64::from(v)).collect();
        let after = solve(&rows, &vec![1.0; measured.len()], &measured);
        for row in &rows {
            assert!((read(&measured, row) + 0.1).abs() < 0.02, "{}", read(&measured, row));
            assert!(read(&after, row).abs() < 0.02, "{}", read(&after, row));
        }
        let moved: Vec<f64> = after.iter().zip(&measured).map(|(a, b)| a - b).collect();
        assert!(moved.iter().sum::<f64>().abs() < 1e-2, "both sides meet half way");
        assert!(moved.iter().all(|m| m.abs() < 0.08));
        // Far from the seam nothing moves.
        assert!((0..16).all(|y| moved[y * 32 + 16] == 0.0 && moved[y * 32] == 0.0));
        // A side of little weight does the moving.
        let light: Vec<f64> = (0..measured.len()).map(|i| if i % 32 < 16 { 1.0 } else { 0.01 }).collect();
        let after = solve(&rows, &light, &measured);
        let left = (0..measured.len()).filter(|i| i % 32 < 16).map(|i| (after[i] - measured[i]).abs());
        assert!(left.fold(0.0, f64::max) < 0.01);
    }
}
