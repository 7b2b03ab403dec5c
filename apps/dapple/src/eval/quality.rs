//! `dapple quality`: how well each reconstruction finds visibility over all surfaces, and how much leaks under walls.

use std::fmt::Write;
use std::sync::Arc;

use anyhow::{Result, bail};
use dapple_render::psao::atlas::{AtlasParams, VisibilityAtlas};
use dapple_render::psao::hash::PointHash;
use dapple_render::psao::{Hat, Kernel, PointIndex, reconstruct};
use dapple_scene::Scene;
use dapple_store::charts::Cuts;
use dapple_store::points::PointStore;
use dapple_trace::Tracer;
use dapple_trace::psao::cuts::find_cuts;
use dapple_trace::psao::generate::{GenerateParams, generate_points};
use dapple_trace::psao::update::{UpdateParams, Updater};
use rayon::prelude::*;
use serde::Serialize;

use super::samples::{Errors, Place, SampleParams, Samples};
use super::thin::{Side, ThinScene};
use crate::args::QualityArgs;
use crate::light::adaptive;
use crate::picture::write_file;
use crate::progress::Bar;
use crate::source;

/// Takes what was found at one density: points a m² and how far they follow the gradient, the store, the samples, and a list a method.
type Take<'a> = &'a mut dyn FnMut((f32, f32), &PointStore, &Samples, Vec<Found>);

/// Everything one run found.
#[derive(Debug, Serialize)]
struct Report {
    schema: u32,
    command: String,
    radius_m: f32,
    point_rays: u32,
    reference_rays: u32,
    time_s: f64,
    seed: u32,
    surfaces: Vec<SurfaceRow>,
    leaks: Vec<LeakRow>,
}

/// One reconstruction of one scene at one density.
#[derive(Debug, Serialize)]
struct SurfaceRow {
    scene: String,
    points_per_m2: f32,
    points: u64,
    /// How far density follows the gradient of visibility.
    adaptive: f32,
    method: &'static str,
    all: Class,
    /// Fronts of what stands still, and of what the animation moves.
    #[serde(rename = "static")]
    still: Class,
    movers: Class,
    /// Backs of double-sided surfaces, which are the insides of closed ones.
    backs: Class,
    /// Points that the paper's cells and buckets had no room for.
    #[serde(skip_serializing_if = "Option::is_none")]
    discarded: Option<u32>,
}

/// Errors over one class of places.
#[derive(Debug, Serialize)]
struct Class {
    places: u64,
    psnr_db: Option<f64>,
}

/// Errors near the wall of a thin scene.
#[derive(Debug, Serialize)]
struct LeakRow {
    scene: &'static str,
    points_per_m2: f32,
    adaptive: f32,
    method: &'static str,
    places: u64,
    /// Mean of found − true visibility within 11 cm of the wall, on the dark and on the open side.
    dark_bias: Option<f64>,
    open_bias: Option<f64>,
    /// Over those places, and over all surfaces.
    near_psnr_db: Option<f64>,
    all_psnr_db: Option<f64>,
}

/// Visibility as one method finds it.
struct Found {
    method: &'static str,
    visibility: Vec<f32>,
    discarded: Option<u32>,
}

/// What is the same for all scenes of a run.
struct Run<'a> {
    args: &'a QualityArgs,
    /// Points a m², and how far they follow the gradient of visibility. What follows it is compared with what is uniform.
    densities: Vec<(f32, f32)>,
}

/// Runs, prints two tables and writes JSON where asked.
pub(crate) fn run(args: &QualityArgs) -> Result<()> {
    if !(1..=65_536).contains(&args.reference_rays) {
        bail!("--reference-rays is {}, must be 1 to 65536", args.reference_rays);
    }
    if !(100..=10_000_000).contains(&args.samples) {
        bail!("--samples is {}, must be 100 to 10000000", args.samples);
    }
    if let Some(bad) = args.points.iter().find(|n| !(n.is_finite() && **n > 0.0)) {
        bail!("--points has {bad}, must be above 0");
    }
    let adaptive = adaptive(&args.visibility)?;
    let of = |&points: &f32| [Some((points, 0.0)), (adaptive > 0.0).then_some((points, adaptive))];
    let run = Run { args, densities: args.points.iter().flat_map(of).flatten().collect() };
    let (mut surfaces, mut leaks) = (Vec::new(), Vec::new());
    let mut radius_m = 0.6;
    if !args.leaks {
        let loaded = source::load(&args.scene, Some(("atrium", 1.0)))?;
        let (radius, factor) = source::resolve_radius(&loaded.scene, &args.visibility)?;
        radius_m = radius;
        run.surfaces(&loaded.title, &loaded.scene, radius, factor, &mut surfaces)?;
        say!("{}", surface_table(&surfaces));
    } else {
        for thin in [ThinScene::shelf(), ThinScene::shelves()] {
            run.leaks(&thin, &mut leaks)?;
        }
        say!("{}", leak_table(&leaks));
    }
    if let Some(path) = &args.output {
        let report = Report {
            schema: 1,
            command: std::env::args().skip(1).fold("dapple".to_owned(), |line, a| line + " " + &a),
            radius_m,
            point_rays: args.visibility.point_rays,
            reference_rays: args.reference_rays,
            time_s: args.time,
            seed: args.visibility.seed,
            surfaces,
            leaks,
        };
        write_file(path, &serde_json::to_vec_pretty(&report)?)?;
    }
    Ok(())
}

impl Run<'_> {
    fn surfaces(
        &self,
        title: &str,
        scene: &Arc<Scene>,
        radius_m: f32,
        factor: f32,
        rows: &mut Vec<SurfaceRow>,
    ) -> Result<()> {
        self.each(
            scene,
            radius_m,
            factor,
            self.args.time,
            &mut |(points_per_m2, adaptive), store, samples, found| {
                for Found { method, visibility, discarded } in found {
                    let class = |of: &dyn Fn(usize) -> bool| {
                        let errors = Errors::over(&samples.truth, &visibility, of);
                        Class { places: errors.places, psnr_db: errors.psnr_db() }
                    };
                    rows.push(SurfaceRow {
                        scene: title.to_owned(),
                        points_per_m2,
                        points: store.layout().len() as u64,
                        adaptive,
                        method,
                        all: class(&|_| true),
                        still: class(&|i| !samples.places[i].back && !samples.moving[i]),
                        movers: class(&|i| !samples.places[i].back && samples.moving[i]),
                        backs: class(&|i| samples.places[i].back),
                        discarded,
                    });
                }
            },
        )
    }

    fn leaks(&self, thin: &ThinScene, rows: &mut Vec<LeakRow>) -> Result<()> {
        let scene = Arc::new(thin.scene.clone());
        self.each(&scene, 0.6, 1.0, 0.0, &mut |(points_per_m2, adaptive), _, samples, found| {
            let sides: Vec<Option<Side>> =
                samples.places.iter().map(|p| thin.side(p.rest.instance, p.position_world)).collect();
            for Found { method, visibility, .. } in found {
                let over = |of: &dyn Fn(usize) -> bool| Errors::over(&samples.truth, &visibility, of);
                let near = over(&|i| sides[i].is_some());
                rows.push(LeakRow {
                    scene: thin.name,
                    points_per_m2,
                    adaptive,
                    method,
                    places: near.places,
                    dark_bias: over(&|i| sides[i] == Some(Side::Dark)).bias(),
                    open_bias: over(&|i| sides[i] == Some(Side::Open)).bias(),
                    near_psnr_db: near.psnr_db(),
                    all_psnr_db: over(&|_| true).psnr_db(),
                });
            }
        })
    }

    /// Every density of a scene: its store, the same samples each time, and what each method finds there.
    fn each(
        &self,
        scene: &Arc<Scene>,
        radius_m: f32,
        factor: f32,
        time_s: f64,
        take: Take<'_>,
    ) -> Result<()> {
        let visibility = &self.args.visibility;
        let rest_pose = scene.pose(0.0);
        let rest_tracer = Tracer::new(scene, &rest_pose);
        let pose = scene.pose(time_s);
        let tracer = Tracer::new(scene, &pose);
        let mut samples = None;
        for &(points_per_m2, adaptive) in &self.densities {
            let bar = Bar::spinner(&format!("points, N = {points_per_m2}"));
            let generate = GenerateParams {
                points_per_m2: points_per_m2 * factor,
                seed: visibility.seed,
                adaptive,
                radius_m,
                ..GenerateParams::default()
            };
            let points = generate_points(scene, &rest_pose, &rest_tracer, &generate, &|_| ())?;
            if samples.is_none() {
                bar.message("truth");
                // Half of the points are kept, so this is the surface that carries any.
                let area_m2 = points.layout.len() as f32 / (0.5 * generate.points_per_m2);
                let params = SampleParams {
                    per_m2: self.args.samples as f32 / area_m2,
                    rays: self.args.reference_rays,
                    radius_m,
                    seed: visibility.seed,
                };
                samples = Some(Samples::new(scene, (&rest_pose, &rest_tracer), (&pose, &tracer), &params)?);
            }
            let Some(samples) = &samples else { continue };
            bar.message(&format!("visibility, N = {points_per_m2}"));
            let update = UpdateParams { rays: visibility.point_rays, radius_m, ..UpdateParams::default() };
            let updater = Updater::new(scene, &pose, &tracer, points, update, &|_| ())?;
            bar.message(&format!("cuts, N = {points_per_m2}"));
            let cuts = find_cuts(scene, &rest_pose, &rest_tracer, updater.store().layout(), &|_| ());
            let found = find(scene, updater.store(), &cuts, samples)?;
            take((points_per_m2, adaptive), updater.store(), samples, found);
        }
        Ok(())
    }
}

/// What each method makes of a store.
fn find(scene: &Scene, store: &PointStore, cuts: &Cuts, samples: &Samples) -> Result<Vec<Found>> {
    let fragments = samples.fragments();
    let index = PointIndex::new(store.layout());
    let by_kernel = |kernel| reconstruct(&index, store.visibility(), &kernel, &fragments);
    let by_atlas = |cuts: Option<&Cuts>| {
        let mut atlas = VisibilityAtlas::new(store.layout().clone(), scene, cuts, AtlasParams::default());
        while !atlas.work(scene, store.visibility(), usize::MAX).is_complete() {}
        let look_up = |p: &Place| atlas.visibility(p.rest.instance, p.triangle, p.barycentrics, p.back, 1.0);
        samples.places.par_iter().map(look_up).collect::<Vec<f32>>()
    };
    let paper = PointHash::new(store.layout(), store.visibility(), Hat::default())?;
    Ok(vec![
        Found {
            method: "paper",
            visibility: paper.reconstruct(&fragments),
            discarded: Some(paper.overflow().points()),
        },
        Found { method: "hat", visibility: by_kernel(Kernel::Hat(Hat::default())), discarded: None },
        Found { method: "mls", visibility: by_kernel(Kernel::default()), discarded: None },
        Found { method: "atlas-uncut", visibility: by_atlas(None), discarded: None },
        Found { method: "atlas", visibility: by_atlas(Some(cuts)), discarded: None },
    ])
}

fn db(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |v| format!("{v:.2}"))
}

/// A Markdown table of PSNR over surfaces.
fn surface_table(rows: &[SurfaceRow]) -> String {
    let mut text = String::new();
    if let Some(row) = rows.first() {
        let (all, backs, movers) = (row.all.places, row.backs.places, row.movers.places);
        let _ =
            writeln!(text, "{}: {all} places on surfaces, {backs} on backs, {movers} on movers\n", row.scene);
    }
    text.push_str("| N | points | adaptive | method | all dB | static dB | movers dB | backs dB | points discarded |\n|---|---|---|---|---|---|---|---|---|\n");
    for row in rows {
        let SurfaceRow { points_per_m2, points, adaptive, method, .. } = row;
        let [all, still, movers, backs] =
            [&row.all, &row.still, &row.movers, &row.backs].map(|c| db(c.psnr_db));
        let discarded = row.discarded.map_or_else(|| "–".to_owned(), |d| d.to_string());
        let _ = writeln!(
            text,
            "| {points_per_m2} | {points} | {adaptive} | {method} | {all} | {still} | {movers} | {backs} | {discarded} |"
        );
    }
    text
}

/// A Markdown table of the leak score.
fn leak_table(rows: &[LeakRow]) -> String {
    let signed = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |v| format!("{v:+.3}"));
    let mut text = String::from(
        "| scene | N | adaptive | method | places | dark side | open side | near the wall dB | all dB |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    for row in rows {
        let LeakRow { scene, points_per_m2, adaptive, method, places, .. } = row;
        let (dark, open) = (signed(row.dark_bias), signed(row.open_bias));
        let (near, all) = (db(row.near_psnr_db), db(row.all_psnr_db));
        let _ = writeln!(
            text,
            "| {scene} | {points_per_m2} | {adaptive} | {method} | {places} | {dark} | {open} | {near} | {all} |"
        );
    }
    text
}
