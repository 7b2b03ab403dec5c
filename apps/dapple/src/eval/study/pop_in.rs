//! Pop-in: how visibility of places that stay visible jumps from one picture to the next while the camera moves and occluders enter and leave the first layer.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use dapple_render::gbuffer::{GBuffer, GuardBand, Screen};
use dapple_scene::glam::Vec3;
use dapple_trace::rtao::{RtaoParams, Site, trace_visibility};
use serde::Deserialize;

use super::{
    Findings, Moment, ScreenSpace, Study, StudyPlot, StudyTable, Subject, axis, column, line, row, size_of,
};
use crate::eval::plan::CLIENT_HZ;
use crate::eval::stage::Stage;

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct PopIn {
    /// From picture to picture, at 60 Hz, in each piece of the path.
    steps: u32,
}

impl Default for PopIn {
    fn default() -> Self {
        PopIn { steps: 20 }
    }
}

/// Part of the radius that a patch of a surface is long: the mean over it is compared, so that noise of single samples is not.
const PATCH: f32 = 0.25;
/// Places that a patch has at least, one a sample.
const FEWEST: usize = 12;
/// Of a patch about so many places are traced.
const TRACED: usize = 8;
/// A larger change than the truth's is counted.
const POP: f64 = 0.05;

/// One picture of a piece of the path.
struct Step {
    moment: Moment,
    gbuffer: GBuffer,
    screen: Screen,
}

/// A place on a surface that stands still.
struct Place {
    site: Site,
    /// Which patch it is part of.
    patch: [i32; 5],
}

/// Mean visibility of each patch in each picture.
type Series = Vec<Vec<f64>>;

/// Changes from picture to picture, over patches of all pieces.
#[derive(Clone, Default)]
struct Changes {
    /// Magnitudes of a method's own changes, and of their differences from the truth's.
    own: Vec<f64>,
    off: Vec<f64>,
}

impl Changes {
    fn add(&mut self, series: &Series, truth: &Series) {
        for (values, truth) in series.iter().zip(truth) {
            for (now, true_now) in values.windows(2).zip(truth.windows(2)) {
                let (own, true_change) = (now[1] - now[0], true_now[1] - true_now[0]);
                self.own.push(own.abs());
                self.off.push((own - true_change).abs());
            }
        }
    }

    fn values(&self) -> [f64; 6] {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        let mut sorted = self.off.clone();
        sorted.sort_by(f64::total_cmp);
        let rare = sorted.get(sorted.len() * 999 / 1000).copied().unwrap_or(f64::NAN);
        let pops = self.off.iter().filter(|off| **off > POP).count();
        let per_1000 = 1000.0 * pops as f64 / self.off.len() as f64;
        [mean(&self.own), most(&self.own), mean(&self.off), rare, most(&self.off), per_1000]
    }
}

/// The patch whose first method jumps most, as all methods see it.
struct Worst {
    jump: f64,
    start_s: f64,
    lines: Vec<Vec<f64>>,
}

impl PopIn {
    /// Pictures of a piece of the path that begins at a time, or so much earlier that it ends with the path.
    fn steps(&self, subject: &Subject<'_>, from_s: f64) -> Result<Vec<Step>> {
        let stage = subject.stage()?;
        let last_s = f64::from(self.steps) / CLIENT_HZ;
        let start_s = from_s.min(stage.seconds - last_s).max(0.0);
        (0..=self.steps)
            .map(|step| {
                let time_s = start_s + f64::from(step) / CLIENT_HZ;
                let moment = Moment { pose: stage.scene().pose(time_s), camera: stage.camera(time_s) };
                let (gbuffer, screen) = subject.look(&moment, size_of(stage), GuardBand::default())?;
                Ok(Step { moment, gbuffer, screen })
            })
            .collect()
    }

    /// Places of the middle picture on what does not move.
    fn places(&self, subject: &Subject<'_>, step: &Step) -> Result<Vec<Place>> {
        let stage = subject.stage()?;
        let scene = stage.scene();
        let moving = scene.moving_instances();
        let edge_m = PATCH * stage.radius_m;
        let found = step.gbuffer.map_surfaces(scene, &step.moment.pose, |index, surface| {
            let surface = surface.filter(|s| !moving[s.instance as usize])?;
            let [x, y, z] = (surface.position_world / edge_m).to_array().map(|part| part.floor() as i32);
            let normal = surface.normal_world.to_array();
            let widest = (0..3).max_by(|a, b| normal[*a].abs().total_cmp(&normal[*b].abs()))?;
            let side = 2 * widest as i32 + i32::from(normal[widest] < 0.0);
            let site = Site {
                position_world: surface.position_world,
                normal_world: surface.normal_world,
                key: index as u64,
            };
            Some(Place { site, patch: [surface.instance as i32, side, x, y, z] })
        });
        Ok(found.into_iter().flatten().collect())
    }
}

impl Step {
    /// The sample that shows a place, if one does.
    fn sample_of(&self, site: &Site) -> Option<usize> {
        let view = self.moment.camera.world_from_view.inverse();
        let place = view.transform_point3(site.position_world);
        let normal = view.transform_vector3(site.normal_world).normalize_or_zero();
        let sample = self.screen.sample_at(place)?;
        let seen: Vec3 = self.screen.position_view(sample)?;
        let a_sample_m = 1.0 / self.screen.samples_per_metre(-place.z);
        let is_it = (seen - place).dot(normal).abs() < 0.5 * a_sample_m
            && (seen - place).length() < 8.0 * a_sample_m
            && self.screen.normals_view()[sample].dot(normal) > 0.95;
        is_it.then_some(sample)
    }
}

/// Means over patches.
fn means(patches: &[Vec<usize>], value: impl Fn(usize) -> f32) -> Vec<f64> {
    let mean = |patch: &Vec<usize>| {
        patch.iter().map(|place| f64::from(value(*place))).sum::<f64>() / patch.len() as f64
    };
    patches.iter().map(mean).collect()
}

/// From one of pictures to one of patches.
fn turned(by_step: &[Vec<f64>]) -> Series {
    let patches = by_step.first().map_or(0, Vec::len);
    (0..patches).map(|patch| by_step.iter().map(|step| step[patch]).collect()).collect()
}

/// Most samples of all pictures of a piece of the path; each takes some 40 bytes.
const MAX_SAMPLES: u64 = 1 << 27;

impl Study for PopIn {
    fn title(&self) -> &'static str {
        "Pop-in while the camera moves"
    }

    fn work(&self, stage: Option<&Stage<'_>>) -> f64 {
        stage.map_or(1e7, |stage| {
            let samples = f64::from(stage.settings.size.width) * f64::from(stage.settings.size.height);
            f64::from(self.steps) * stage.frame_times_s.len() as f64 * samples * 300.0
        })
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        if !(1..=600).contains(&self.steps) {
            bail!("steps is {}, must be 1 to 600", self.steps);
        }
        let stage = subject.stage()?;
        // All pictures of a piece are held at once.
        let samples = u64::from(self.steps + 1) * stage.samples();
        if samples > MAX_SAMPLES {
            bail!(
                "{} pictures of {} samples are more than {MAX_SAMPLES} samples: fewer steps, or a smaller size",
                self.steps + 1,
                stage.samples()
            );
        }
        let (methods, pieces) = (subject.methods()?, stage.frame_times_s.len());
        let mut found = vec![Changes::default(); methods.len() + 1];
        let mut worst: Option<Worst> = None;
        let mut patches_of_all = 0;
        for (piece, from_s) in stage.frame_times_s.iter().enumerate() {
            let steps = self.steps(subject, *from_s)?;
            let places = self.places(subject, &steps[steps.len() / 2])?;
            // Where each is in each picture, of those that are in all.
            let seen: Vec<Option<Vec<usize>>> = places
                .iter()
                .map(|place| steps.iter().map(|step| step.sample_of(&place.site)).collect())
                .collect();
            let mut patches = BTreeMap::<[i32; 5], Vec<usize>>::new();
            for (number, place) in places.iter().enumerate().filter(|(number, _)| seen[*number].is_some()) {
                patches.entry(place.patch).or_default().push(number);
            }
            let patches: Vec<Vec<usize>> =
                patches.into_values().filter(|places| places.len() >= FEWEST).collect();
            patches_of_all += patches.len();
            let truth = self.truth(subject, &steps, &places, &patches)?;
            let mut all = vec![truth];
            for (number, method) in methods.iter().enumerate() {
                all.push(series(subject, &steps, *method, &patches, &seen)?);
                let done = piece as f64 + (number + 1) as f64 / methods.len() as f64;
                (subject.progress)(done / pieces as f64);
            }
            for (series, found) in all.iter().zip(&mut found) {
                found.add(series, &all[0]);
            }
            let start_s = steps[0].moment.pose.time;
            for patch in 0..patches.len() {
                let jump = largest(&all[1][patch], &all[0][patch]);
                if worst.as_ref().is_none_or(|worst| jump > worst.jump) {
                    let lines = all.iter().map(|series| series[patch].clone()).collect();
                    worst = Some(Worst { jump, start_s, lines });
                }
            }
        }
        let Some(worst) = worst else {
            let note = format!(
                "No patch of a still surface stays visible for {} pictures: a larger size, or fewer steps, would have some.",
                self.steps + 1
            );
            return Ok(Findings { notes: vec![note], ..Findings::default() });
        };
        let names: Vec<String> =
            std::iter::once("truth".to_owned()).chain(methods.iter().map(|method| method.name())).collect();
        let table = StudyTable {
            title: "Change of visibility from picture to picture, of patches that stay visible".to_owned(),
            columns: vec![
                column("mean", "", 5),
                column("largest", "", 3),
                column("off the truth's: mean", "", 5),
                column("off: 1 of 1000 above", "", 4),
                column("off: largest", "", 3),
                column(&format!("off: above {POP}, of 1000"), "", 2),
            ],
            rows: names.iter().zip(&found).map(|(name, found)| row(name, found.values())).collect(),
        };
        let milliseconds = |step: usize| 1e3 * step as f64 / CLIENT_HZ;
        let lines = names.iter().zip(&worst.lines).map(|(name, values)| {
            line(name, values.iter().enumerate().map(|(step, value)| [milliseconds(step), *value]))
        });
        let plot = StudyPlot {
            title: format!("The patch where {} jumps most", methods[0].name()),
            x: axis("time", "ms", false),
            y: axis("visibility", "", false),
            lines: lines.collect(),
        };
        let notes = vec![format!(
            "{pieces} pieces of the path, {} steps at {CLIENT_HZ} Hz each, pictures of {} × {} pixels, one sample each. A patch is the places of a still surface within a cube of {PATCH} of the radius that every picture of a \
             piece shows, at least {FEWEST}; its mean visibility counts. {patches_of_all} patches. The truth is traced from about {TRACED} places of each, with the same rays in every picture: it changes where other things move. Where {} \
             jumps most (plot, from {:.2} s), it changes by {:.3} more than the truth in a step.",
            self.steps,
            stage.settings.size.width,
            stage.settings.size.height,
            methods[0].name(),
            worst.start_s,
            worst.jump
        )];
        Ok(Findings { notes, tables: vec![table], plots: vec![plot] })
    }
}

/// The largest step of what is found beyond the truth's.
fn largest(values: &[f64], truth: &[f64]) -> f64 {
    let steps = values.windows(2).zip(truth.windows(2));
    steps.map(|(v, t)| ((v[1] - v[0]) - (t[1] - t[0])).abs()).fold(0.0, f64::max)
}

fn series(
    subject: &Subject<'_>,
    steps: &[Step],
    method: ScreenSpace,
    patches: &[Vec<usize>],
    seen: &[Option<Vec<usize>>],
) -> Result<Series> {
    let effort = subject.stage()?.settings.effort;
    let mut by_step = Vec::new();
    for (number, step) in steps.iter().enumerate() {
        let sight = subject.sight(&step.moment, &step.gbuffer)?;
        let visibility = method.estimate(&sight, effort)?.visibility;
        by_step.push(means(patches, |place| {
            seen[place].as_ref().map_or(1.0, |samples| visibility[samples[number]])
        }));
    }
    Ok(turned(&by_step))
}

impl PopIn {
    fn truth(
        &self,
        subject: &Subject<'_>,
        steps: &[Step],
        places: &[Place],
        patches: &[Vec<usize>],
    ) -> Result<Series> {
        let stage = subject.stage()?;
        let params = RtaoParams {
            rays: stage.settings.reference_rays,
            radius_m: stage.radius_m,
            seed: stage.settings.seed.into(),
        };
        let some = |patch: &Vec<usize>| -> Vec<usize> {
            patch.iter().step_by(patch.len().div_ceil(TRACED)).copied().collect()
        };
        let patches: Vec<Vec<usize>> = patches.iter().map(some).collect();
        let wanted: Vec<usize> = patches.iter().flatten().copied().collect();
        let sites: Vec<Site> = wanted.iter().map(|place| places[*place].site).collect();
        let mut all = vec![1.0; places.len()];
        let by_step = steps.iter().map(|step| {
            let mut visibility = vec![1.0; sites.len()];
            trace_visibility(&stage.tracer_in(&step.moment.pose), &sites, &params, &mut visibility);
            wanted.iter().zip(visibility).for_each(|(place, value)| all[*place] = value);
            means(&patches, |place| all[place])
        });
        Ok(turned(&by_step.collect::<Vec<_>>()))
    }
}
