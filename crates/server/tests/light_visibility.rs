//! How much of each light points see, from rays over bytes to a client that shades with the lights' exact shapes.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use dapple_scene::area_lights::{AreaLights, luminance};
use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, Pose, Scene, builtin};
use dapple_store::light_visibility::{LightVisibility, OPEN};
use dapple_store::points::{CellGrid, PointLayout, PointStore};
use dapple_stream::{Limits, Publisher, PublisherConfig, Spending, Subscriber};
use dapple_trace::psao::generate::{GenerateParams, GeneratedPoints, generate_points};
use dapple_trace::rtao::Site;
use dapple_trace::slc::{LightTracker, TrackerParams, VisibilityCounts, VisibilityParams};
use dapple_trace::{Tracer, offset_origin};
use rayon::prelude::*;
use std::sync::Arc;

const HZ: f64 = 15.0;

struct World {
    scene: Scene,
    points: GeneratedPoints,
    /// Places between the points, where a client looks.
    between: GeneratedPoints,
    /// Instances that stay where they are at rest.
    held: Vec<usize>,
}

impl World {
    /// About so many points.
    fn new(name: &str, detail: f32, goal: usize) -> World {
        let glb = builtin::glb(name, detail).unwrap();
        let scene = dapple_scene::load(&format!("{name}.glb"), &glb, &NoFiles).unwrap();
        let rest = scene.pose(0.0);
        let tracer = Tracer::new(&scene, &rest);
        let lay = |goal: usize, seed| {
            let at = |points_per_m2| {
                let params =
                    GenerateParams { points_per_m2, seed, inside_rays: 16, ..GenerateParams::default() };
                generate_points(&scene, &rest, &tracer, &params, &|_| ()).unwrap()
            };
            let few = at(1.0);
            at(goal as f32 / few.layout.len().max(1) as f32)
        };
        let (points, between) = (lay(goal, 0), lay(4000, 99));
        World { scene, points, between, held: Vec::new() }
    }

    /// The scene in motion, but for what is held.
    fn pose(&self, time_s: f64) -> Pose {
        let (mut pose, rest) = (self.scene.pose(time_s), self.scene.pose(0.0));
        for &instance in &self.held {
            pose.instances[instance] = rest.instances[instance].clone();
        }
        pose
    }

    /// All lights but one are held.
    fn with_one_mover(mut self, mover: usize) -> World {
        let pose = self.scene.pose(0.0);
        let lights = AreaLights::new(&self.scene, &pose);
        let held = (0..lights.len()).filter(|light| *light != mover);
        let held =
            held.filter_map(|light| lights.instance(light).map(|instance| instance as usize)).collect();
        self.held = held;
        self
    }
}

fn tracker(world: &World, pose: &Pose, tracer: &Tracer, params: TrackerParams) -> LightTracker {
    let points = (&world.points.layout, &world.points.anchors[..]);
    LightTracker::new(&world.scene, pose, tracer, points, params).unwrap()
}

/// A store of points that are all open, with these values of lights: what comes of visibility itself costs nothing.
fn lit(layout: &Arc<PointLayout>, values: &LightVisibility) -> PointStore {
    let store = PointStore::new(layout.clone(), vec![255; layout.len()]).unwrap();
    store.with_lights(values.clone()).unwrap()
}

/// What a run came to.
#[derive(Default)]
struct Run {
    lights: usize,
    points: usize,
    join_bytes: usize,
    frames: usize,
    bytes: usize,
    most_bytes: usize,
    sent: usize,
    counts: VisibilityCounts,
    step_s: f64,
    /// RMS over range at points and between them: as traced, and as a client holds it.
    at_points: [f64; 2],
    between: [f64; 2],
}

/// Error of irradiance at places whose visibility is given, over the range; truth by 128 rays to each light.
fn error(
    (scene, pose, tracer): (&Scene, &Pose, &Tracer),
    places: &[Option<Site>],
    range: &mut Option<f32>,
    visible: &(dyn Fn(usize, &Site, usize) -> Option<f32> + Sync),
) -> f64 {
    let lights = AreaLights::new(scene, pose);
    let pairs: Vec<(f32, f32)> = places
        .par_iter()
        .enumerate()
        .filter_map(|(at, site)| {
            let site = site.as_ref()?;
            let origin = offset_origin(site.position_world, site.normal_world);
            let (mut truth, mut client) = (0.0, 0.0);
            for light in 0..lights.len() {
                if lights.arriving(light, site.position_world, site.normal_world) <= 0.0 {
                    continue;
                }
                let (mut reaches, mut shares) = (Vec::new(), Vec::new());
                for i in 0..128u32 {
                    // Another sequence than the one that is tested: Kronecker's of the golden ratio's relatives, moved by the place.
                    let u = [0.819_172_5, 0.671_043_6, 0.549_700_5f32]
                        .map(|step| (step * (i as f32 + 0.5) + 0.377 * (at % 97) as f32).fract());
                    let Some(sample) = lights.sample_light(light as u32, origin, u) else { continue };
                    let cosine = site.normal_world.dot(sample.to_light_world);
                    if cosine > 0.0 {
                        reaches.push(sample.reach());
                        shares.push(cosine * luminance(sample.radiance) / sample.density_per_sr / 128.0);
                    }
                }
                let open: f32 = shares.iter().sum();
                if open <= 0.0 {
                    continue;
                }
                let blocked = tracer.occlusion(origin, &reaches, 1.0);
                let seen = (0..shares.len()).filter(|i| blocked[i / 64] >> (i % 64) & 1 == 0);
                truth += seen.map(|i| shares[i]).sum::<f32>();
                client += open * visible(at, site, light).unwrap_or(1.0);
            }
            Some((truth, client))
        })
        .collect();
    // The brightest hundredth counts as white.
    let range = *range.get_or_insert_with(|| {
        let mut sorted: Vec<f32> = pairs.iter().map(|pair| pair.0).collect();
        sorted.sort_by(f32::total_cmp);
        sorted[sorted.len() * 99 / 100].max(f32::MIN_POSITIVE)
    });
    let off =
        |&(truth, client): &(f32, f32)| f64::from((truth.min(range) - client.min(range)) / range).powi(2);
    (pairs.iter().map(off).sum::<f64>() / pairs.len() as f64).sqrt()
}

/// Visible fraction between points: of those near, on the same side, that the light reaches, by distance.
fn between<'a>(
    sites: &'a [Option<Site>],
    grid: &'a CellGrid,
    lights: &'a AreaLights<'a>,
    values: &'a LightVisibility,
) -> impl Fn(usize, &Site, usize) -> Option<f32> + Sync + 'a {
    move |_, place, light| {
        let mut near = Vec::new();
        grid.gather(grid.cell_of(place.position_world), 1, &mut near);
        let (mut sum, mut weights) = (0.0, 0.0);
        for point in near {
            let Some(site) = sites[point as usize].as_ref() else { continue };
            let offset = site.position_world - place.position_world;
            let facing = site.normal_world.dot(place.normal_world);
            let tent = 1.0 - offset.length() / grid.cell_m();
            let flat = 1.0 - 4.0 * offset.dot(place.normal_world).abs() / grid.cell_m();
            if facing <= 0.5 || tent <= 0.0 || flat <= 0.0 {
                continue;
            }
            if lights.arriving(light, site.position_world, site.normal_world) <= 0.0 {
                continue;
            }
            let weight = tent * flat * facing.powi(4);
            sum += weight * values.fraction(point as usize, light as u32)?;
            weights += weight;
        }
        (weights > 0.0).then(|| sum / weights)
    }
}

/// Positions for a grid; what has none lies far away.
fn positions(sites: &[Option<Site>]) -> Vec<Vec3> {
    sites.iter().map(|site| site.as_ref().map_or(Vec3::splat(1e9), |site| site.position_world)).collect()
}

/// Plays `seconds` to a client; every few frames compares with truth.
fn play(
    world: &World,
    start_s: f64,
    seconds: f64,
    params: &VisibilityParams,
    relative: f32,
    look: bool,
) -> Run {
    let (scene, layout) = (&world.scene, &world.points.layout);
    let mut pose = world.pose(start_s);
    let mut tracer = Tracer::new(scene, &pose);
    let lights = TrackerParams { visibility: *params, tolerance: relative };
    let mut tracker = tracker(world, &pose, &tracer, lights);
    let mut run = Run { points: layout.len(), lights: tracker.values().lights() as usize, ..Run::default() };
    let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
    let open = PointStore::new(layout.clone(), vec![255; layout.len()]).unwrap();
    let without = publisher.publish(&open).unwrap().bytes.len();
    let joined = publisher.publish(&lit(layout, tracker.values())).unwrap().bytes;
    run.join_bytes = joined.len() - without;
    let mut client = Subscriber::new(None, Limits::default());
    client.receive(&joined).unwrap();
    let mut range = None;
    error((scene, &pose, &tracer), &world.between.sites_world(scene, &pose), &mut range, &|_, _, _| {
        Some(1.0)
    });
    let mut looks = 0.0;
    for frame in 1..=(seconds * HZ) as u32 {
        let now = world.pose(start_s + f64::from(frame) / HZ);
        let begun = std::time::Instant::now();
        tracer.update(scene, &now);
        let counts = tracker.step(scene, &now, &tracer, &world.points.anchors, None);
        let tolerances = tracker.tolerances(client.lights().unwrap(), scene, &now);
        let spending = Spending { light_tolerances: &tolerances, ..Spending::default() };
        let sent = publisher.publish_within(&lit(layout, tracker.values()), &spending);
        run.step_s += begun.elapsed().as_secs_f64();
        if let Some(sent) = sent {
            client.receive(&sent.bytes).unwrap();
            assert_eq!(client.store(), publisher.store(), "frame {frame}");
            run.sent += client.light_changes().len();
            run.bytes += sent.bytes.len();
            run.most_bytes = run.most_bytes.max(sent.bytes.len());
        }
        run.frames += 1;
        run.counts.traced += counts.traced;
        run.counts.changed += counts.changed;
        run.counts.rays += counts.rays;
        pose = now;
        if look && frame % 15 == 0 {
            looks += 1.0;
            let lights = AreaLights::new(scene, &pose);
            let posed = (scene, &pose, &tracer);
            let places = world.between.sites_world(scene, &pose);
            let sites = world.points.sites_world(scene, &pose);
            let grid = CellGrid::new(&positions(&sites), 1.6 * layout.spacing_m());
            for (i, held) in [tracker.values(), client.lights().unwrap()].into_iter().enumerate() {
                let at = |point: usize, _: &Site, light: usize| held.fraction(point, light as u32);
                run.at_points[i] += error(posed, &sites, &mut range, &at).powi(2);
                run.between[i] +=
                    error(posed, &places, &mut range, &between(&sites, &grid, &lights, held)).powi(2);
            }
        }
    }
    for sum in run.at_points.iter_mut().chain(&mut run.between) {
        *sum = (*sum / f64::max(looks, 1.0)).sqrt();
    }
    // What an update left alone is what all rays together say.
    let (fresh, _) = tracker.traced_afresh(scene, &pose, &tracer);
    assert!(&fresh == tracker.values());
    run
}

#[test]
fn a_client_sees_what_the_server_traced_and_a_still_scene_sends_nothing() {
    let world = World::new("street", 0.05, 1500);
    let run = play(&world, 1.0, 0.7, &VisibilityParams::default(), 0.1, false);
    assert!(run.bytes > 0 && run.sent > 20 && run.counts.changed as usize >= run.sent, "{} sent", run.sent);
    assert!(run.counts.rays < 17 * run.counts.traced);
    assert!(run.join_bytes * 8 < 4 * run.points * run.lights, "{} bytes", run.join_bytes);
    let still = World::new("atrium-lamps", 0.05, 1500);
    // Nothing in front of a lamp moves while nothing moves.
    let pose = still.scene.pose(2.0);
    let tracer = Tracer::new(&still.scene, &pose);
    let layout = &still.points.layout;
    let mut tracker = tracker(&still, &pose, &tracer, TrackerParams::default());
    let values = tracker.values().values();
    assert!(tracker.first_counts().traced > 0 && values.iter().any(|v| *v > 0 && *v < OPEN));
    let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
    publisher.publish(&lit(layout, tracker.values())).unwrap();
    let counts = tracker.step(&still.scene, &pose, &tracer, &still.points.anchors, None);
    assert_eq!(counts, VisibilityCounts::default());
    assert!(publisher.publish(&lit(layout, tracker.values())).is_none());
}

#[test]
#[ignore = "a measurement, minutes long: prints bits and errors of light visibility over the wire"]
fn bits_and_errors() {
    println!(
        "scene, points, lights, T: join kB; kbit/s (largest frame kB); sent, changed, traced a frame; rays a traced; server ms a frame"
    );
    let line = |name: &str, relative: f32, run: &Run| {
        let frames = run.frames as f64;
        let db = |e: f64| -20.0 * e.log10();
        println!(
            "{name}, {}, {}, {relative}: {:.2}; {:.1} ({:.2}); {:.1}, {:.1}, {:.0}; {:.1}; {:.1}",
            run.points,
            run.lights,
            run.join_bytes as f64 / 1e3,
            run.bytes as f64 * 8e-3 * HZ / frames,
            run.most_bytes as f64 / 1e3,
            run.sent as f64 / frames,
            run.counts.changed as f64 / frames,
            run.counts.traced as f64 / frames,
            run.counts.rays as f64 / run.counts.traced.max(1) as f64,
            1e3 * run.step_s / frames,
        );
        let [a, b] = run.at_points;
        let [c, d] = run.between;
        println!(
            "    RMS/range at points {a:.4} traced, {b:.4} client ({:.2}, {:.2} dB); between {c:.4}, {d:.4} ({:.2}, {:.2} dB)",
            db(a),
            db(b),
            db(c),
            db(d)
        );
    };
    for goal in [4000, 12_000, 30_000] {
        let world = World::new("street", 0.5, goal);
        let tolerances: &[f32] = if goal == 12_000 { &[0.0, 0.03, 0.1, 0.2, 0.3] } else { &[0.1] };
        for &relative in tolerances {
            line("street", relative, &play(&world, 2.0, 3.0, &VisibilityParams::default(), relative, true));
        }
        if goal == 12_000 {
            for (name, rays, first) in
                [("street, 8 rays", 8, 4), ("street, 16 rays, all", 16, 16), ("street, 32 rays", 32, 4)]
            {
                let params = VisibilityParams { rays, first, ..VisibilityParams::default() };
                line(name, 0.1, &play(&world, 2.0, 3.0, &params, 0.1, true));
            }
        }
    }
    for mover in 0..3 {
        let name = format!("street, light {mover} alone moves");
        for goal in [12_000, 30_000, 126_000] {
            let world = World::new("street", 0.5, goal).with_one_mover(mover);
            let tolerances: &[f32] = if goal == 30_000 { &[0.1, 0.3, 0.5] } else { &[0.1] };
            for &relative in tolerances {
                line(
                    &name,
                    relative,
                    &play(&world, 2.0, 3.0, &VisibilityParams::default(), relative, goal < 100_000),
                );
            }
        }
    }
    let world = World::new("atrium-lamps", 0.5, 12_000);
    line("atrium-lamps", 0.1, &play(&world, 2.0, 3.0, &VisibilityParams::default(), 0.1, true));
}
