//! Bent normals and cones: not only how much around a place is open, but where (\[Vermeer2021\] sec. 4).

use dapple_scene::PosedCamera;
use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::hidden::Lookup;
use crate::RenderError;
use crate::bilateral::Bilateral;
use crate::gbuffer::Screen;
use crate::hbao::{Estimator, HbaoParams};

/// Where samples of a picture are open.
#[derive(Clone, Debug, PartialEq)]
pub struct BentNormals {
    /// How much, by cosine, 0 … 1; 1 for the background. As much as the method finds, or more: here each direction blocks at most itself, there all together
    /// at most all.
    pub visibility: Vec<f32>,
    /// Mean by cosine of open directions, blocked ones as zero, in view space: 2/3 of the normal if all is open; zero for the background.
    pub open_view: Vec<Vec3>,
}

impl BentNormals {
    /// The same means in the world: what [`Openings::Traced`](crate::shade::Openings::Traced) takes.
    pub fn open_world(&self, camera: &PosedCamera) -> Vec<Vec3> {
        let world_from_view = Mat3::from(camera.world_from_view.matrix3);
        self.open_view.iter().map(|open| world_from_view * *open).collect()
    }

    /// Cones that are as open: unit vectors in view space (zero where nothing is open), and cosines of half their angles. A cone about the normal of that angle has
    /// the visibility 1 − cos².
    pub fn cones(&self) -> Vec<(Vec3, f32)> {
        let cone = |(open, visibility): (&Vec3, &f32)| {
            (open.normalize_or_zero(), (1.0 - visibility).clamp(0.0, 1.0).sqrt())
        };
        self.open_view.iter().zip(&self.visibility).map(cone).collect()
    }
}

/// Bent normals by HBAO or HBAO+, with what is known of hidden surfaces: what a direction of the picture finds blocks all that is lower over the surface there, as
/// much as it blocks by cosine. In parallel in the caller's rayon pool, and the same for any number of threads.
///
/// # Errors
/// A parameter out of its range, or hidden surfaces of another picture.
pub fn bent_normals(
    screen: &Screen,
    params: &HbaoParams,
    lookup: &Lookup<'_>,
) -> Result<BentNormals, RenderError> {
    params.check()?;
    lookup.check(screen)?;
    let estimator = Estimator::new(screen, params, lookup);
    let columns = screen.columns() as usize;
    let one = |index: usize| -> (f32, Vec3) {
        let Some(centre) = estimator.centre([index % columns, index / columns]) else {
            return (1.0, Vec3::ZERO);
        };
        let (mut blocked, mut missing) = (0.0, Vec3::ZERO);
        for direction in 0..params.directions {
            let direction = estimator.direction(&centre, direction);
            // Up to a height h over the surface all is blocked: sin² h of a direction's part, by cosine.
            let part = (params.strength * estimator.along(&centre, direction)).clamp(0.0, 1.0);
            if part > 0.0 {
                let (sin, cos) = (part.sqrt(), (1.0 - part).sqrt());
                let along = estimator.tangent(&centre, direction).map_or(Vec3::ZERO, Vec3::normalize_or_zero);
                // The mean by cosine of what lies under h: 2/3 of this.
                missing += along * (1.0 - cos * cos * cos) + centre.normal * (sin * sin * sin);
                blocked += part;
            }
        }
        let directions = params.directions as f32;
        (1.0 - blocked / directions, (centre.normal - missing / directions) * (2.0 / 3.0))
    };
    let samples = (0..screen.distances_m().len()).into_par_iter().with_min_len(columns);
    let (visibility, open_view): (Vec<f32>, Vec<Vec3>) = samples.map(one).unzip();
    let blur = Bilateral::within(params.radius_m, params.blur_taps);
    let axes = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| {
        let values: Vec<f32> = open_view.iter().map(|open| open.dot(axis)).collect();
        blur.smooth(screen, &values)
    });
    let [x, y, z] = &axes;
    let open_view = (0..open_view.len()).map(|i| Vec3::new(x[i], y[i], z[i])).collect();
    Ok(BentNormals { visibility: blur.smooth(screen, &visibility), open_view })
}
