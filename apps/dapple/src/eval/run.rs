//! Runs a plan: scene by scene, path by path, job by job. What was done before is taken from the journal.

mod studies;

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use dapple_scene::area_lights::AreaLights;
use dapple_scene::{CameraPath, CameraSource};
use serde_json::json;

use super::advice;
use super::figures::FrameError;
use super::job::{Desk, Job, Outcome, jobs};
use super::journal::Journal;
use super::pair::{Start, Starts};
use super::plan::{Entry, Plan};
use super::results::{
    Advice, Case, Failure, JudgeInfo, Machine, Results, RunInfo, SCHEMA, SceneInfo, Truth, TruthFrame, commit,
};
use super::stage::Stage;
use super::truth::Cache;
use super::work::Work;
use crate::args::EvalArgs;
use crate::direct_light::warn_of_lights;
use crate::inspect::MAX_RECORDING_BYTES;
use crate::judge::Judge;
use crate::light::warn_of_many;
use crate::picture::write_file;
use crate::source::{self, Loaded, read_limited};

/// What all cases of a run share.
struct Run<'a> {
    out: &'a Path,
    journal: Journal,
    /// Keeps other evaluations out of the folder while it is open.
    lock: Option<File>,
    cache: Cache,
    judge: Judge,
    record: Option<&'a Path>,
    /// Whether there is one scene along one path.
    one_case: bool,
    /// Jobs that found their outcome in the journal.
    reused: usize,
    work: Work,
}

/// The results, and what keeps other evaluations out of the folder until they are written.
pub(super) fn evaluate(plan: &Plan, args: &EvalArgs) -> Result<(Results, Option<File>)> {
    let judge = Judge::new(&args.judge)?;
    if let Some(record) = &args.record
        && !record.extension().is_some_and(|e| e.eq_ignore_ascii_case("dapple"))
    {
        bail!("--record {} would hold a recording: name it .dapple", record.display());
    }
    let truth = args.truth_cache.clone().unwrap_or_else(|| args.out.join("truth"));
    let mut run = Run {
        out: &args.out,
        lock: if args.out.is_dir() { lock(&args.out)? } else { None },
        journal: Journal::open(&args.out, args.fresh)?,
        cache: Cache::new(&truth),
        judge,
        record: args.record.as_deref(),
        one_case: false,
        reused: 0,
        work: Work::new(),
    };
    let mut results = run.empty_results(plan);
    for (number, entry) in plan.entries.iter().enumerate() {
        let outcome = run.entry(entry, plan, &mut results.cases).with_context(|| entry.name.clone());
        match outcome {
            Ok(()) => {}
            // Nothing to go on with.
            Err(error) if plan.entries.len() == 1 => return Err(error),
            Err(error) => {
                tracing::error!("{error:#}");
                let error = format!("{error:#}");
                results.failures.push(Failure { scene: entry.name.clone(), error });
            }
        }
        results.advice = advise(&results);
        // Hours may still come: what is there can be read.
        if number + 1 < plan.entries.len() && !results.cases.is_empty() {
            super::write_tables(&results, run.out)?;
        }
    }
    for (number, study) in plan.studies.iter().enumerate() {
        match run.study(study, plan.studies.len() - number - 1).with_context(|| study.kind.clone()) {
            Ok(found) => results.studies.push(found),
            Err(error) if plan.entries.is_empty() && plan.studies.len() == 1 => return Err(error),
            Err(error) => {
                tracing::error!("{error:#}");
                let error = format!("{error:#}");
                results.failures.push(Failure { scene: format!("study {}", study.kind), error });
            }
        }
        results.advice = advise(&results);
    }
    drop(run.work);
    if results.cases.is_empty()
        && results.studies.is_empty()
        && let Some(first) = results.failures.first()
    {
        bail!("none of the {} scenes could be evaluated; the first: {}", plan.entries.len(), first.error);
    }
    if run.reused > 0 {
        let jobs = if run.reused == 1 { "job" } else { "jobs" };
        say!("{} {jobs} done before, not run again (--fresh runs all)", run.reused);
    }
    Ok((results, run.lock))
}

/// What readers of the figures should know: of all, then of each case.
fn advise(results: &Results) -> Vec<Advice> {
    let failed = results.failures.iter().map(|failure| Advice {
        case: None,
        text: format!("{} could not be evaluated: {}", failure.scene, failure.error),
    });
    let of_cases = results.cases.iter().enumerate().flat_map(|(index, case)| {
        advice::of(case).into_iter().map(move |text| Advice { case: Some(index), text })
    });
    failed.chain(of_cases).collect()
}

/// Takes the folder for this process; where the file system has no locks, everyone can have it.
fn lock(out: &Path) -> Result<Option<File>> {
    let path = out.join("running.lock");
    let file = File::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => {
            bail!("another evaluation is writing into {}: wait for it, or give another --out", out.display())
        }
        Err(TryLockError::Error(error)) => {
            tracing::debug!("no lock on {}: {error}", path.display());
            Ok(None)
        }
    }
}

/// The command that runs, to be pasted.
pub(super) fn command_line() -> String {
    std::env::args().skip(1).fold("dapple".to_owned(), |line, a| line + " " + &quoted(&a))
}

/// An argument as a shell takes it.
fn quoted(argument: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./,:=+@%".contains(c);
    match !argument.is_empty() && argument.chars().all(plain) {
        true => argument.to_owned(),
        false => format!("'{}'", argument.replace('\'', r"'\''")),
    }
}

impl Run<'_> {
    fn empty_results(&self, plan: &Plan) -> Results {
        Results {
            schema: SCHEMA,
            title: plan.title.clone(),
            run: RunInfo {
                dapple_version: env!("CARGO_PKG_VERSION").to_owned(),
                program: self.journal.program().to_owned(),
                commit: commit(),
                command: command_line(),
            },
            machine: Machine::here(),
            judge: JudgeInfo {
                pixels_per_degree: self.judge.pixels_per_degree,
                lpips_weights: self.judge.weights.clone(),
            },
            cases: Vec::new(),
            studies: Vec::new(),
            failures: Vec::new(),
            advice: Vec::new(),
        }
    }

    /// What is needed before anything is written.
    fn open_folder(&mut self) -> Result<()> {
        std::fs::create_dir_all(self.out)
            .with_context(|| format!("cannot create the folder {}", self.out.display()))?;
        if self.lock.is_none() {
            self.lock = lock(self.out)?;
        }
        Ok(())
    }

    /// All cases of one scene.
    fn entry(&mut self, entry: &Entry, plan: &Plan, cases: &mut Vec<Case>) -> Result<()> {
        self.work.message(&format!("loading {}", entry.name));
        let loaded = source::load(&entry.scene, None)?;
        // Only now, so that a scene that cannot be used leaves nothing behind.
        self.open_folder()?;
        let radius = source::radius_of(&loaded.scene, entry.settings.radius)?;
        let mut starts = Starts::new(&loaded.scene);
        let paths = paths(&loaded, &entry.settings.paths)?;
        let stages: Vec<Stage<'_>> = paths
            .into_iter()
            .map(|path| Stage::new(&loaded, &entry.settings, path, radius, starts.tracer().clone()))
            .collect();
        if let Some(stage) = stages.first()
            && entry.settings.methods.iter().any(|m| m.uses_points())
        {
            if entry.settings.has_area_lights() {
                let pose = loaded.scene.pose(0.0);
                let lights = AreaLights::new(&loaded.scene, &pose);
                if lights.is_empty() {
                    bail!("--methods slc: nothing in {} emits, so there is no light to shadow", loaded.title);
                }
                warn_of_lights(&lights);
                warn_of_many(&lights);
            }
            for &points_per_m2 in &entry.settings.points_per_m2 {
                Start::new(stage, points_per_m2).check(&loaded.scene)?;
            }
        }
        self.one_case = plan.entries.len() == 1 && stages.len() == 1;
        // Other scenes are taken to be as much work as this one, until they are loaded.
        let work: f64 = stages.iter().map(|stage| stage.truth_work() + job_work(stage)).sum();
        let count: usize = stages.iter().map(|stage| 1 + jobs(stage).len()).sum();
        let remaining = plan.entries.iter().skip_while(|e| !std::ptr::eq(*e, entry)).count() - 1;
        self.work.expect(count, work, remaining);
        for stage in stages {
            let name = unique(cases, format!("{} / {}", entry.name, stage.path.name));
            cases.push(self.case(&stage, &mut starts, name)?);
        }
        Ok(())
    }

    fn case(&mut self, stage: &Stage<'_>, starts: &mut Starts, name: String) -> Result<Case> {
        let identity = self.identity(stage);
        let slug = slug(&name);
        let truth = self.truth(stage, &identity, &name, &slug)?;
        let mut outcomes: Vec<(Job, Outcome)> = Vec::new();
        for job in jobs(stage) {
            let outcome = self.job(stage, starts, &truth, (&job, &identity), (&name, &slug))?;
            outcomes.push((job, outcome));
        }
        // By method, as they were asked for, then by setting.
        let rows = stage.settings.methods.iter().flat_map(|method| {
            let method = method.to_string();
            let rows = outcomes.iter().flat_map(|(_, outcome)| &outcome.rows);
            rows.filter(move |row| row.method == method).cloned()
        });
        let scene = stage.scene();
        Ok(Case {
            name,
            scene: SceneInfo {
                name: stage.loaded.title.clone(),
                hash: scene.hash().to_string(),
                triangles: scene.triangle_count() as u64,
                instances: scene.instances.len() as u64,
                warnings: scene.warnings.iter().map(|w| w.message.clone()).collect(),
            },
            animation: scene.active_animation.map(|i| scene.animations[i as usize].name.clone()),
            path: stage.path.name.clone(),
            seconds: stage.seconds,
            width: stage.settings.size.width,
            height: stage.settings.size.height,
            supersample: stage.settings.supersample,
            reference_rays: stage.settings.reference_rays,
            radius_m: stage.radius_m,
            seed: stage.settings.seed,
            rows: rows.collect(),
            truth,
        })
    }

    /// Everything that pictures and truth of a case depend on.
    fn identity(&self, stage: &Stage<'_>) -> serde_json::Value {
        let settings = stage.settings;
        json!({
            "scene": stage.scene().hash().to_string(),
            "animation": stage.scene().active_animation,
            "path": format!("{:?}", stage.path),
            "seconds": [stage.seconds, stage.whole_s],
            "times": stage.frame_times_s,
            "size": settings.size.to_string(),
            "supersample": settings.supersample,
            "reference_rays": settings.reference_rays,
            "radius": [stage.radius_m, stage.density_factor],
            "seed": settings.seed,
            "gather_ambient": settings.gather_ambient,
            "area_lights": settings.has_area_lights(),
        })
    }

    fn truth(
        &mut self,
        stage: &Stage<'_>,
        identity: &serde_json::Value,
        name: &str,
        slug: &str,
    ) -> Result<Truth> {
        let key = self.journal.key(json!({ "truth": identity }));
        let what = format!("{name}: truth");
        let work = stage.truth_work();
        let files = |truth: &Truth| {
            truth.frames.iter().flat_map(|f| [f.beauty.clone(), f.visibility.clone()]).collect::<Vec<_>>()
        };
        if let Some(truth) = self.journal.get(&key, files) {
            self.reused += 1;
            self.work.finish(&what, work, false);
            return Ok(truth);
        }
        self.work.begin(&what);
        let count = stage.frame_times_s.len();
        let mut frames = Vec::with_capacity(count);
        for (number, &time_s) in stage.frame_times_s.iter().enumerate() {
            let bar = &self.work;
            let part = |part: f64| bar.part(work, (number as f64 + part) / count as f64);
            let frame = stage.frame(number, &self.cache, &part)?;
            let stem = format!("pictures/{slug}/truth.{}/{number:03}", key.short());
            let pictures = frame.truth.write(self.out, &stem)?;
            frames.push(TruthFrame {
                time_s,
                covered_pixels: frame.truth.covered_pixels as u64,
                noise_rms: frame.noise_mse.sqrt(),
                beauty: pictures.beauty,
                visibility: pictures.visibility,
            });
        }
        let noise: Vec<FrameError> = frames
            .iter()
            .map(|f| FrameError { mse: f.noise_rms * f.noise_rms, weight: f.covered_pixels as f64 })
            .collect();
        let noise_rms = super::figures::pooled_mse(&noise, None).unwrap_or(0.0).sqrt();
        let truth = Truth { noise_rms, frames };
        self.journal.put(&key, &truth)?;
        self.work.finish(&what, work, true);
        Ok(truth)
    }

    fn job(
        &mut self,
        stage: &Stage<'_>,
        starts: &mut Starts,
        truth: &Truth,
        (job, identity): (&Job, &serde_json::Value),
        (name, slug): (&str, &str),
    ) -> Result<Outcome> {
        let settings = stage.settings;
        let key = self.journal.key(json!({
            "case": identity,
            "job": format!("{job:?}"),
            "points": [settings.point_rays, u32::from(settings.threshold), settings.step.rays_still],
            "ray_budget": settings.step.ray_budget,
            "budget": settings.step.budget.map(|budget| budget.0),
            "max_points": settings.step.max_points,
            "adaptive": settings.adaptive,
            "bent_normals": settings.bent_normals,
            "hdr_flip": settings.hdr_flip,
            "effort": format!("{:?}", settings.effort),
            // Says how long flicker is watched.
            "slowest_hz": settings.slowest_hz(),
            "judge": [json!(self.judge.weights), json!(self.judge.pixels_per_degree)],
        }));
        let what = format!("{name}: {}", job.name());
        let work = job.work(stage);
        let recorded = self.record.filter(|_| job.can_be_recorded());
        let record = recorded.map(|file| self.recording_file(file, stage, job, slug));
        // A file of that name may be another setting's.
        let recorded = |outcome: &Outcome| match &record {
            None => true,
            Some(file) => read_limited(file, MAX_RECORDING_BYTES)
                .is_ok_and(|bytes| outcome.recording == Some(blake3::hash(&bytes).to_hex().to_string())),
        };
        if let Some(outcome) = self.journal.get(&key, Outcome::files).filter(recorded) {
            self.reused += 1;
            self.work.finish(&what, work, false);
            return Ok(outcome);
        }
        self.work.begin(&what);
        let desk = Desk {
            out: self.out,
            folder: format!("pictures/{slug}/{}.{}", job.name(), key.short()),
            judge: &self.judge,
            cache: &self.cache,
            truth,
            record: record.as_ref().map(|_| name),
        };
        let bar = &self.work;
        let (outcome, recording) = job.run(stage, starts, &desk, &|part| bar.part(work, part))?;
        if let (Some(file), Some(bytes)) = (record, recording) {
            write_file(&file, &bytes)?;
        }
        self.journal.put(&key, &outcome)?;
        self.work.finish(&what, work, true);
        Ok(outcome)
    }

    /// `file` itself where only one setting records, otherwise with the setting in its name.
    fn recording_file(&self, file: &Path, stage: &Stage<'_>, job: &Job, slug: &str) -> PathBuf {
        let with_points = jobs(stage).iter().filter(|j| j.can_be_recorded()).count();
        if self.one_case && with_points == 1 {
            return file.to_owned();
        }
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        file.with_file_name(format!("{stem}-{slug}-{}.dapple", job.name()))
    }
}

/// The paths that are asked for: by name, from files, all that move, or the scene's first.
pub(super) fn paths(loaded: &Loaded, wanted: &[String]) -> Result<Vec<CameraPath>> {
    if wanted.is_empty() {
        return Ok(vec![source::find_path(&loaded.scene, None)?]);
    }
    let mut found: Vec<CameraPath> = Vec::new();
    for name in wanted {
        if name == "all" {
            let all = loaded.scene.camera_paths();
            let moving: Vec<CameraPath> =
                all.iter().filter(|p| matches!(p.source, CameraSource::Animated { .. })).cloned().collect();
            found.extend(if moving.is_empty() { all.into_iter().rev().take(1).collect() } else { moving });
        } else {
            found.push(source::find_path(&loaded.scene, Some(name))?);
        }
    }
    Ok(found)
}

fn job_work(stage: &Stage<'_>) -> f64 {
    jobs(stage).iter().map(|job| job.work(stage)).sum()
}

/// A name that no case has yet.
fn unique(cases: &[Case], name: String) -> String {
    let taken = |name: &str| cases.iter().any(|case| case.name == name);
    let numbered = (2..).map(|n| format!("{name} ({n})"));
    std::iter::once(name.clone()).chain(numbered).find(|name| !taken(name)).unwrap_or(name)
}

/// A name that every file system takes.
pub(super) fn slug(name: &str) -> String {
    let mut slug = String::new();
    for c in name.chars() {
        match c {
            c if c.is_ascii_alphanumeric() || c == '.' || c == '_' => slug.push(c),
            _ if slug.ends_with('-') || slug.is_empty() => {}
            _ => slug.push('-'),
        }
    }
    let slug = slug.trim_matches(['-', '.']);
    let short: String = slug.chars().take(80).collect();
    if short.is_empty() { "case".to_owned() } else { short }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_file_names() {
        assert_eq!(slug("atrium / path-walk"), "atrium-path-walk");
        assert_eq!(slug("../..//x (2)"), "x-2");
        assert_eq!(slug("房"), "case");
    }

    #[test]
    fn commands_can_be_pasted() {
        assert_eq!(quoted("--size"), "--size");
        assert_eq!(quoted("my room.glb"), "'my room.glb'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
    }
}
