//! How the error falls after everything moved at once: the scene stands still at its start, then jumps to the middle of its path and
//! stands still there.

use anyhow::Result;
use dapple_metrics::psnr_masked;

use super::pair::Pair;
use super::plan::CLIENT_HZ;
use super::results::Settling;
use super::stage::{Frame, Stage};
use super::truth::Cache;
use crate::args::Method;
use crate::picture::Shown;

/// Longest time after the move that is watched, seconds; at least three server steps.
const WATCHED_S: f64 = 1.0;
/// Most server steps that a scene standing at its start gets before the jump, so that nothing of the path is left.
const MAX_STEPS_BEFORE: u32 = 256;
/// So many steps without a change are taken for the end: some servers look elsewhere in each.
const QUIET_STEPS: u32 = 8;
/// The light has settled where this part of the squared difference to what it becomes is left.
const SETTLED: f64 = 0.05;

/// For each method: what is shown at client frames after the move. The server's next step comes a whole period after
/// the move, the worst case. The client draws the new scene at once, with what light it has.
pub(super) fn settle(
    stage: &Stage<'_>,
    pair: &mut Pair,
    methods: &[Method],
    cache: &Cache,
) -> Result<Vec<Settling>> {
    let moved_s = (0.5 * stage.whole_s * CLIENT_HZ).floor() / CLIENT_HZ;
    let frame = stage.middle(moved_s, cache)?;
    let mut quiet = 0;
    for _ in 0..MAX_STEPS_BEFORE {
        let step = pair.step_at(0.0, stage)?;
        quiet = if step.changed || step.backlog > 0 { 0 } else { quiet + 1 };
        if quiet == QUIET_STEPS {
            break;
        }
    }
    let watched_s = WATCHED_S.max(3.0 / pair.hz);
    let frames = (watched_s * CLIENT_HZ).ceil() as u32;
    let mut shown: Vec<Vec<Look>> = methods.iter().map(|_| Vec::new()).collect();
    let mut after_s = Vec::new();
    let (mut steps, mut backlog) = (0, 0);
    for number in 0..=frames {
        let now_s = f64::from(number) / CLIENT_HZ;
        let mut changed = number == 0;
        while f64::from(steps + 1) / pair.hz <= now_s + 1e-9 {
            steps += 1;
            let step = pair.step_at(moved_s, stage)?;
            changed |= step.changed;
            backlog = step.backlog;
        }
        after_s.push(now_s);
        for (method, shown) in methods.iter().zip(&mut shown) {
            if changed {
                shown.push(Look::new(pair, *method, &frame, number as usize)?);
            }
        }
    }
    Ok(shown.iter().map(|looks| settling(looks, &frame, &after_s, backlog > 0)).collect())
}

/// What is shown from one client frame on.
struct Look {
    since: usize,
    visibility: Vec<f32>,
    /// Absent where equal to the truth.
    psnr_db: Option<f64>,
}

impl Look {
    fn new(pair: &Pair, method: Method, frame: &Frame, since: usize) -> Result<Look> {
        let samples = pair.client.visibility(&frame.drawn, method)?;
        let visibility = Shown::new(&frame.drawn, None, Some(&samples))?.into_visibility();
        let psnr_db = match frame.truth.covered_pixels {
            0 => f64::INFINITY,
            _ => psnr_masked(frame.truth.visibility(), &visibility, frame.truth.covered(), 1.0)?,
        };
        Ok(Look { since, visibility, psnr_db: Some(psnr_db).filter(|db| db.is_finite()) })
    }
}

fn settling(looks: &[Look], frame: &Frame, after_s: &[f64], unfinished: bool) -> Settling {
    let difference = |look: &Look| match looks.last() {
        Some(last) => mean_square(&look.visibility, &last.visibility, frame.truth.covered()),
        None => 0.0,
    };
    let behind: Vec<f64> = looks.iter().map(difference).collect();
    let at = |number: usize| looks.partition_point(|look| look.since <= number).saturating_sub(1);
    let first = behind.first().copied().unwrap_or(0.0);
    let limit = SETTLED * first;
    let settled = behind.iter().rposition(|left| *left > limit).map_or(0, |last| last + 1);
    Settling {
        after_s: after_s.to_vec(),
        visibility_psnr_db: (0..after_s.len()).map(|n| looks.get(at(n)).and_then(|l| l.psnr_db)).collect(),
        behind_rms: (0..after_s.len()).map(|n| behind.get(at(n)).map_or(0.0, |b| b.sqrt())).collect(),
        unfinished,
        settled_s: looks
            .get(settled)
            .filter(|_| first > 0.0 && !unfinished)
            .and_then(|look| after_s.get(look.since))
            .copied(),
    }
}

fn mean_square(a: &[f32], b: &[f32], covered: &[bool]) -> f64 {
    let pairs = a.iter().zip(b).zip(covered).filter(|(_, covered)| **covered);
    let (sum, count) = pairs.fold((0.0, 0u64), |(sum, count), ((a, b), _)| {
        let difference = f64::from(*a) - f64::from(*b);
        (sum + difference * difference, count + 1)
    });
    if count == 0 { 0.0 } else { sum / count as f64 }
}
