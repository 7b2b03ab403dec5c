//! HBAO+ from two cameras: \[Vermeer2021\] Table 3.

use anyhow::{Result, bail};
use serde::Deserialize;

use super::medians::{Seen, medians};
use super::presets::look;
use super::{Errors, Findings, Study, StudyTable, Subject, column, row, size_of};
use crate::eval::stage::Stage;
use crate::screen_space::{Effort, Layered, ScreenSpace, Stochastic};

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct MultiView {
    /// The middle one of so many counts.
    repeats: u32,
}

impl Default for MultiView {
    fn default() -> Self {
        MultiView { repeats: 5 }
    }
}

const SAMPLES: [u32; 4] = [1, 2, 4, 8];

/// Table 3, ms, by samples: Sibenik, 1920 × 1080.
const TABLE_3: [[f64; 4]; 4] = [
    [1.344, 2.852, 0.615, 2.157],
    [1.506, 2.885, 0.698, 2.462],
    [2.131, 3.836, 0.873, 3.116],
    [3.667, 5.419, 1.223, 4.523],
];

/// In the order of Table 3's columns.
#[derive(Clone, Copy)]
enum View {
    One,
    Two,
    TwoHalf,
    SecondHalf,
}

impl View {
    const ALL: [View; 4] = [View::One, View::Two, View::TwoHalf, View::SecondHalf];

    fn name(self) -> &'static str {
        match self {
            View::One => "one camera",
            View::Two => "two",
            View::TwoHalf => "two, half",
            View::SecondHalf => "two, the second half",
        }
    }

    fn run(self, samples: u32, effort: Effort) -> (ScreenSpace, Effort) {
        let two_cameras = !matches!(self, View::One);
        let method = Stochastic { samples, two_cameras, paper: false };
        let second_coarseness = if matches!(self, View::SecondHalf) { 2 } else { 1 };
        let half_resolution = Some(matches!(self, View::TwoHalf));
        let effort = Effort { half_resolution, second_coarseness, ..effort };
        (ScreenSpace::Stochastic(Layered::HbaoPlus, method), effort)
    }
}

impl Study for MultiView {
    fn title(&self) -> &'static str {
        "HBAO+ from two cameras"
    }

    fn work(&self, stage: Option<&Stage<'_>>) -> f64 {
        let own = stage.map_or(1e7, |stage| stage.samples() as f64);
        300.0 * own * (f64::from(self.repeats) + stage.map_or(1.0, |stage| stage.frame_times_s.len() as f64))
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        if !(1..=100).contains(&self.repeats) {
            bail!("repeats is {}, must be 1 to 100", self.repeats);
        }
        let stage = subject.stage()?;
        let (size, effort, count) = (size_of(stage), stage.settings.effort, stage.frame_times_s.len());
        let runs: Vec<(ScreenSpace, Effort)> = SAMPLES
            .iter()
            .flat_map(|samples| View::ALL.map(|view| view.run(*samples, effort)))
            .chain([(ScreenSpace::HbaoPlus, Effort { half_resolution: Some(false), ..effort })])
            .collect();
        let moments = subject.moments()?;
        let moment = &moments[moments.len() / 2];
        let seen = Seen::new(subject, moment, size, effort.guard_band)?;
        let half_done = |part: f64| (subject.progress)(0.5 * part);
        let timed = Subject { progress: &half_done, ..*subject };
        let times = medians(&timed, &seen, &runs, self.repeats)?;
        let mut errors = vec![Errors::default(); runs.len()];
        for number in 0..count {
            let frame = stage.frame(number, subject.cache, &|_| ())?;
            for ((method, effort), errors) in runs.iter().zip(&mut errors) {
                let (visibility, _) = look(subject, &frame, *method, *effort)?;
                errors.add_covered(&visibility, frame.truth.visibility(), frame.truth.covered());
            }
            (subject.progress)(0.5 + 0.5 * (number + 1) as f64 / count as f64);
        }
        let names = View::ALL.map(View::name);
        let table = |title: &str, unit: &str, digits, single: Option<f64>, value: &dyn Fn(usize) -> f64| {
            let rows = SAMPLES.iter().enumerate().map(|(number, samples)| {
                row(format!("S = {samples}"), (0..4).map(|view| value(4 * number + view)))
            });
            let single = single.map(|value| row("no map", [value, f64::NAN, f64::NAN, f64::NAN]));
            StudyTable {
                title: title.to_owned(),
                columns: names.map(|name| column(name, unit, digits)).to_vec(),
                rows: single.into_iter().chain(rows).collect(),
            }
        };
        let last = runs.len() - 1;
        let to_one = |i: usize| times[i].all() / times[i / 4 * 4].all();
        let maps = |i: usize| times[i].passes_together(&["map", "second map"]);
        let theirs = |i: usize| TABLE_3[i / 4][i % 4] / TABLE_3[i / 4][0];
        let truth = |value: fn(&Errors) -> f64| {
            let errors = &errors;
            move |i: usize| value(&errors[i])
        };
        let (db, bias) = (truth(Errors::psnr_db), truth(Errors::bias));
        let tables = vec![
            table("Time in all", "ms", 1, Some(times[last].all()), &|i| times[i].all()),
            table("Of which maps, and the second camera's G-buffer", "ms", 1, None, &maps),
            table("Time, as many times that of one camera", "×", 2, None, &to_one),
            table("The same in the paper's Table 3", "×", 2, None, &theirs),
            table("Visibility against the truth", "dB", 2, Some(db(last)), &db),
            table("Bias to the truth", "", 4, Some(bias(last)), &bias),
        ];
        let notes = vec![
            format!(
                "Times of one picture of {} × {} pixels at {:.2} s of the path, {} samples with the guard band: medians of {} runs in turn, on {} threads of {}. Errors over {count} pictures. Positive bias is too \
                 light. The second camera stands 2 m to the right and draws a G-buffer of its own, which the paper's does not.",
                size[0],
                size[1],
                moment.pose.time,
                seen.samples(),
                self.repeats,
                rayon::current_num_threads(),
                crate::eval::results::Machine::here().cpu
            ),
            "The paper's Table 3 is of Sibenik, 1920 × 1080, on a Titan V.".to_owned(),
        ];
        Ok(Findings { notes, tables, plots: Vec::new() })
    }
}
