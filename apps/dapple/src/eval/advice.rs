//! What the figures of a case cannot tell, and what to do about it.

use super::figures::{FrameError, pooled_mse, psnr_difference};
use super::results::{Case, Row};
use super::table;

/// The truth's noise matters where it is this part of the error that was measured: 0.2 dB.
const NOISE_PART: f64 = 0.05;

/// Sentences about one case.
pub(super) fn of(case: &Case) -> Vec<String> {
    let mut advice = Vec::new();
    noise(case, &mut advice);
    ties(case, &mut advice);
    let frames = case.truth.frames.len();
    if frames < 3 {
        let count = if frames == 1 { "one picture says" } else { "two pictures say" };
        advice
            .push(format!("{count} little about the others of the path: intervals need --frames 3 or more"));
    }
    if case.seconds < 1.0 && case.rows.iter().any(|row| row.kbit_per_s.is_some()) {
        advice.push(format!(
            "{:.2} s are too short for a bit rate: raise --seconds to at least 1, or leave it out",
            case.seconds
        ));
    }
    let unfinished: Vec<String> = case
        .rows
        .iter()
        .filter(|row| row.settling.as_ref().is_some_and(|settling| settling.unfinished))
        .map(table::name)
        .collect();
    if !unfinished.is_empty() {
        advice.push(format!(
            "points still waited for rays or bits when watching after the move ended, so there is no time until the light settles: \
             {}; raise --ray-budget or --budget",
            unfinished.join(", ")
        ));
    }
    let empty: Vec<String> =
        case.truth.frames.iter().filter(|f| f.covered_pixels == 0).map(seconds).collect();
    if !empty.is_empty() {
        advice.push(format!(
            "the picture{} at {} s show{} no geometry, so visibility is not compared there: choose another --path",
            if empty.len() > 1 { "s" } else { "" },
            empty.join(", "),
            if empty.len() > 1 { "" } else { "s" },
        ));
    }
    advice
}

fn seconds(frame: &super::results::TruthFrame) -> String {
    format!("{:.2}", frame.time_s)
}

/// Rows whose error is partly the truth's own noise.
fn noise(case: &Case, advice: &mut Vec<String>) {
    let noise_mse = case.truth.noise_rms * case.truth.noise_rms;
    let measured = case.rows.iter().filter_map(|row| {
        let psnr_db = row.visibility_psnr_db.value?;
        Some((libm::pow(10.0, -psnr_db / 10.0), row))
    });
    let least = measured.min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((mse, row)) = least.filter(|(mse, _)| noise_mse > NOISE_PART * mse) else { return };
    let name = table::name(row);
    let (noise, error) = (100.0 * case.truth.noise_rms, 100.0 * mse.sqrt());
    // What is measured contains the noise. Where it is all of it, any number of rays is a guess.
    let own_mse = (mse - noise_mse).max(0.05 * mse);
    let factor = noise_mse / (NOISE_PART * own_mse);
    let enough = ((f64::from(case.reference_rays) * factor).ceil() as u64).next_power_of_two().min(65_536);
    let what = match noise_mse >= mse {
        true => format!(
            "the truth's own noise, {noise:.2} %, is as large as the error measured for {name}, {error:.2} %"
        ),
        false => format!(
            "the truth's own noise, {noise:.2} %, is {:.0} % of the squared error measured for {name}, {error:.2} %",
            100.0 * noise_mse / mse
        ),
    };
    advice.push(format!("{what}: raise --reference-rays from {} to {enough}", case.reference_rays));
}

/// The two best rows, if the frames do not tell them apart.
fn ties(case: &Case, advice: &mut Vec<String>) {
    let mut rows: Vec<(&Row, Vec<FrameError>)> =
        case.rows.iter().map(|row| (row, errors(case, row))).collect();
    rows.retain(|(row, errors)| row.visibility_psnr_db.value.is_some() && errors.len() > 1);
    rows.sort_by(|a, b| {
        let mse = |errors: &[FrameError]| pooled_mse(errors, None).unwrap_or(f64::MAX);
        mse(&a.1).total_cmp(&mse(&b.1))
    });
    let [(best, best_errors), (second, second_errors), ..] = &rows[..] else { return };
    let difference = psnr_difference(best_errors, second_errors);
    if let (Some(db), Some(ci95)) = (difference.value, difference.ci95)
        && ci95 > db
    {
        advice.push(format!(
            "{} and {} differ by {db:.2} ± {ci95:.2} dB of visibility, frame by frame: raise --frames to tell them apart",
            table::name(best),
            table::name(second),
        ));
    }
}

/// A row's errors of visibility, weighted by the pixels that show geometry.
pub(super) fn errors(case: &Case, row: &Row) -> Vec<FrameError> {
    let weights = case.truth.frames.iter().map(|f| f.covered_pixels as f64);
    row.frames.iter().zip(weights).map(|(f, weight)| FrameError::new(f.visibility_psnr_db, weight)).collect()
}
