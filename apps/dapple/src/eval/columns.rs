//! The columns of results: the same for tables of text, for the page's table, its plots and its words.

use serde::Serialize;

use super::results::{Case, Figure, Params, Row};

/// What a column is about, which says where the page shows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// How near to the truth: plotted upwards, the best of a case is marked.
    Quality,
    /// What it costs: plotted to the right.
    Cost,
    /// Only in the table.
    Other,
}

/// One column.
pub(super) struct Column {
    pub(super) key: &'static str,
    pub(super) title: &'static str,
    /// Empty for a pure number.
    pub(super) unit: &'static str,
    pub(super) digits: usize,
    pub(super) kind: Kind,
    /// Whether a larger value is a better one.
    pub(super) more_is_better: bool,
    pub(super) explanation: &'static str,
    /// `None` where the column does not apply to a row.
    pub(super) get: fn(&Row) -> Option<Figure>,
}

const fn quality(key: &'static str, title: &'static str, unit: &'static str, digits: usize) -> Column {
    Column {
        key,
        title,
        unit,
        digits,
        kind: Kind::Quality,
        more_is_better: true,
        explanation: "",
        get: |_| None,
    }
}

const fn cost(key: &'static str, title: &'static str, unit: &'static str, digits: usize) -> Column {
    Column { kind: Kind::Cost, more_is_better: false, ..quality(key, title, unit, digits) }
}

/// Key of the figure that the summary goes by.
pub(super) const VISIBILITY: &str = "visibility_psnr_db";

/// All columns after those that name a row: first what most look for.
pub(super) const COLUMNS: [Column; 18] = [
    Column {
        explanation: "PSNR of visibility against the truth over all pixels that show geometry; the mean squared error is \
            pooled over the pictures",
        get: visibility,
        ..quality(VISIBILITY, "visibility", "dB", 2)
    },
    Column {
        explanation: "the same over the pixels that move or have something within the radius that does",
        get: |row| row.frames.iter().any(|frame| frame.moving_pixels > 0).then_some(row.moving_psnr_db),
        ..quality("moving_psnr_db", "near movers", "dB", 2)
    },
    Column {
        explanation: "bits of all updates over the path, headers included, snapshot not; 1 kbit = 1000 bits",
        get: |row| row.kbit_per_s,
        ..cost("kbit_per_s", "updates", "kbit/s", 1)
    },
    Column {
        explanation: "the snapshot that a new client receives on joining",
        get: |row| row.snapshot_bytes.map(|bytes| exact(bytes as f64 / 1e3)),
        ..cost("snapshot_kb", "join", "kB", 0)
    },
    Column {
        explanation: "PSNR of the whole 8-bit picture, pooled alike",
        get: |row| Some(row.psnr_db),
        ..quality("psnr_db", "picture", "dB", 2)
    },
    Column {
        explanation: "mean structural similarity of luma, 1 is equal",
        get: |row| Some(row.ssim),
        ..quality("ssim", "SSIM", "", 4)
    },
    Column {
        explanation: "mean FLIP of the tone-mapped picture: the difference that an observer would see when flipping \
            between the two, 0 is equal",
        more_is_better: false,
        get: |row| Some(row.flip),
        ..quality("flip", "FLIP", "", 4)
    },
    Column {
        explanation: "mean FLIP over the exposures of the linear picture, 0 is equal",
        more_is_better: false,
        get: |row| row.hdr_flip,
        ..quality("hdr_flip", "HDR-FLIP", "", 4)
    },
    Column {
        explanation: "learned perceptual distance, 0 is equal",
        more_is_better: false,
        get: |row| row.lpips,
        ..quality("lpips", "LPIPS", "", 4)
    },
    Column {
        explanation: "root mean square change of still places from one picture to the next at 60 Hz, in 1/255 of \
            visibility",
        more_is_better: false,
        get: |row| row.flicker,
        ..quality("flicker", "flicker", "", 3)
    },
    Column {
        explanation: "of the snapshot: which points do not count at which texels",
        kind: Kind::Other,
        get: |row| row.cut_bytes.map(|bytes| exact(bytes as f64 / 1e3)),
        ..cost("cut_kb", "cuts", "kB", 1)
    },
    Column {
        explanation: "points in the store",
        get: |row| row.points.map(|points| exact(points as f64)),
        ..cost("points", "points", "", 0)
    },
    Column {
        explanation: "rays traced in the whole run, millions, the start included, the test for points inside geometry \
            not",
        get: |row| Some(exact(row.rays as f64 / 1e6)),
        ..cost("mrays", "rays", "M", 1)
    },
    Column {
        explanation: "time after everything moved at once, just after a server step, until a twentieth of the squared \
            difference to what is shown in the end is left",
        kind: Kind::Other,
        get: |row| Some(exact(row.settling.as_ref()?.settled_s? * 1e3)),
        ..cost("settled_ms", "settles", "ms", 0)
    },
    Column {
        explanation: "most points that a server step left to later ones",
        kind: Kind::Other,
        get: |row| row.steps.map(|steps| exact(steps.most_backlog as f64)),
        ..cost("backlog", "backlog", "", 0)
    },
    Column {
        explanation: "most points at a time, where there is a cap on them",
        kind: Kind::Other,
        get: |row| row.steps?.most_points.map(|points| exact(points as f64)),
        ..cost("most_points", "at a time", "", 0)
    },
    Column {
        explanation: "mean wall time of a server step: pose, trees, rays, encoding; differs from run to run",
        get: |row| row.times.server_ms.map(exact),
        ..cost("server_ms", "server", "ms", 2)
    },
    Column {
        explanation: "mean wall time of reconstruction and of applying an update; differs from run to run",
        get: |row| Some(exact(row.times.client_ms)),
        ..cost("client_ms", "client", "ms", 2)
    },
];

fn exact(value: f64) -> Figure {
    Figure { value: Some(value), ci95: None }
}

/// `None` where no pixel showed geometry.
pub(super) fn visibility(row: &Row) -> Option<Figure> {
    (row.compared_pixels > 0).then_some(row.visibility_psnr_db)
}

/// A figure for comparing: what is absent in a figure is equal to the truth.
pub(super) fn rank(figure: Figure, more_is_better: bool) -> f64 {
    match figure.value {
        None => f64::INFINITY,
        Some(value) if more_is_better => value,
        Some(value) => -value,
    }
}

/// Columns that at least one row fills.
pub(super) fn filled(cases: &[Case]) -> Vec<&'static Column> {
    COLUMNS
        .iter()
        .filter(|column| cases.iter().flat_map(|case| &case.rows).any(|row| (column.get)(row).is_some()))
        .collect()
}

/// A number with a true minus sign, and with thousands apart where it has no fraction.
pub(super) fn number(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let plain = format!("{:.digits$}", value.abs());
    let sign = if value < 0.0 && plain.bytes().any(|b| (b'1'..=b'9').contains(&b)) { "−" } else { "" };
    let (whole, rest) = plain.split_at(plain.find('.').unwrap_or(plain.len()));
    let mut text = sign.to_owned();
    for (i, digit) in whole.char_indices() {
        if i > 0 && whole.len() > 4 && (whole.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text + rest
}

/// Bits a second in the unit that reads best.
pub(super) fn bits(kbit_per_s: f64) -> String {
    match kbit_per_s {
        k if k >= 10_000.0 => format!("{} Mbit/s", number(k / 1e3, 1)),
        k if k >= 100.0 => format!("{} kbit/s", number(k, 0)),
        k if k > 0.0 => format!("{} kbit/s", number(k, 1)),
        _ => "0 kbit/s".to_owned(),
    }
}

/// Bytes in the unit that reads best.
pub(super) fn bytes(count: u64) -> String {
    match count as f64 {
        b if b >= 1e6 => format!("{} MB", number(b / 1e6, 1)),
        b if b >= 1e3 => format!("{} kB", number(b / 1e3, 0)),
        b => format!("{} B", number(b, 0)),
    }
}

/// What tells each row of a case from the others of its method: pairs of a parameter and words for it. Points and rate
/// always, the rest where it differs.
pub(super) fn settings(case: &Case) -> Vec<Setting> {
    type Part = (&'static str, bool, fn(&Params) -> Option<String>);
    const PARTS: [Part; 12] = [
        ("points_per_m2", true, |p| p.points_per_m2.map(|n| format!("N {n}"))),
        ("hz", true, |p| p.hz.map(|hz| format!("{hz} Hz"))),
        ("rays_per_pixel", true, |p| p.rays_per_pixel.map(|rays| format!("{rays} rays"))),
        ("point_rays", false, |p| p.point_rays.map(|rays| format!("{rays} rays a point"))),
        ("threshold", false, |p| p.threshold.map(|t| format!("threshold {t}"))),
        ("ray_budget", false, |p| p.ray_budget.map(|rays| format!("{} rays a step", number(rays as f64, 0)))),
        ("budget_kbit_per_s", false, |p| p.budget_kbit_per_s.map(|kbit| format!("at most {}", bits(kbit)))),
        ("rays_still", false, |p| p.rays_still.map(|rays| format!("{rays} rays at rest"))),
        ("max_points", false, |p| {
            p.max_points.map(|points| format!("at most {} points", number(points.into(), 0)))
        }),
        ("ao_preset", false, |p| p.ao_preset.clone()),
        ("half_resolution", false, |p| {
            p.half_resolution.map(|half| if half { "half resolution" } else { "full resolution" }.to_owned())
        }),
        ("guard_band", false, |p| p.guard_band.map(|part| format!("guard band {part}"))),
    ];
    let of_row = |row: &Row| {
        let others = || case.rows.iter().filter(|other| other.method == row.method);
        let parts = PARTS.iter().filter_map(|(key, always, part)| {
            let text = part(&row.params);
            let differs = *always || others().any(|other| part(&other.params) != text);
            Some((*key, text.filter(|_| differs)?))
        });
        Setting(parts.collect())
    };
    case.rows.iter().map(of_row).collect()
}

/// What tells a row from others of its method, in words.
#[derive(Debug, Serialize)]
pub(super) struct Setting(Vec<(&'static str, String)>);

impl std::fmt::Display for Setting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (i, (_, text)) in self.0.iter().enumerate() {
            write!(f, "{}{text}", if i > 0 { ", " } else { "" })?;
        }
        Ok(())
    }
}
