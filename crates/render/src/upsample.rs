//! Estimates at half the resolution, and brings them up to all samples without crossing edges: joint bilateral upsampling.
//!
//! J. Kopf, M. F. Cohen, D. Lischinski, M. Uyttendaele, *Joint Bilateral Upsampling*, SIGGRAPH 2007: a weight by distance on the picture, times one by how alike
//! two samples of the full picture are. Here that is how near each lies to the plane of the other, and how alike their normals are.

use glam::Vec3;

use crate::gbuffer::Screen;
use crate::{AfterPass, RenderError};

/// How far a sample may lie from another's plane before it counts nothing, in widths of a sample at that distance.
const TOLERANCE_SAMPLES: f32 = 2.0;
/// How fast the weight falls with the angle between normals: 0.56 at 22°, 0.06 at 45°.
const NORMAL_POWER: i32 = 8;
/// Samples of the picture within which others count.
const REACH: f32 = 2.0;
/// Less weight than this in all is none.
const LEAST: f32 = 1e-3;

/// One value a sample of `full`, row-major from the top, 1 for the background, by those of its [`Screen::half`]. A sample that none around is alike gets the value of
/// that one whose plane is the nearest. In parallel by rows in the caller's rayon pool, and the same for any number of threads.
///
/// # Errors
/// A list of another length than the half has samples, or a half of another picture.
pub fn upsample(full: &Screen, half: &Screen, values: &[f32]) -> Result<Vec<f32>, RenderError> {
    let expected = full.columns().div_ceil(2) as usize * full.rows().div_ceil(2) as usize;
    RenderError::check_length("samples at half resolution", half.distances_m().len(), expected)?;
    RenderError::check_length("values at half resolution", values.len(), expected)?;
    Ok(full.map(|at| value_at(full, half, values, at)))
}

/// Estimates at half resolution and upsamples; `after` is told the names of the passes, `half` and `upsampling` among them.
///
/// # Errors
/// What `estimate` fails with, or a list of another length than there are samples.
pub fn at_half_resolution(
    screen: &Screen,
    after: AfterPass<'_>,
    estimate: impl FnOnce(&Screen, AfterPass<'_>) -> Result<Vec<f32>, RenderError>,
) -> Result<Vec<f32>, RenderError> {
    let half = screen.half();
    after("half");
    let values = estimate(&half, after)?;
    let visibility = upsample(screen, &half, &values)?;
    after("upsampling");
    Ok(visibility)
}

fn value_at(full: &Screen, half: &Screen, values: &[f32], at: [usize; 2]) -> f32 {
    let Some(place) = full.position_at(at) else { return 1.0 };
    let normal = full.normals_view()[at[1] * full.columns() as usize + at[0]];
    let centre = full.centre(at);
    let tolerance_m = TOLERANCE_SAMPLES / full.samples_per_metre(-place.z);
    // Column, row and index of those of the half around it.
    let around = || {
        (0..9).filter_map(|i| {
            let (column, row) = ((at[0] / 2 + i % 3).wrapping_sub(1), (at[1] / 2 + i / 3).wrapping_sub(1));
            let inside = column < half.columns() as usize && row < half.rows() as usize;
            inside.then(|| ([column, row], row * half.columns() as usize + column))
        })
    };
    let (mut sum, mut weights) = (0.0, 0.0);
    for (cell, index) in around() {
        let by = half.centre(cell);
        let near = |axis: usize| (1.0 - (2.0 * by[axis] - centre[axis]).abs() / REACH).max(0.0);
        let near = near(0) * near(1);
        if near == 0.0 {
            continue;
        }
        let Some(other) = half.position_view(index) else { continue };
        let other_normal = half.normals_view()[index];
        let off_m = off_plane_m(other - place, normal, other_normal);
        let alike = normal.dot(other_normal).max(0.0).powi(NORMAL_POWER);
        let weight = near * alike * (1.0 - off_m / tolerance_m).max(0.0);
        sum += weight * values[index];
        weights += weight;
    }
    if weights > LEAST {
        return sum / weights;
    }
    let (mut nearest_m, mut nearest) = (f32::INFINITY, 1.0);
    for (_, index) in around() {
        let Some(other) = half.position_view(index) else { continue };
        let off_m = off_plane_m(other - place, normal, half.normals_view()[index]);
        if off_m < nearest_m {
            (nearest_m, nearest) = (off_m, values[index]);
        }
    }
    nearest
}

/// How far each of two places lies from the plane of the other: the farther. Without normals, how far they are apart.
fn off_plane_m(by: Vec3, normal: Vec3, other: Vec3) -> f32 {
    if normal == Vec3::ZERO || other == Vec3::ZERO {
        return by.length();
    }
    by.dot(normal).abs().max(by.dot(other).abs())
}

#[cfg(test)]
mod tests {
    use dapple_scene::{PosedCamera, Projection};

    use super::*;
    use crate::alchemy::{self, AlchemyParams};
    use crate::gtao::{self, GtaoParams};
    use crate::hbao::{self, HbaoParams};
    use crate::sao::{self, SaoParams};
    use crate::ssao::{self, SsaoParams};
    use crate::testing::screen::{check_pictures, check_walls, draw, look, still_life};

    type Method = Box<dyn Fn(&Screen) -> Vec<f32> + Sync>;

    /// Every method with its defaults.
    fn methods() -> Vec<(&'static str, Method)> {
        vec![
            ("ssao", Box::new(|s| ssao::estimate_visibility(s, &SsaoParams::default()).unwrap())),
            ("alchemy", Box::new(|s| alchemy::estimate_visibility(s, &AlchemyParams::default()).unwrap())),
            ("sao", Box::new(|s| sao::estimate_visibility(s, &SaoParams::default()).unwrap())),
            ("hbao", Box::new(|s| hbao::estimate_visibility(s, &HbaoParams::hbao()).unwrap())),
            ("hbao-plus", Box::new(|s| hbao::estimate_visibility(s, &HbaoParams::hbao_plus()).unwrap())),
            ("gtao", Box::new(|s| gtao::estimate_visibility(s, &GtaoParams::default()).unwrap())),
        ]
    }

    fn cameras() -> [PosedCamera; 2] {
        let camera = look(Vec3::new(3.2, 2.4, 1.8), Vec3::new(0.5, 0.5, 0.0));
        let projection = Projection::Orthographic { half_height: 1.6, near: -3.0, far: 20.0 };
        [camera, PosedCamera { projection, ..camera }]
    }

    #[test]
    fn constants_stay_and_sizes_may_be_odd() {
        for camera in cameras() {
            for size in [[1, 1], [2, 1], [1, 3], [33, 1], [61, 37], [64, 48]] {
                let (gbuffer, screen) = draw(&still_life(), &camera, size);
                let half = screen.half();
                let values = upsample(&screen, &half, &vec![0.25; half.distances_m().len()]).unwrap();
                assert_eq!(values.len(), gbuffer.samples().len());
                for (value, sample) in values.iter().zip(gbuffer.samples()) {
                    let near = half.distances_m().iter().any(|d| d.is_finite());
                    let expected = if sample.is_covered() && near { 0.25 } else { 1.0 };
                    // A sample without any other of a surface around is taken for open.
                    assert!((value - expected).abs() < 1e-6 || *value == 1.0, "{size:?}: {value}");
                }
                let kept = values.iter().filter(|v| (**v - 0.25).abs() < 1e-6).count();
                let covered = gbuffer.samples().iter().filter(|s| s.is_covered()).count();
                assert!(kept * 100 >= covered * 99 || covered < 40, "{size:?}: {kept} of {covered}");
            }
        }
    }

    #[test]
    fn walls_are_open_and_pictures_are_pictures() {
        for (name, estimate) in methods() {
            println!("{name}");
            let halved = |screen: &Screen| {
                at_half_resolution(screen, &mut |_| (), |half, _| Ok(estimate(half))).unwrap()
            };
            check_walls(&halved, 60.0, 0.98);
            check_pictures(&halved);
        }
    }

    #[test]
    fn values_do_not_leak_over_edges() {
        for camera in cameras() {
            let (gbuffer, screen) = draw(&still_life(), &camera, [160, 120]);
            let half = screen.half();
            // Each instance has its own value.
            let value = |instance: u32| if instance.is_multiple_of(2) { 0.0 } else { 1.0 };
            let values: Vec<f32> = (0..half.distances_m().len())
                .map(|i| {
                    let columns = half.columns() as usize;
                    let [column, row] = half.centre([i % columns, i / columns]).map(|c| (2.0 * c) as usize);
                    value(gbuffer.samples()[row * 160 + column].instance)
                })
                .collect();
            let found = upsample(&screen, &half, &values).unwrap();
            let covered = |i: &usize| gbuffer.samples()[*i].is_covered();
            let off: Vec<f32> = (0..found.len())
                .filter(covered)
                .map(|i| (found[i] - value(gbuffer.samples()[i].instance)).abs())
                .collect();
            let wrong = off.iter().filter(|off| **off > 0.1).count();
            let mean = off.iter().sum::<f32>() / off.len() as f32;
            // Where bodies touch, and at what is narrower than two samples.
            assert!(wrong * 200 < off.len() && mean < 0.004, "{wrong} of {}, mean {mean}", off.len());
        }
    }

    #[test]
    fn half_resolution_is_near_the_full_one() {
        for camera in cameras() {
            let (_, screen) = draw(&still_life(), &camera, [320, 240]);
            for (name, estimate) in methods() {
                let full = estimate(&screen);
                let halved = at_half_resolution(&screen, &mut |_| (), |half, _| Ok(estimate(half))).unwrap();
                let off = full.iter().zip(&halved).map(|(a, b)| (a - b).abs());
                let mean = off.sum::<f32>() / full.len() as f32;
                println!("{name}: {mean}");
                assert!(mean > 1e-5 && mean < 0.03, "{name}: {mean}");
            }
        }
    }

    #[test]
    fn lists_must_fit() {
        let (_, screen) = draw(&still_life(), &cameras()[0], [9, 6]);
        let half = screen.half();
        assert!(upsample(&screen, &half, &[0.0; 14]).unwrap_err().to_string().contains("15"));
        assert!(upsample(&screen, &screen, &[0.0; 15]).is_err());
    }
}
