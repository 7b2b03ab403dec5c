//! The sampling pass: places on a spiral around each sample, and the mean of what they block (sec. 2.3).

use glam::Vec3;
use rayon::prelude::*;

use super::{Pyramid, SaoParams};
use crate::gbuffer::Screen;
use crate::noise::alchemy_turn;
use crate::obscurance::Obscurance;

/// Samples that are farther apart than this along the view axis are not averaged in a quad, metres.
const QUAD_EDGE_M: f32 = 0.02;

/// Visibility by eq. 1 of each sample, row-major from the top, noisy: 0 … 1, and 1 for the background. The parameters must have passed
/// [`SaoParams::check`], the pyramid be that of the picture.
pub fn sample_obscurance(screen: &Screen, pyramid: &Pyramid, params: &SaoParams) -> Vec<f32> {
    let sampler = Sampler::new(screen, pyramid, params);
    screen.map(|at| sampler.visibility_at(at, &mut |_, _, _| ()))
}

/// The sampling pass of a picture, sample by sample.
pub struct Sampler<'a> {
    screen: &'a Screen,
    pyramid: &'a Pyramid,
    params: &'a SaoParams,
    estimator: Obscurance,
    /// Of each place the part of the radius, and the angle.
    spiral: Vec<(f32, f32)>,
}

impl<'a> Sampler<'a> {
    /// The parameters must have passed [`SaoParams::check`], the pyramid be that of the picture.
    pub fn new(screen: &'a Screen, pyramid: &'a Pyramid, params: &'a SaoParams) -> Sampler<'a> {
        let estimator = params.estimator();
        let spiral = estimator.spiral();
        Sampler { screen, pyramid, params, estimator, spiral }
    }

    /// What the sample in a column and row reads, in its order: the number of the read (0: its own distance; then the places, of which those outside of the picture
    /// are not read), the level, and column and row there. What its quad shares is not read again.
    pub fn visit_reads(&self, at: [usize; 2], visit: &mut impl FnMut(usize, usize, [usize; 2])) {
        self.visibility_at(at, visit);
    }

    /// Eq. 1. A visitor that does nothing costs nothing.
    fn visibility_at(&self, at: [usize; 2], visit: &mut impl FnMut(usize, usize, [usize; 2])) -> f32 {
        let (screen, pyramid, params) = (self.screen, self.pyramid, self.params);
        visit(0, 0, at);
        let Some(place) = screen.position_at(at) else { return 1.0 };
        let normal = normal_seen(screen, at);
        let radius = params.radius_m * screen.samples_per_metre(-place.z);
        let turn = alchemy_turn(at);
        let top = pyramid.levels() - 1;
        let mut sum = 0.0;
        for (number, (part, angle)) in self.spiral.iter().enumerate() {
            let length = radius * part;
            let (sin, cos) = libm::sincosf(angle + turn);
            let Some(seen) = screen.neighbour(at, [length * cos, length * sin]) else { continue };
            // Eq. 9: the higher the farther it is on the screen.
            let level = (length as u32).checked_ilog2().unwrap_or(0).saturating_sub(params.switch_log2);
            let level = (level as usize).min(top);
            visit(number + 1, level, seen.map(|at| at >> level));
            let (seen_m, [column, row]) = pyramid.read(screen, level, seen);
            if seen_m.is_finite() {
                let seen = screen.place_view(column, row, seen_m);
                sum += self.estimator.term(seen - place, normal, -place.z);
            }
        }
        self.estimator.visibility(sum)
    }
}

/// From depths; at half resolution, where they lie twice as far apart, the geometry's, which upsampling needs there anyway.
pub(super) fn normal_seen(screen: &Screen, at: [usize; 2]) -> Vec3 {
    let own = screen.normals_view()[at[1] * screen.columns() as usize + at[0]];
    if screen.is_half() && own != Vec3::ZERO { own } else { normal_view(screen, at) }
}

/// Eq. 4: the face's normal, from the places that a sample's quad of 2 × 2 shows. Towards the eye. A picture of one row or column, and an edge of the background, leave
/// the picture's own axes.
pub(crate) fn normal_view(screen: &Screen, [column, row]: [usize; 2]) -> Vec3 {
    let columns = screen.columns() as usize;
    let place = |column: usize, row: usize| {
        let inside = column < columns && row < screen.rows() as usize;
        inside.then(|| screen.position_view(row * columns + column)).flatten()
    };
    let difference = |from: [usize; 2], to: [usize; 2]| Some(place(to[0], to[1])? - place(from[0], from[1])?);
    // The last of an odd row or column has no quad: its pair is the one before.
    let first =
        |at: usize, count: usize| if (at | 1) < count { at & !1 } else { (at & !1).saturating_sub(1) };
    let (left, top) = (first(column, columns), first(row, screen.rows() as usize));
    let along_row = difference([left, row], [left + 1, row]).unwrap_or(Vec3::X);
    let down = difference([column, top], [column, top + 1]).unwrap_or(Vec3::NEG_Y);
    // Down the picture is −y.
    down.cross(along_row).try_normalize().unwrap_or(Vec3::Z)
}

/// Averages the values of quads of 2 × 2 samples where there is no edge (end of sec. 2.3): first along rows, then along columns.
pub fn filter_quads(screen: &Screen, visibility: &mut [f32]) {
    let columns = screen.columns() as usize;
    let distances_m = screen.distances_m();
    visibility.par_chunks_mut(2 * columns).zip(distances_m.par_chunks(2 * columns)).for_each(
        |(values, distances)| {
            let rows = values.len() / columns;
            let average = |values: &mut [f32], a: usize, b: usize| {
                if (distances[a] - distances[b]).abs() < QUAD_EDGE_M {
                    let mean = 0.5 * (values[a] + values[b]);
                    (values[a], values[b]) = (mean, mean);
                }
            };
            for row in 0..rows {
                for column in (0..columns - columns % 2).step_by(2) {
                    average(values, row * columns + column, row * columns + column + 1);
                }
            }
            if rows == 2 {
                for column in 0..columns {
                    average(values, column, columns + column);
                }
            }
        },
    );
}
