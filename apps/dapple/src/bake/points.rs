//! Points with their visibility: as a PLY file, or as a recording of one snapshot.

use anyhow::{Context, Result};
use dapple_scene::{Pose, Scene};
use dapple_store::points::PointStore;
use dapple_stream::{Publisher, PublisherConfig, Recorder, RecordingHeader};
use dapple_trace::Tracer;
use dapple_trace::psao::cuts::find_cuts;
use dapple_trace::psao::generate::{GenerateParams, GeneratedPoints, generate_points};
use dapple_trace::rtao::{RtaoParams, Site, trace_visibility_with_progress};

use crate::light::{microseconds, scene_seconds};
use crate::progress::Bar;

/// Points of a scene, each with its visibility at one time.
pub(crate) struct Points<'a> {
    scene: &'a Scene,
    /// The scene at time 0, where points are laid.
    pose: Pose,
    tracer: Tracer,
    generated: GeneratedPoints,
    /// Where each is at the time of its visibility, if anywhere.
    sites: Vec<Option<Site>>,
    visibility: Vec<f32>,
}

impl<'a> Points<'a> {
    /// Lays points and traces them at `time_s`.
    pub(crate) fn bake(
        scene: &'a Scene,
        time_s: f64,
        points_per_m2: f32,
        params: &RtaoParams,
    ) -> Result<Points<'a>> {
        let pose = scene.pose(0.0);
        let tracer = Tracer::new(scene, &pose);
        let bar = Bar::new("laying points", scene.instances.len() as u64);
        let generate =
            GenerateParams { points_per_m2, seed: params.seed as u32, ..GenerateParams::default() };
        let generated = generate_points(scene, &pose, &tracer, &generate, &|done| bar.set(done as u64))?;
        drop(bar);
        let then = scene.pose(time_s);
        let sites = generated.sites_world(scene, &then);
        let mut tracer_then = tracer.clone();
        tracer_then.update(scene, &then);
        let bar = Bar::new("points", sites.len() as u64);
        // A site without a normal is open.
        let nowhere = Site { position_world: Default::default(), normal_world: Default::default(), key: 0 };
        let traced: Vec<Site> = sites.iter().map(|site| site.unwrap_or(nowhere)).collect();
        let mut visibility = vec![1.0; traced.len()];
        trace_visibility_with_progress(&tracer_then, &traced, params, &mut visibility, &|done| bar.set(done));
        Ok(Points { scene, pose, tracer, generated, sites, visibility })
    }

    pub(crate) fn len(&self) -> usize {
        self.visibility.len()
    }

    /// A binary PLY, little-endian.
    pub(crate) fn to_ply(&self) -> Vec<u8> {
        let sets = self.generated.layout.sets();
        let instances = sets.iter().flat_map(|set| std::iter::repeat_n(set.instance, set.len()));
        let placed = instances
            .zip(&self.sites)
            .zip(&self.visibility)
            .filter_map(|((instance, site), visibility)| Some((instance, (*site)?, *visibility)));
        let count = self.sites.iter().flatten().count();
        let mut file = format!(
            "ply\nformat binary_little_endian 1.0\ncomment dapple {}: visibility, 1 open, 0 blocked\nelement vertex {count}\n\
             property float x\nproperty float y\nproperty float z\n\
             property float nx\nproperty float ny\nproperty float nz\n\
             property float visibility\n\
             property uchar red\nproperty uchar green\nproperty uchar blue\n\
             property int instance\nend_header\n",
            env!("CARGO_PKG_VERSION"),
        )
        .into_bytes();
        for (instance, site, visibility) in placed {
            let numbers = site.position_world.to_array().into_iter().chain(site.normal_world.to_array());
            file.extend(numbers.chain([visibility]).flat_map(f32::to_le_bytes));
            file.extend([unorm8(visibility); 3]);
            file.extend((instance as i32).to_le_bytes());
        }
        file
    }

    /// A recording of one snapshot, for players of streams.
    pub(crate) fn to_recording(&self, name: &str) -> Result<Vec<u8>> {
        let layout = &self.generated.layout;
        let values = self.visibility.iter().map(|&v| unorm8(v)).collect();
        let store = PointStore::new(layout.clone(), values)?;
        let hash = self.scene.hash().0;
        let mut publisher = Publisher::new(hash, PublisherConfig::default());
        let bar = Bar::new("looking behind walls", layout.sets().len() as u64);
        let cuts = find_cuts(self.scene, &self.pose, &self.tracer, layout, &|done| bar.set(done as u64));
        drop(bar);
        publisher.set_cuts(layout.clone(), cuts);
        let frame = publisher.publish(&store).context("the points make no snapshot")?;
        let duration_us = microseconds(scene_seconds(self.scene));
        let header = RecordingHeader { scene_hash: hash, name: name.to_owned(), duration_us };
        let (mut recorder, mut bytes) = Recorder::new(&header)?;
        bytes.extend(recorder.frame(0, &frame.bytes)?);
        bytes.extend(recorder.finish());
        Ok(bytes)
    }
}

fn unorm8(value: f32) -> u8 {
    (value * 255.0).round().clamp(0.0, 255.0) as u8
}
