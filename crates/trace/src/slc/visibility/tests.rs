//! Visibility of lights at points against closed forms, and what is traced again.

use std::sync::Arc;

use dapple_scene::glam::Affine3A;
use dapple_scene::{EmitterShape, Material, Mesh, Pose, PosedInstance, Scene};
use dapple_store::points::{PackedNormal, PointSet, morton_code};

use super::*;
use crate::psao::generate::{Anchor, sites_world};
use crate::test_support::{quad, scene as placed, sphere};

/// A floor of 8 m with 20 × 20 points, a shutter (instance 1), and lights over it.
struct Rig {
    scene: Scene,
    pose: Pose,
    layout: Arc<PointLayout>,
    anchors: Vec<Anchor>,
    sites: Vec<Option<Site>>,
}

/// On the floor's first triangle or its second.
fn anchor(place: Vec3) -> Anchor {
    let (across, along) = (place.x / 8.0 + 0.5, 0.5 - place.z / 8.0);
    if across >= along {
        Anchor::new(0, [across - along, along], false)
    } else {
        Anchor::new(1, [across, along - across], false)
    }
}

fn flat(half: f32, height: f32) -> Mesh {
    let at = |x, z| Vec3::new(x, height, z);
    quad(at(-half, half), at(half, half), at(half, -half), at(-half, -half))
}

fn shifted(x: f32, y: f32) -> Affine3A {
    Affine3A::from_translation(Vec3::new(x, y, 0.0))
}

impl Rig {
    fn new(shutter: Affine3A, lights: Vec<(Mesh, EmitterShape, f32, Affine3A)>) -> Rig {
        let (mut meshes, mut maps) =
            (vec![flat(4.0, 0.0), flat(1.0, 0.0)], vec![(0, Affine3A::IDENTITY), (1, shutter)]);
        for (i, (mesh, _, _, world)) in (2u32..).zip(&lights) {
            meshes.push(mesh.clone());
            maps.push((i, *world));
        }
        let (mut scene, pose) = placed(meshes, &maps);
        for (i, (_, shape, radiance, _)) in lights.iter().enumerate() {
            let emissive_factor = Vec3::splat(*radiance);
            scene.materials.push(Material { emissive_factor, double_sided: true, ..Material::default() });
            scene.meshes[i + 2].parts[0].material = i as u32 + 1;
            scene.instances[i + 2].emitter = *shape;
        }
        let mut positions: Vec<[u32; 3]> = (0..400).map(|i| [i % 20 * 8, 0, i / 20 * 8]).collect();
        positions.sort_by_key(|position| morton_code(*position));
        let place = |p: &[u32; 3]| Vec3::new(p[0] as f32, 0.0, p[2] as f32) * 0.05 - Vec3::new(3.8, 0.0, 3.8);
        let anchors: Vec<Anchor> = positions.iter().map(|p| anchor(place(p))).collect();
        let normals = vec![PackedNormal::pack(Vec3::Y); 400];
        let set = PointSet { positions, normals, ..PointSet::default() };
        let layout = Arc::new(PointLayout::new(0.05, 0.4, vec![set]).unwrap());
        let sites = sites_world(&layout, &anchors, &scene, &pose);
        let off = |(site, p): (&Option<Site>, _)| site.as_ref().unwrap().position_world.distance(place(p));
        assert!(sites.iter().zip(&layout.sets()[0].positions).all(|pair| off(pair) < 1e-3));
        Rig { scene, pose, layout, anchors, sites }
    }

    fn trace(&self, pose: &Pose, params: &VisibilityParams) -> (LightVisibility, VisibilityCounts) {
        let (tracer, lights) = (Tracer::new(&self.scene, pose), AreaLights::new(&self.scene, pose));
        trace_visibility(&self.layout, (&self.sites, None), &tracer, &lights, params).unwrap()
    }

    fn tracker(&self, tolerance: f32, visibility: VisibilityParams) -> LightTracker {
        let tracer = Tracer::new(&self.scene, &self.pose);
        let params = TrackerParams { visibility, tolerance };
        let points = (&self.layout, &self.anchors[..]);
        LightTracker::new(&self.scene, &self.pose, &tracer, points, params).unwrap()
    }

    fn step(&self, tracker: &mut LightTracker, now: &Pose) -> VisibilityCounts {
        tracker.step(&self.scene, now, &Tracer::new(&self.scene, now), &self.anchors, None)
    }

    fn moved(&self, instance: usize, world: Affine3A) -> Pose {
        let mut pose = self.pose.clone();
        pose.instances[instance].world_from_mesh = world;
        pose
    }

    /// The value of a light at the point nearest to a place.
    fn at(&self, values: &LightVisibility, light: u32, x: f32, z: f32) -> u8 {
        let distance =
            |site: &Option<Site>| site.as_ref().unwrap().position_world.distance(Vec3::new(x, 0.0, z));
        let nearest = (0..400).min_by(|&a, &b| distance(&self.sites[a]).total_cmp(&distance(&self.sites[b])));
        values.get(nearest.unwrap(), light).unwrap()
    }
}

fn lamp(radius: f32, x: f32, y: f32) -> (Mesh, EmitterShape, f32, Affine3A) {
    (sphere(Vec3::ZERO, radius, 12, 16), EmitterShape::Sphere, 10.0, shifted(x, y))
}

#[test]
fn shadows_are_where_they_must_be() {
    // The shutter, 2 m wide at half the height of a small lamp, shades 4 m about its middle.
    let rig = Rig::new(shifted(0.0, 1.0), vec![lamp(0.1, 0.0, 2.0), lamp(0.2, 9.0, 3.0)]);
    let (values, counts) = rig.trace(&rig.pose, &VisibilityParams::default());
    assert_eq!(counts.traced, 800);
    for (x, expected) in [(0.0, 0), (1.8, 0), (2.2, OPEN), (3.8, OPEN), (-1.8, 0), (-2.6, OPEN)] {
        assert_eq!(rig.at(&values, 0, x, 0.2), expected, "at {x}");
    }
    // From afar: rays towards (9, 3) meet the shutter's height at (9 + 2 x) / 3, so x = −6 … −3 is shaded.
    assert_eq!((rig.at(&values, 1, -3.8, 0.2), rig.at(&values, 1, -2.2, 0.2)), (0, OPEN));
    // First rays that agree spare the others nearly everywhere.
    assert!(counts.rays < 6 * counts.traced, "{counts:?}");
    let all = VisibilityParams { first: 16, ..VisibilityParams::default() };
    assert_eq!(rig.trace(&rig.pose, &all).1.rays, 16 * 800);
}

#[test]
fn half_of_a_light_is_half_of_the_steps() {
    // Above the shutter's edge a rectangle: a point under the edge sees one half of it, up to its place beside the edge.
    let panel = (flat(1.0, 0.0), EmitterShape::Rectangle, 5.0, shifted(0.0, 2.0));
    let rig = Rig::new(shifted(-1.0, 1.0), vec![panel]);
    let params = VisibilityParams { rays: 256, first: 256, seed: 3 };
    let (values, _) = rig.trace(&rig.pose, &params);
    // Points are at 0.2 and −0.2: edges of shadow on the panel at x = ∓0.2, whose part is about 0.6 and 0.4.
    for (x, expected) in [(0.2, 18.6), (-0.2, 12.4)] {
        let found = f32::from(rig.at(&values, 0, x, 0.2));
        assert!((found - expected).abs() <= 1.6, "{found} at {x}, about {expected}");
    }
    let coarse = rig.trace(&rig.pose, &VisibilityParams::default()).0;
    let off = |i: usize| f32::from(coarse.values()[i].abs_diff(values.values()[i])) / 31.0;
    let rms = ((0..400).map(|i| off(i) * off(i)).sum::<f32>() / 400.0).sqrt();
    assert!(rms < 0.09, "16 rays are {rms} from 256");
}

#[test]
fn an_update_finds_what_all_rays_find() {
    let rig =
        Rig::new(shifted(-3.0, 1.0), vec![lamp(0.2, 0.0, 2.5), lamp(0.1, 2.0, 1.5), lamp(0.3, 30.0, 5.0)]);
    let params = VisibilityParams::default();
    let mut tracker = rig.tracker(0.1, params);
    let (values, counts) = rig.trace(&rig.pose, &params);
    assert_eq!((tracker.values(), tracker.first_counts()), (&values, counts));
    let (mut least, mut most) = (u64::MAX, 0);
    for step in 1..=12 {
        let mut now = rig.moved(1, shifted(-3.0 + 0.4 * step as f32, 1.0));
        if step > 6 {
            now.instances[2].world_from_mesh = shifted(0.0, 2.5 - 0.1 * (step - 6) as f32);
        }
        if step == 10 {
            now.instances[3] = PosedInstance::REMOVED;
        }
        let before = tracker.values().clone();
        let counts = rig.step(&mut tracker, &now);
        let whole = rig.trace(&now, &params).0;
        let there: Vec<u32> = if step == 10 { vec![0, 2] } else { vec![0, 1, 2] };
        for light in there {
            assert_eq!(tracker.values().of_light(light), whole.of_light(light), "step {step}, light {light}");
        }
        let differ = before.values().iter().zip(tracker.values().values()).filter(|(a, b)| a != b).count();
        assert_eq!((counts.changed, tracker.due()), (differ as u64, 0));
        (least, most) = (least.min(counts.traced), most.max(counts.traced));
    }
    assert!(least < 600 && most < 1200, "{least} to {most} of 1200 pairs were looked at");
}

#[test]
fn what_nothing_happens_to_takes_no_rays_and_a_lamp_in_the_open_sends_nothing() {
    let rig = Rig::new(shifted(0.0, -1.0), vec![lamp(0.2, -1.0, 2.0), lamp(0.1, 1.5, 2.0)]);
    let mut tracker = rig.tracker(0.1, VisibilityParams::default());
    assert_eq!(rig.step(&mut tracker, &rig.pose), VisibilityCounts::default());
    // One lamp moves, and the other is nowhere behind it.
    let counts = rig.step(&mut tracker, &rig.moved(2, shifted(-0.7, 2.0)));
    assert!(counts.traced >= 400 && counts.changed == 0, "{counts:?}");
}

#[test]
fn tolerances_follow_what_is_seen_of_an_error() {
    let rig = Rig::new(shifted(0.0, 1.0), vec![lamp(0.1, 0.0, 2.0), lamp(0.1, 3.0, 0.5)]);
    let lights = AreaLights::new(&rig.scene, &rig.pose);
    // Every value differs from its opposite.
    let at = |tracker: &LightTracker| {
        let opposite = tracker.values().values().iter().map(|value| OPEN - value).collect();
        let held = LightVisibility::new(&rig.layout, 2, opposite).unwrap();
        tracker.tolerances(&held, &rig.scene, &rig.pose)
    };
    let tracker = rig.tracker(0.1, VisibilityParams::default());
    let (values, found) = (tracker.values(), at(&tracker));
    assert_eq!(tracker.tolerances(values, &rig.scene, &rig.pose), []);
    assert!(found.iter().map(|pair| pair.0).eq(0..800));
    let bright = |point: usize| {
        let site = rig.sites[point].as_ref().unwrap();
        let most = |light| lights.arriving(light, site.position_world, site.normal_world);
        let has: f32 = (0..2).map(|l| most(l) * values.fraction(point, l as u32).unwrap()).sum();
        (has, [most(0), most(1)])
    };
    let brightest = (0..400).map(|point| bright(point).0).fold(0.0, f32::max);
    assert!(tracker.black > 0.0 && tracker.black <= 0.02 * brightest);
    for &(index, tolerance) in &found {
        let (has, most) = bright(index as usize % 400);
        let (most, may) = (most[index as usize / 400], 0.1 * (has + tracker.black));
        let off = most * (f32::from(tolerance) + 1.0) / 31.0;
        assert!(tolerance == 255 || off > may * 0.999, "one step more would be seen");
        assert!(tolerance == 255 || f32::from(tolerance) / 31.0 * most <= may * 1.001);
    }
    let none = at(&rig.tracker(0.0, VisibilityParams::default()));
    assert!(none.iter().all(|(_, t)| *t == 0));
    assert!(at(&rig.tracker(1e30, VisibilityParams::default())).iter().all(|(_, t)| *t == 255));
}

#[test]
fn no_light_and_no_number_breaks_it() {
    for radiance in [0.0, 1e-30, 1e30] {
        for scale in [0.0, 1e-20, 1.0, 1e12] {
            let world = Affine3A::from_translation(Vec3::Y) * Affine3A::from_scale(Vec3::splat(scale));
            let light = |shape| (sphere(Vec3::ZERO, 0.3, 6, 8), shape, radiance, world);
            let rig =
                Rig::new(shifted(0.0, 0.5), EmitterShape::NAMES.map(|(_, shape)| light(shape)).to_vec());
            let params = VisibilityParams { rays: u32::MAX, first: 0, seed: 1 };
            let mut tracker = rig.tracker(f32::NAN, params);
            rig.step(&mut tracker, &rig.moved(2, shifted(0.1, f32::MAX)));
            let held = LightVisibility::open(&rig.layout, tracker.values().lights()).unwrap();
            tracker.tolerances(&held, &rig.scene, &rig.pose);
        }
    }
    let mut rig = Rig::new(shifted(0.0, 0.5), vec![lamp(0.1, 0.0, 2.0)]);
    rig.sites[3] = None;
    rig.sites[4].as_mut().unwrap().normal_world = Vec3::splat(f32::NAN);
    let (_, counts) = rig.trace(&rig.pose, &VisibilityParams { rays: 0, ..VisibilityParams::default() });
    assert_eq!((counts.traced, counts.rays), (398, 398));
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let rig = Rig::new(shifted(0.0, 1.0), vec![lamp(0.3, 0.0, 2.0), lamp(0.2, 9.0, 3.0)]);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| rig.trace(&rig.pose, &VisibilityParams::default()))
    };
    assert_eq!(run(1), run(5));
}

#[test]
fn what_is_half_seen_leans_to_the_side_that_is_seen() {
    // As above: under the shutter's edge along z a point sees the half of the panel that is on its own side.
    let panel = (flat(1.0, 0.0), EmitterShape::Rectangle, 5.0, shifted(0.0, 2.0));
    let mut rig = Rig::new(shifted(-1.0, 1.0), vec![panel]);
    let params = VisibilityParams { rays: 256, first: 256, seed: 3 };
    assert!(!rig.tracker(0.1, params).values().has_leans(), "nothing is glossy");
    rig.scene.materials[0].roughness_factor = 0.2;
    let mut tracker = rig.tracker(0.1, params);
    let tracked = tracker.values();
    assert_eq!(tracked.values(), rig.trace(&rig.pose, &params).0.values());
    let mut half = 0;
    for (index, value) in tracked.values().iter().enumerate() {
        let (Lean([across, along]), site) = (tracked.lean(index), rig.sites[index].as_ref().unwrap());
        if site.position_world.length() < 1.0 && (8..24).contains(value) {
            // Towards +x, about 0.4 of the radius where half is seen: 1 to 3 of 4 steps; the edge runs along z.
            assert!(
                (1..=3).contains(&across) && along.abs() <= 1,
                "{across}, {along} at {}",
                site.position_world
            );
            half += 1;
        }
        assert!((*value > 0 && *value < OPEN) || tracked.lean(index) == Lean::NONE);
    }
    assert!(half >= 6, "{half}");
    // A shutter from the other side: as much is seen, and leans the other way.
    rig.step(&mut tracker, &rig.moved(1, shifted(1.0, 1.0)));
    let opposite = |x: f32| {
        let at = (0..400).min_by(|a, b| {
            let off =
                |i: &usize| rig.sites[*i].as_ref().unwrap().position_world.distance(Vec3::new(x, 0.0, 0.2));
            off(a).total_cmp(&off(b))
        });
        tracker.values().lean(at.unwrap())
    };
    assert!(opposite(0.2).0[0] <= -1 && opposite(-0.2).0[0] <= -1);
}
