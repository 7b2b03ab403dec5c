//! Studies of direct light from area lights: light cones and their rivals ([Stadlbauer2023]).

pub(super) mod ablation;
pub(super) mod table;
pub(super) mod viewers;

use std::path::Path;
use std::time::Instant;

use anyhow::{Result, bail};
use dapple_metrics::{PIXELS_PER_DEGREE, flip, mean_bias, psnr, ssim};
use dapple_render::image::{LinearImage, Rgb8Image, ToneMap};
use dapple_scene::Pose;
use dapple_scene::area_lights::{AreaLights, Environment};
use dapple_scene::glam::Vec3;
use dapple_server::cones::Now;
use dapple_store::cones::Charting;

use super::Subject;
use super::medians::median;
use crate::direct_light::picture::read_environment;
use crate::direct_light::{CONES_MIB, Cost, Lighter, Seen, Technique, charts, warn_of_lights};
use crate::eval::stage::Stage;
use crate::picture::luma;

/// A scene whose lights have an area, along a path.
struct Lit<'a> {
    stage: &'a Stage<'a>,
    charting: Charting,
    environment: Option<Environment>,
}

impl<'a> Lit<'a> {
    fn new(subject: &'a Subject<'_>, environment: Option<&Path>) -> Result<Lit<'a>> {
        let stage = subject.stage()?;
        let pose = stage.scene().pose(0.0);
        let lights = AreaLights::new(stage.scene(), &pose);
        let environment = environment.map(read_environment).transpose()?;
        if lights.is_empty() && environment.is_none() {
            bail!("{} has no area light: nothing in it emits", stage.scene().name);
        }
        warn_of_lights(&lights);
        Ok(Lit { stage, charting: charts(stage.scene()), environment })
    }

    fn size(&self) -> [u32; 2] {
        super::size_of(self.stage)
    }

    /// Calls with the scene at one time.
    fn at<T>(&self, pose: &Pose, call: impl FnOnce(&Now<'_>, &AreaLights<'_>) -> Result<T>) -> Result<T> {
        let tracer = self.stage.tracer_in(pose);
        let environment = self.environment.as_ref();
        let now = Now { scene: self.stage.scene(), pose, tracer: &tracer, environment };
        call(&now, &now.lights(pose))
    }
}

/// A technique being watched.
struct Run {
    name: String,
    lighter: Lighter,
    /// Milliseconds of each watched step, by stage.
    stages: Vec<(&'static str, Vec<f64>)>,
    totals: Vec<f64>,
    cost: Cost,
    /// Whether there was no memory for some cones.
    has_overflowed: bool,
}

impl Run {
    fn new(name: impl Into<String>, technique: Technique) -> Result<Run> {
        let lighter = Lighter::new(technique, CONES_MIB)?;
        Ok(Run {
            name: name.into(),
            lighter,
            stages: Vec::new(),
            totals: Vec::new(),
            cost: Cost::default(),
            has_overflowed: false,
        })
    }

    /// One step, timed if it is `watched`.
    fn step(
        &mut self,
        now: &Now<'_>,
        lights: &AreaLights<'_>,
        seen: &[Seen],
        charting: &Charting,
        watched: bool,
    ) -> Result<Vec<Vec<Vec3>>> {
        let (mut last, mut total) = (Instant::now(), 0.0);
        let stages = &mut self.stages;
        let (pictures, cost) = self.lighter.light(now, lights, seen, charting, &mut |stage| {
            let ms = 1e3 * last.elapsed().as_secs_f64();
            total += ms;
            if watched {
                match stages.iter_mut().find(|(name, _)| *name == stage) {
                    Some((_, all)) => all.push(ms),
                    None => stages.push((stage, vec![ms])),
                }
            }
            last = Instant::now();
        })?;
        if watched {
            self.totals.push(total);
        }
        // Once of each.
        if let Some(why) = cost.refused("draw smaller pictures").filter(|_| !self.has_overflowed) {
            self.has_overflowed = true;
            tracing::warn!("{}: {why}", self.name);
        }
        self.cost = cost;
        Ok(pictures)
    }

    fn ms(&self) -> f64 {
        median(&self.totals)
    }

    fn stage_ms(&self, names: &[&str]) -> f64 {
        self.stages.iter().filter(|(name, _)| names.contains(name)).map(|(_, ms)| median(ms)).sum()
    }
}

/// A picture against the truth.
#[derive(Debug, Clone, Copy, Default)]
struct Quality {
    /// Mean squared error of what a display shows.
    mse: f64,
    ssim: f64,
    flip: f64,
    /// See [`mean_bias`].
    bias: f64,
    count: f64,
}

impl Quality {
    fn add(&mut self, size: [u32; 2], truth: &[Vec3], found: &[Vec3]) -> Result<()> {
        let [width, height] = size;
        let [a, b] = [truth, found].map(|pixels| shown(size, pixels));
        let unit =
            |p: &Rgb8Image| p.pixels.as_flattened().iter().map(|c| f32::from(*c) / 255.0).collect::<Vec<_>>();
        let db = psnr(&unit(&a), &unit(&b), 1.0)?;
        self.mse += 10f64.powf(-0.1 * db);
        self.ssim += ssim(width, height, &luma(&a.pixels), &luma(&b.pixels))?;
        self.flip +=
            flip(width, height, a.pixels.as_flattened(), b.pixels.as_flattened(), PIXELS_PER_DEGREE)?.mean;
        let [truth, found] = [truth, found].map(|p| p.iter().flat_map(Vec3::to_array).collect::<Vec<_>>());
        self.bias += mean_bias(width, height, &truth, &found)?;
        self.count += 1.0;
        Ok(())
    }

    fn psnr_db(&self) -> f64 {
        super::psnr_db(self.mse / self.count)
    }

    fn mean_ssim(&self) -> f64 {
        self.ssim / self.count
    }

    fn mean_flip(&self) -> f64 {
        self.flip / self.count
    }

    fn bias_percent(&self) -> f64 {
        100.0 * self.bias / self.count
    }
}

/// What a display shows.
fn shown([width, height]: [u32; 2], pixels: &[Vec3]) -> Rgb8Image {
    LinearImage { width, height, pixels: pixels.to_vec() }.to_rgb8(&ToneMap::default())
}
