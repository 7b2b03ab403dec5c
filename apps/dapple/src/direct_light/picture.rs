//! Direct light of one picture, for `dapple render`.

use std::str::FromStr;

use anyhow::{Context, Result, bail};
use dapple_client::Drawn;
use dapple_render::gbuffer::GBuffer;
use dapple_scene::area_lights::{AreaLights, Environment};
use dapple_scene::glam::Vec3;
use dapple_scene::{PosedCamera, Projection, Scene};
use dapple_server::cones::Now;
use dapple_store::cones::Charting;
use dapple_trace::Tracer;

use super::{Lighter, STEPS_HZ, Sampler, Seen, Technique, charts, warn_of_lights};
use crate::progress::Bar;

/// A method for direct light as the command line names it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DirectLight(pub(crate) Technique);

impl FromStr for DirectLight {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let (name, sampler) = match s.strip_suffix("-power") {
            Some(name) => (name, Sampler::Power),
            None => (s, Sampler::Best),
        };
        let rays = name.strip_prefix("rt-").and_then(|n| n.parse().ok()).filter(|n| (1..=65_536).contains(n));
        let technique = match name {
            "ris" => Technique::Ris { sampler },
            "restir-di" => Technique::Restir { sampler, unbiased: false },
            "slc-paper" => Technique::paper_cones(sampler),
            "slc" => Technique::cones().with_sampler(sampler),
            "slc-quick" => Technique::quick_cones().with_sampler(sampler),
            "slc-fast" => Technique::fast_cones().with_sampler(sampler),
            "slc-fine" => Technique::fine_cones().with_sampler(sampler),
            "slc-card" => Technique::cones().with_sampler(sampler).changed(|cones| cones.on_card = true),
            _ => Technique::rays(
                rays.ok_or("write rt-N (N rays a sample, 1 to 65536), ris, restir-di, slc-paper, slc, slc-fast, slc-quick, slc-fine or slc-card, each also with -power")?,
                sampler,
            ),
        };
        Ok(DirectLight(technique))
    }
}

/// What a picture's direct light comes from.
pub(crate) struct Lighting<'a> {
    pub(crate) technique: Technique,
    /// Steps that lead to the picture, for methods that remember.
    pub(crate) steps: u32,
    /// What cones may take.
    pub(crate) cones_mib: u64,
    pub(crate) environment: Option<&'a Environment>,
}

/// Adds the light of area lights to what is drawn, and the surroundings behind it.
pub(crate) fn add(
    lighting: &Lighting<'_>,
    scene: &Scene,
    camera: &PosedCamera,
    time_s: f64,
    drawn: &mut Drawn,
) -> Result<()> {
    let environment = lighting.environment;
    let lights = AreaLights::new(scene, &drawn.pose);
    warn_of_lights(&lights);
    if lights.is_empty() && environment.is_none() {
        bail!(
            "--direct-light: nothing in {} emits; give it an --environment, or leave the option out",
            scene.name
        );
    }
    let mut lighter = Lighter::new(lighting.technique, lighting.cones_mib)?;
    let charting = if lighter.has_cones() { charts(scene) } else { Charting::default() };
    let steps = if lighter.is_stateless() { 1 } else { lighting.steps.max(1) };
    let bar = Bar::new("direct light", u64::from(steps));
    let mut tracer = Tracer::new(scene, &drawn.pose);
    for step in 0..steps {
        let pose = scene.pose(time_s - f64::from(steps - 1 - step) / STEPS_HZ);
        tracer.update(scene, &pose);
        let now = Now { scene, pose: &pose, tracer: &tracer, environment };
        let lights = now.lights(&pose);
        // Places on surfaces are those of the picture, wherever they were.
        let seen = [Seen::of(&now, *camera, drawn.gbuffer.clone())];
        let (mut pictures, cost) = lighter.light(&now, &lights, &seen, &charting, &mut |_| ())?;
        let found = pictures.swap_remove(0);
        if step + 1 == steps {
            if let Some(why) = cost.refused(&format!(
                "give --light-memory more than {} MiB, or draw a smaller picture",
                lighting.cones_mib
            )) {
                tracing::warn!("{why}");
            }
            for ((direct, lit), point) in drawn.shaded.direct.iter_mut().zip(&found).zip(&seen[0].points) {
                if let Some(point) = point {
                    *direct += point.reflected_of(*lit);
                }
            }
        }
        bar.set(u64::from(step + 1));
    }
    if let Some(environment) = environment {
        show(environment, camera, &drawn.gbuffer, &mut drawn.shaded.direct);
    }
    Ok(())
}

/// Radiance of the surroundings where a picture shows nothing else.
fn show(environment: &Environment, camera: &PosedCamera, gbuffer: &GBuffer, direct: &mut [Vec3]) {
    let (width, height) = (gbuffer.width as f32, gbuffer.height as f32);
    for (i, (sample, radiance)) in gbuffer.samples().iter().zip(direct).enumerate() {
        if sample.is_covered() {
            continue;
        }
        let [x, y] = gbuffer.sample_position_px(i);
        let direction = match camera.projection {
            Projection::Perspective { yfov, .. } => {
                let half = libm::tanf(0.5 * yfov);
                Vec3::new(
                    (2.0 * x / width - 1.0) * half * width / height,
                    (1.0 - 2.0 * y / height) * half,
                    -1.0,
                )
            }
            Projection::Orthographic { .. } => Vec3::NEG_Z,
        };
        let world = camera.world_from_view.transform_vector3(direction).normalize_or(Vec3::Y);
        *radiance = environment.radiance(world);
    }
}

/// Reads an environment.
pub(crate) fn read_environment(path: &std::path::Path) -> Result<Environment> {
    /// 16384 × 8192 texels of four bytes.
    const MAX_BYTES: u64 = 1 << 29;
    let bytes = crate::source::read_limited(path, MAX_BYTES)
        .with_context(|| format!("cannot read the environment {}", path.display()))?;
    Environment::from_hdr(&bytes).with_context(|| path.display().to_string())
}
