//! The bounds that `dapple eval --smoke` asserts: not less similar, not more bytes.

use anyhow::{Context, Result, bail};

use super::results::{Results, Row};

/// Bounds on the default setting. They hold with a little room on every machine, because results do not depend on it.
struct Bound {
    method: &'static str,
    least_visibility_psnr_db: f64,
    most_flip: f64,
    most_kbit_per_s: f64,
    /// Without cuts.
    most_snapshot_bytes_per_point: f64,
}

const BOUNDS: [Bound; 2] = [
    Bound {
        method: "psao",
        least_visibility_psnr_db: 28.1,
        most_flip: 0.03,
        most_kbit_per_s: 95.0,
        most_snapshot_bytes_per_point: 2.8,
    },
    Bound {
        method: "psao-hat",
        least_visibility_psnr_db: 25.0,
        most_flip: 0.035,
        most_kbit_per_s: 95.0,
        most_snapshot_bytes_per_point: 2.8,
    },
];

/// What a snapshot may carry for cuts: tens of kilobytes for 200,000 points.
const MOST_CUT_BYTES_PER_POINT: f64 = 0.4;

/// The atlas must beat the paper's kernel by this much, on the same points.
const LEAST_GAIN_DB: f64 = 2.5;

/// Fails with the list of all bounds that do not hold.
pub(super) fn check(results: &Results) -> Result<()> {
    let mut broken = Vec::new();
    let mut check = |what: String, holds: bool| {
        if !holds {
            broken.push(what);
        }
    };
    for bound in &BOUNDS {
        let row = find(results, bound.method)?;
        let visibility = visibility_psnr_db(row);
        let flip = row.flip.value.unwrap_or(f64::INFINITY);
        let kbit = row.kbit_per_s.and_then(|f| f.value).unwrap_or(0.0);
        let (snapshot, cuts) = (row.snapshot_bytes.unwrap_or(0), row.cut_bytes.unwrap_or(0));
        let points = row.points.unwrap_or(1).max(1) as f64;
        let per_point = (snapshot as f64 - cuts as f64) / points;
        let cuts_per_point = cuts as f64 / points;
        let method = bound.method;
        check(
            format!("{method}: {} pixels compared, more than 0", row.compared_pixels),
            row.compared_pixels > 0,
        );
        check(
            format!(
                "{method}: visibility PSNR {visibility:.2} dB, at least {}",
                bound.least_visibility_psnr_db
            ),
            visibility >= bound.least_visibility_psnr_db,
        );
        check(format!("{method}: FLIP {flip:.4}, at most {}", bound.most_flip), flip <= bound.most_flip);
        check(
            format!("{method}: {kbit:.1} kbit/s, more than 0 and at most {}", bound.most_kbit_per_s),
            kbit > 0.0 && kbit <= bound.most_kbit_per_s,
        );
        check(
            format!(
                "{method}: snapshot of {per_point:.2} bytes a point, at most {}",
                bound.most_snapshot_bytes_per_point
            ),
            per_point <= bound.most_snapshot_bytes_per_point,
        );
        check(
            format!(
                "{method}: cuts of {cuts_per_point:.3} bytes a point, more than 0 and at most {MOST_CUT_BYTES_PER_POINT}"
            ),
            cuts > 0 && cuts_per_point <= MOST_CUT_BYTES_PER_POINT,
        );
    }
    let gain = visibility_psnr_db(find(results, "psao")?) - visibility_psnr_db(find(results, "psao-hat")?);
    check(format!("psao gains {gain:.2} dB over psao-hat, at least {LEAST_GAIN_DB}"), gain >= LEAST_GAIN_DB);
    if !broken.is_empty() {
        bail!("the smoke evaluation left its bounds:\n  {}", broken.join("\n  "));
    }
    Ok(())
}

fn find<'a>(results: &'a Results, method: &str) -> Result<&'a Row> {
    results
        .cases
        .iter()
        .flat_map(|case| &case.rows)
        .find(|r| r.method == method)
        .with_context(|| format!("no row for {method}"))
}

/// Equal pictures have no finite PSNR.
fn visibility_psnr_db(row: &Row) -> f64 {
    row.visibility_psnr_db.value.unwrap_or(f64::INFINITY)
}
