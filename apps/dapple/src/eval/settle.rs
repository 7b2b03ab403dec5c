//! How the error falls after everything moved at once: the scene jumps to the middle of its path and stands still there.

use anyhow::Result;
use dapple_client::Reconstruction;
use dapple_metrics::{psnr_masked, settling_time};

use super::pair::Pair;
use super::plan::CLIENT_HZ;
use super::results::Settling;
use super::stage::Stage;
use super::truth::Cache;
use crate::picture::Shown;

/// Longest time after the move that is watched, seconds; at least three server steps.
const WATCHED_S: f64 = 1.0;
/// The error has settled where it stays within this factor of its last value.
const SETTLED: f64 = 1.1;

/// For each way to look the light up: PSNR of visibility at client frames after the move. The server's next step comes a whole period after
/// the move, the worst case. The client draws the new scene at once, with what light it has.
pub(super) fn settle(
    stage: &Stage<'_>,
    pair: &mut Pair,
    looks: &[Reconstruction],
    cache: &Cache,
) -> Result<Vec<Settling>> {
    let moved_s = (0.5 * stage.seconds * CLIENT_HZ).floor() / CLIENT_HZ;
    let frame = stage.middle(moved_s, cache)?;
    let watched_s = WATCHED_S.max(3.0 / pair.hz);
    let frames = (watched_s * CLIENT_HZ).ceil() as u32;
    let mut errors: Vec<Vec<Option<f64>>> = vec![Vec::new(); looks.len()];
    let mut after_s = Vec::new();
    let mut steps = 0;
    for number in 0..=frames {
        let now_s = f64::from(number) / CLIENT_HZ;
        let mut changed = number == 0;
        while f64::from(steps + 1) / pair.hz <= now_s + 1e-9 {
            steps += 1;
            changed |= pair.step_at(moved_s, stage)?;
        }
        after_s.push(now_s);
        for (look, errors) in looks.iter().zip(&mut errors) {
            let error = match errors.last() {
                Some(last) if !changed => *last,
                _ => {
                    let visibility = pair.client.visibility(&frame.drawn, look);
                    let shown = Shown::new(&frame.drawn, Some(&visibility))?;
                    let [truth, test] = [&frame.truth, &shown].map(Shown::visibility);
                    let psnr_db = match frame.truth.covered_pixels {
                        0 => f64::INFINITY,
                        _ => psnr_masked(truth, test, frame.truth.covered(), 1.0)?,
                    };
                    Some(psnr_db).filter(|db| db.is_finite())
                }
            };
            errors.push(error);
        }
    }
    Ok(errors
        .into_iter()
        .map(|visibility_psnr_db| {
            let mse: Vec<f64> = visibility_psnr_db
                .iter()
                .map(|db| db.map_or(0.0, |db| libm::pow(10.0, -db / 10.0)))
                .collect();
            let settled_s = settling_time(&after_s, &mse, SETTLED);
            Settling { after_s: after_s.clone(), visibility_psnr_db, settled_s }
        })
        .collect())
}
