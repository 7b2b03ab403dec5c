//! Entries against closed forms, still and while something changes.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use dapple_scene::area_lights::{AreaLights, Environment};
use dapple_scene::glam::{Affine3A, Mat3, Vec3};
use dapple_scene::{EmitterShape, Material, Pose, PosedInstance, Scene};
use dapple_store::charts::{ChartParams, ChartSet};
use dapple_store::cones::{
    BoundingEntry, CacheParams, Charting, ConeCache, ConeEntry, GRAZING_COSINE, LookUp, MomentEntry,
    PixelPlace, Requests, UpdateQueue, View,
};

use proptest::prelude::*;

use super::*;
use crate::test_support::{disc, quad, scene as placed, sphere};

/// A floor of 20 m, lights over it, and 14 × 14 places a millimetre apart about its middle.
pub(super) struct Rig {
    pub(super) scene: Scene,
    pub(super) pose: Pose,
    pixels: Vec<Option<PixelPlace>>,
    environment: Option<Environment>,
}

const SIDE: u32 = 14;

impl Rig {
    /// Lights: mesh, shape, radiance, where.
    pub(super) fn new(lights: Vec<(dapple_scene::Mesh, EmitterShape, f32, Affine3A)>) -> Rig {
        let at = |x, z| Vec3::new(x, 0.0, z);
        let floor = quad(at(-10.0, 10.0), at(10.0, 10.0), at(10.0, -10.0), at(-10.0, -10.0));
        let (mut meshes, mut maps) = (vec![floor.clone()], vec![(0, Affine3A::IDENTITY)]);
        for (i, (mesh, _, _, world)) in (1u32..).zip(&lights) {
            meshes.push(mesh.clone());
            maps.push((i, *world));
        }
        let (mut scene, pose) = placed(meshes, &maps);
        for (i, (_, shape, radiance, _)) in lights.iter().enumerate() {
            scene.materials.push(Material { emissive_factor: Vec3::splat(*radiance), ..Material::default() });
            scene.meshes[i + 1].parts[0].material = i as u32 + 1;
            scene.instances[i + 1].emitter = *shape;
        }
        let params = ChartParams { texel_m: 0.05, ..ChartParams::for_spacing(0.05, false) };
        let charts = ChartSet::new(&floor.positions, &floor.triangles, &params).unwrap();
        let charting = Charting::new(vec![Some(Arc::new(charts))]);
        let pixels = (0..SIDE * SIDE)
            .map(|i| {
                let (x, z) = ((i % SIDE) as f32 * 1e-3, 1e-3 + (i / SIDE) as f32 * 1e-3);
                // In the first triangle, of (−10, 10), (10, 10), (10, −10).
                let weights = [(x + 10.0) / 20.0 - (10.0 - z) / 20.0, (10.0 - z) / 20.0];
                let place = charting.place(0, 0, weights, at(x, z), Vec3::Y)?;
                Some(PixelPlace {
                    instance: 0,
                    triangle: 0,
                    barycentrics: weights,
                    place,
                    footprint_m: 7.8e-4,
                    lean: [0.0; 2],
                })
            })
            .collect();
        Rig { scene, pose, pixels, environment: None }
    }

    /// What of the shading normal of all places lies along their triangle's edges.
    pub(super) fn lean(&mut self, lean: [f32; 2]) {
        self.pixels.iter_mut().flatten().for_each(|pixel| pixel.lean = lean);
    }

    fn queue<E: ConeEntry>(&self, cache: &mut ConeCache<E>) -> UpdateQueue {
        let view = View { width: SIDE as usize, pixels: &self.pixels };
        cache.admit(&Requests::gather(&[view], &LookUp { bias: 1.0, blend: false }))
    }

    /// One step from one pose to another.
    pub(super) fn step(
        &self,
        cache: &mut ConeCache<MomentEntry>,
        before: &Pose,
        now: &Pose,
        params: &SlcParams,
    ) -> SlcCounts {
        let tracer = Tracer::new(&self.scene, now);
        let queue = self.queue(cache);
        let places = EntryPlaces::of(cache, &queue, &self.scene, before, now);
        let [then, lights] = [before, now].map(|pose| {
            let lights = AreaLights::new(&self.scene, pose);
            match &self.environment {
                Some(environment) => lights.with_environment(environment, pose),
                None => lights,
            }
        });
        let then = Moment { scene: &self.scene, pose: before, lights: &then };
        let changes = Changes::between(&then, &Moment { scene: &self.scene, pose: now, lights: &lights });
        MomentEntry::update_queue(cache, &queue, &places, &tracer, &changes, params)
    }

    pub(super) fn cache(&self) -> ConeCache<MomentEntry> {
        ConeCache::new(CacheParams::default()).unwrap()
    }

    /// As [`Rig::step`], with all entries after `steps` at rest.
    pub(super) fn settled(&self, steps: u32, params: &SlcParams) -> ConeCache<MomentEntry> {
        let mut cache = self.cache();
        for _ in 0..steps {
            self.step(&mut cache, &self.pose, &self.pose, params);
        }
        cache
    }
}

/// Mean irradiance of all entries.
pub(super) fn mean(cache: &ConeCache<MomentEntry>) -> f32 {
    let all: Vec<f32> = cache.ids().map(|id| cache.entry(id).unwrap().energy().x).collect();
    assert!(all.len() >= 150, "{}", all.len());
    all.iter().sum::<f32>() / all.len() as f32
}

pub(super) fn over(height: f32) -> Affine3A {
    Affine3A::from_translation(Vec3::Y * height)
}

/// Faces down.
fn downward(mesh: dapple_scene::Mesh) -> dapple_scene::Mesh {
    let mut mesh = mesh;
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    mesh
}

fn rectangle(a: f32, b: f32) -> dapple_scene::Mesh {
    let at = |x, z| Vec3::new(x, 0.0, z);
    downward(quad(at(-a, b), at(a, b), at(a, -b), at(-a, -b)))
}

/// A rectangle of 2a × 2b over its middle, at height 1.
fn rectangle_exact(a: f32, b: f32) -> f32 {
    let (p, q) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    4.0 * PI * (a / p * (b / p).atan() + b / q * (a / q).atan()) / TAU
}

#[track_caller]
pub(super) fn assert_near(found: f32, exact: f32, tolerance: f32) {
    assert!((found - exact).abs() <= tolerance * exact, "{found}, exactly {exact}");
}

#[test]
fn entries_have_the_irradiance_of_closed_forms() {
    let ball = |at: Vec3| {
        (sphere(Vec3::ZERO, 0.5, 16, 24), EmitterShape::Sphere, 10.0, Affine3A::from_translation(at))
    };
    let tilted = 75f32.to_radians();
    for (light, exact) in [
        (ball(Vec3::Y * 2.0), 10.0 * PI / 16.0),
        (ball(Vec3::new(2.0 * tilted.sin(), 2.0 * tilted.cos(), 0.0)), 10.0 * PI / 16.0 * tilted.cos()),
        ((downward(disc(Vec3::ZERO, 1.0, 64)), EmitterShape::Disc, 10.0, over(1.0)), 10.0 * PI / 2.0),
        ((rectangle(2.5, 1.0), EmitterShape::Rectangle, 10.0, over(1.0)), 10.0 * rectangle_exact(2.5, 1.0)),
        ((rectangle(2.5, 1.0), EmitterShape::Triangles, 10.0, over(1.0)), 10.0 * rectangle_exact(2.5, 1.0)),
    ] {
        let rig = Rig::new(vec![light]);
        let cache = rig.settled(40, &SlcParams::default());
        assert_near(mean(&cache), exact, 0.01);
    }
}

/// Rays leave a little above a surface. Places on lights are those seen from there: chosen from the surface, all of these would lie behind
/// the light's own face.
#[test]
fn a_light_close_by_does_not_hide_itself() {
    let light = (rectangle(0.375, 0.15), EmitterShape::Triangles, 10.0, over(0.15));
    let cache = Rig::new(vec![light]).settled(40, &SlcParams::default());
    assert_near(mean(&cache), 10.0 * rectangle_exact(2.5, 1.0), 0.03);
}

#[test]
fn irradiance_is_by_the_cosine_to_the_shading_normal() {
    let ball = |degrees: f32| {
        let angle = degrees.to_radians();
        let at = Vec3::new(2.0 * angle.cos(), 2.0 * angle.sin(), 0.0);
        (sphere(Vec3::ZERO, 0.2, 16, 24), EmitterShape::Sphere, 10.0, Affine3A::from_translation(at))
    };
    // Leans towards +X, along the first edge, by 53°.
    let leaning = |degrees: f32, lean: [f32; 2]| {
        let mut rig = Rig::new(vec![ball(degrees)]);
        rig.lean(lean);
        mean(&rig.settled(40, &SlcParams::default()))
    };
    let whole = 10.0 * PI * 0.01;
    for degrees in [20.0f32, 60.0, 110.0] {
        let cosine = (degrees - 53.1301).to_radians().cos();
        assert_near(leaning(degrees, [0.6, 0.0]) / whole, cosine.max(0.0), 0.015);
    }
    // Behind the leaning surface: pixels beside may lean otherwise.
    assert_near(leaning(155.0, [0.8, 0.0]) / whole, GRAZING_COSINE, 0.015);
    // Before it but under the floor.
    assert_eq!(leaning(-15.0, [0.8, 0.0]), 0.0);
    // Across the first edge it is another axis.
    assert_near(leaning(60.0, [0.0, 0.6]) / whole, 0.8 * 60f32.to_radians().sin(), 0.015);
}

#[test]
fn the_papers_cones_keep_all_energy_but_what_they_discard() {
    let rig = Rig::new(vec![(sphere(Vec3::ZERO, 0.5, 16, 24), EmitterShape::Sphere, 10.0, over(2.0))]);
    // Fluence of a ball: its solid angle.
    let exact = 10.0 * TAU * (1.0 - (1.0f32 - 1.0 / 16.0).sqrt());
    let fluence = |discard: bool| {
        let mut cache: ConeCache<BoundingEntry> = ConeCache::new(CacheParams::default()).unwrap();
        let mut params = PaperParams::default();
        params.bounding.discard = discard;
        let tracer = Tracer::new(&rig.scene, &rig.pose);
        let lights = AreaLights::new(&rig.scene, &rig.pose);
        let moment = Moment { scene: &rig.scene, pose: &rig.pose, lights: &lights };
        for _ in 0..60 {
            let queue = rig.queue(&mut cache);
            let places = EntryPlaces::of(&cache, &queue, &rig.scene, &rig.pose, &rig.pose);
            let changes = Changes::between(&moment, &moment);
            let counts = BoundingEntry::update_queue(&mut cache, &queue, &places, &tracer, &changes, &params);
            assert!(counts.rays > counts.updated, "samples and probes");
        }
        let all: Vec<f32> = cache.ids().map(|id| cache.entry(id).unwrap().energy().x).collect();
        all.iter().sum::<f32>() / all.len() as f32
    };
    assert_near(fluence(false), exact, 0.01);
    assert_near(fluence(true), exact, 0.04);
}

#[test]
fn a_still_scene_settles_and_then_takes_no_rays() {
    let lamp = (sphere(Vec3::ZERO, 0.3, 12, 16), EmitterShape::Sphere, 10.0, over(2.0));
    let rig = Rig::new(vec![lamp, (rectangle(1.0, 0.5), EmitterShape::Rectangle, 3.0, over(4.0))]);
    let params = SlcParams::default();
    let mut cache = rig.cache();
    let (mut steps, mut quiet) = (0, 0);
    loop {
        let counts = rig.step(&mut cache, &rig.pose, &rig.pose, &params);
        assert_eq!(counts.changed, 0);
        // Between two turns of all entries nothing may happen.
        quiet = if counts.rays == 0 { quiet + 1 } else { 0 };
        if quiet == 8 {
            break;
        }
        steps += 1;
        assert!(steps <= 90, "2 updates of 16 samples, then 15 in one of 5 frames up to 255, then quiet");
    }
    let entries: Vec<MomentEntry> = cache.ids().map(|id| *cache.entry(id).unwrap()).collect();
    rig.step(&mut cache, &rig.pose, &rig.pose, &params);
    let after: Vec<MomentEntry> = cache.ids().map(|id| *cache.entry(id).unwrap()).collect();
    assert_eq!(entries, after, "to the bit");
}

#[test]
fn a_light_that_leaves_is_forgotten_at_once_and_one_that_comes_is_learnt() {
    let lamp = |at: Vec3| {
        (sphere(Vec3::ZERO, 0.3, 12, 16), EmitterShape::Sphere, 10.0, Affine3A::from_translation(at))
    };
    let rig = Rig::new(vec![lamp(Vec3::new(1.0, 2.0, 0.0)), lamp(Vec3::new(-1.0, 2.0, 0.0))]);
    let params = SlcParams::default();
    let mut cache = rig.settled(20, &params);
    let both = mean(&cache);
    let mut without = rig.pose.clone();
    without.instances[2] = PosedInstance::REMOVED;
    rig.step(&mut cache, &rig.pose, &without, &params);
    assert_near(mean(&cache), 0.5 * both, 0.03);
    for _ in 0..10 {
        rig.step(&mut cache, &without, &without, &params);
    }
    assert_near(mean(&cache), 0.5 * both, 0.01);
    assert!(cache.ids().all(|id| !cache.entry(id).unwrap().may_hold(1)), "no cone remembers it");
    rig.step(&mut cache, &without, &rig.pose, &params);
    for _ in 0..30 {
        rig.step(&mut cache, &rig.pose, &rig.pose, &params);
    }
    assert_near(mean(&cache), both, 0.02);
}

#[test]
fn what_moves_in_front_of_a_light_is_noticed() {
    let lamp = (sphere(Vec3::ZERO, 0.3, 12, 16), EmitterShape::Sphere, 10.0, over(2.0));
    // A black shutter: it emits nothing, so it is no light.
    let rig = Rig::new(vec![lamp, (rectangle(0.5, 0.5), EmitterShape::Triangles, 0.0, over(1.0))]);
    let mut aside = rig.pose.clone();
    aside.instances[2].world_from_mesh = Affine3A::from_translation(Vec3::new(6.0, 1.0, 0.0));
    let params = SlcParams::default();
    let mut cache = rig.cache();
    for _ in 0..40 {
        rig.step(&mut cache, &aside, &aside, &params);
    }
    let open = mean(&cache);
    assert_near(open, 10.0 * PI * 0.09 / 4.0, 0.01);
    let counts = rig.step(&mut cache, &aside, &rig.pose, &params);
    assert!(counts.changed > 150, "{counts:?}");
    for _ in 0..15 {
        rig.step(&mut cache, &rig.pose, &rig.pose, &params);
    }
    assert!(mean(&cache) < 0.12 * open, "{} of {open} after 16 updates", mean(&cache));
    // Aside and far from every line to the light, it changes nothing.
    let mut farther = aside.clone();
    farther.instances[2].world_from_mesh.translation.x += 1.0;
    assert_eq!(rig.step(&mut cache, &aside, &farther, &params).changed, 0);
}

#[test]
fn no_light_breaks_an_entry() {
    let flat = |s: f32| Affine3A::from_translation(Vec3::Y) * Affine3A::from_scale(Vec3::splat(s));
    for radiance in [0.0, 1e-30, 1e30] {
        for scale in [0.0, 1e-20, 1.0, 1e12] {
            let light = |shape| (sphere(Vec3::ZERO, 0.3, 6, 8), shape, radiance, flat(scale));
            let rig = Rig::new(EmitterShape::NAMES.map(|(_, shape)| light(shape)).to_vec());
            let cache = rig.settled(3, &SlcParams::default());
            for id in cache.ids() {
                let entry = cache.entry(id).unwrap();
                assert!(entry.energy().is_finite(), "{radiance} {scale}");
                let cones = entry.cones();
                assert!(cones.iter().all(|c| c.direction().is_normalized() && c.cos_angle().is_finite()));
            }
        }
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let lamp = (sphere(Vec3::ZERO, 0.3, 12, 16), EmitterShape::Sphere, 10.0, over(2.0));
    let rig = Rig::new(vec![lamp, (rectangle(1.0, 0.5), EmitterShape::Rectangle, 3.0, over(4.0))]);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let cache = rig.settled(12, &SlcParams::default());
            cache.ids().map(|id| *cache.entry(id).unwrap()).collect::<Vec<_>>()
        })
    };
    assert_eq!(run(1), run(5));
}

/// A black disc over the floor hides half of an even sky (closed form r²/(r² + h²)); it goes aside, and all is learnt.
#[test]
fn surroundings_are_light_and_what_moves_before_them_is_noticed() {
    let disc = (downward(disc(Vec3::ZERO, 1.0, 64)), EmitterShape::Triangles, 0.0, over(1.0));
    let sky = Environment::new(8, 4, vec![Vec3::splat(3.0); 32], Mat3::IDENTITY).unwrap();
    let rig = Rig { environment: Some(sky), ..Rig::new(vec![disc]) };
    let params = SlcParams::default();
    let mut cache = rig.settled(60, &params);
    assert_near(mean(&cache), 0.5 * 3.0 * PI, 0.02);
    let mut aside = rig.pose.clone();
    aside.instances[1].world_from_mesh.translation.x = 6.0;
    let counts = rig.step(&mut cache, &rig.pose, &aside, &params);
    assert!(counts.changed > 150, "{counts:?}");
    // The worth of eight samples of before, with half the light, is among 255 in the end.
    for _ in 0..220 {
        rig.step(&mut cache, &aside, &aside, &params);
    }
    assert_near(mean(&cache), 3.0 * PI, 0.02);
}

/// The floor turns, stays, is gone and comes back; half of it is looked at, or all, or the same as before.
#[test]
fn places_that_follow_are_those_found_anew() {
    let rig = Rig::new(vec![(sphere(Vec3::ZERO, 0.3, 12, 16), EmitterShape::Sphere, 10.0, over(2.0))]);
    let mut turned = rig.pose.clone();
    turned.instances[0].world_from_mesh = Affine3A::from_rotation_x(0.3);
    let mut gone = rig.pose.clone();
    gone.instances[0] = PosedInstance::REMOVED;
    let (still, half) = (&rig.pose, rig.pixels.len() / 2);
    let frames = [
        (still, half),
        (still, half),
        (still, rig.pixels.len()),
        (still, half),
        (&turned, half),
        (&turned, half),
        (&turned, half),
        (&gone, half),
        (&gone, half),
        (still, half),
        (still, rig.pixels.len()),
    ];
    let mut cache = rig.cache();
    let (mut requests, mut queue) = (Requests::default(), UpdateQueue::default());
    let (mut places, mut before, mut kept) = (EntryPlaces::default(), still, 0);
    for (number, (now, pixels)) in frames.into_iter().enumerate() {
        let views = [View { width: SIDE as usize, pixels: &rig.pixels[..pixels] }];
        let is_same = requests.gather_again(&views, &LookUp { bias: 1.0, blend: false });
        if !(is_same && cache.repeat(&requests, &mut queue)) {
            queue = cache.admit(&requests);
        }
        kept += u32::from(queue.is_repeat());
        let clock = cache.clock();
        places.follow(&cache, &queue, &rig.scene, before, now);
        let anew = EntryPlaces::of(&cache, &queue, &rig.scene, before, now);
        for (index, texel) in queue.texels.iter().enumerate() {
            assert_eq!(places.get(index), anew.get(index), "frame {number}");
            assert_eq!(places.of_entry(texel.id), anew.of_entry(texel.id), "frame {number}");
        }
        let has_moved = before.instances[0].world_from_mesh != now.instances[0].world_from_mesh
            || before.instances[0].is_there() != now.instances[0].is_there();
        assert_eq!(places.moved_at(0) == clock, has_moved, "frame {number}");
        before = now;
    }
    assert_eq!(kept, 7);
}

proptest! {
    /// No shadow is missed: what a line of sight into a light's ball meets, may hide something of it.
    #[test]
    fn what_is_in_the_way_is_told(
        centers in prop::array::uniform6(-4.0f32..4.0),
        at in prop::array::uniform3(-1.0f32..1.0),
        radii in prop::array::uniform2(0.01f32..2.0),
        along in 0.0f32..1.0,
        off in prop::array::uniform3(-1.0f32..1.0),
    ) {
        let [from, light] = [0, 3].map(|i| Vec3::new(centers[i], centers[i + 1], centers[i + 2]));
        let [light_radius, mover_radius] = radii;
        let aim = light + Vec3::from(at).clamp_length_max(1.0) * light_radius;
        // A ball that a place on the line is in.
        let mover = from.lerp(aim, along) + Vec3::from(off).clamp_length_max(1.0) * (0.999 * mover_radius);
        prop_assert!(changes::meets(from, (light, light_radius), (mover, mover_radius)));
    }
}

/// A lamp comes up from behind the horizon of a floor that turns: what was half seen is seen whole, and has twice the fluence.
#[test]
fn light_that_rises_over_a_horizon_is_all_there() {
    let mut rig = Rig::new(vec![(sphere(Vec3::ZERO, 0.5, 16, 24), EmitterShape::Sphere, 10.0, over(2.0))]);
    // The floor stands on its edge, the lamp half behind its plane.
    let edge = Affine3A::from_rotation_x(-std::f32::consts::FRAC_PI_2);
    rig.pose.instances[0].world_from_mesh = edge;
    let params = SlcParams { samples: 8, ..SlcParams::default() };
    let cache = rig.settled(40, &params);
    let mut now = rig.pose.clone();
    now.instances[0].world_from_mesh = Affine3A::from_rotation_x(-0.9);
    // Followed, without a sample.
    let blind = SlcParams { first_samples: 1, first_updates: 1, changed_samples: 0, samples: 0, ..params };
    let mut followed = cache.clone();
    rig.step(&mut followed, &rig.pose, &now, &blind);
    let mut fresh = rig.cache();
    for _ in 0..30 {
        rig.step(&mut fresh, &now, &now, &params);
    }
    let (before, found, exact) = (mean(&cache), mean(&followed), mean(&fresh));
    assert!(before < 0.2 * exact && (found / exact - 1.0).abs() < 0.25, "{before}, {found}, {exact}");
}
