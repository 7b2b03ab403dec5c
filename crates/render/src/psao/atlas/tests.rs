//! Exactness and truth of the atlas.

mod bent;
mod lights;
mod sets;

use dapple_scene::{AlphaMode, Material};
use dapple_store::charts::{Candidate, ChartParams, PointNeighbours, SetCuts, SiteCut, fingerprint};
use dapple_store::points::{MAX_COORDINATE, PackedNormal, PointSet, morton_code};
use glam::{Affine3A, Mat3, Vec3};
use proptest::prelude::*;

use super::*;
use crate::testing::{Stage, cube, ground, matte, sphere, turned, with_threads};

/// A number that looks random.
fn noise(a: u32, b: u32) -> u32 {
    let mut h = a.wrapping_mul(0x9e37_79b1) ^ b.wrapping_mul(0x85eb_ca77);
    h = (h ^ h >> 15).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ h >> 12).wrapping_mul(0x297a_2d39);
    h ^ h >> 15
}

fn rest_positions(scene: &Scene, instance: usize) -> Vec<Vec3> {
    let placed = &scene.instances[instance];
    scene.meshes[placed.mesh as usize].positions.iter().map(|&p| placed.rest_from_mesh * p).collect()
}

/// Points on all surfaces, about one for each square of `spacing` / 1.1.
pub(crate) fn lay(scene: &Scene, spacing: f32) -> Arc<PointLayout> {
    let quantum = spacing / 32.0;
    let mut sets = Vec::new();
    for (index, instance) in scene.instances.iter().enumerate() {
        let positions = rest_positions(scene, index);
        let mut points = Vec::new();
        for (t, triangle) in scene.meshes[instance.mesh as usize].triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|v| positions[v as usize]);
            let area = (b - a).cross(c - a);
            let count = (0.5 * area.length() * 1.2 / (spacing * spacing)).ceil() as u32;
            for i in 0..count {
                // A regular sequence fills a triangle evenly.
                let unit = |k: f64, d: u32| {
                    let start = f64::from(noise(t as u32, d)) / 4e9;
                    (start + k * f64::from(i)).fract() as f32
                };
                let (mut u, mut v) = (unit(0.754_877_666, 1), unit(0.569_840_296, 2));
                if u + v > 1.0 {
                    (u, v) = (1.0 - u, 1.0 - v);
                }
                points.push((a + (b - a) * u + (c - a) * v, area.normalize()));
            }
        }
        let lowest = points.iter().map(|p| p.0).reduce(Vec3::min);
        let origin_rest = lowest.unwrap_or_default();
        let mut keyed: Vec<(u64, PackedNormal, [u32; 3])> = points
            .iter()
            .map(|&(p, n)| {
                let steps = ((p - origin_rest) / quantum).to_array();
                let position = steps.map(|s| (s.round() as u32).min(MAX_COORDINATE));
                (morton_code(position), PackedNormal::pack(n), position)
            })
            .collect();
        keyed.sort_unstable();
        sets.push(PointSet {
            instance: index as u32,
            first: 0,
            origin_rest,
            positions: keyed.iter().map(|k| k.2).collect(),
            normals: keyed.iter().map(|k| k.1).collect(),
        });
    }
    Arc::new(PointLayout::new(quantum, spacing, sets).unwrap())
}

/// A ground, a turned box, and two spheres that share a mesh's charts.
fn stage() -> Scene {
    let mut stage = Stage::new();
    stage.add(ground(1.0), 0, Affine3A::IDENTITY);
    stage.add(cube(), 0, turned(0.7, Vec3::new(0.3, 0.4, 0.1)) * Affine3A::from_scale(Vec3::splat(0.3)));
    let ball = stage.add(sphere(8, 12), 0, Affine3A::from_scale(Vec3::splat(0.4)));
    let mesh = stage.scene.instances[ball as usize].mesh;
    let twin = stage.add(sphere(3, 3), 0, Affine3A::from_scale(Vec3::splat(0.4)));
    stage.scene.instances[twin as usize].mesh = mesh;
    stage.scene
}

fn complete(scene: &Scene, layout: &Arc<PointLayout>, values: &[u8]) -> VisibilityAtlas {
    let mut atlas = VisibilityAtlas::new(layout.clone(), scene, None, AtlasParams::default());
    while !atlas.work(scene, values, usize::MAX).is_complete() {}
    assert!(atlas.failed().is_empty());
    atlas.take_ready();
    atlas
}

/// The new values of all texels.
fn news(atlas: &VisibilityAtlas) -> Vec<u8> {
    (0..atlas.layers()).flat_map(|layer| atlas.texels(layer)).map(|texel| texel[1]).collect()
}

/// Every triangle of an instance at its middle.
fn middles(scene: &Scene, atlas: &VisibilityAtlas, instance: u32, fade: f32) -> Vec<f32> {
    let mesh = scene.instances[instance as usize].mesh as usize;
    let triangles = scene.meshes[mesh].triangles.len() as u32;
    (0..triangles).map(|t| atlas.visibility(instance, t, [0.3, 0.3], false, fade)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn changes_lead_to_the_texels_of_a_fresh_atlas(
        seed: u32,
        piece in 1usize..3000,
        rounds in prop::collection::vec((0usize..200, any::<bool>(), 0usize..4, 0f32..1.2), 1..12),
    ) {
        let scene = stage();
        let layout = lay(&scene, 0.1);
        let mut values: Vec<u8> = (0..layout.len() as u32).map(|i| noise(i, seed) as u8).collect();
        let mut atlas = VisibilityAtlas::new(layout.clone(), &scene, None, AtlasParams::default());
        // Changes come while the atlas is being made, and after.
        for (round, (count, begins, pieces, progress)) in rounds.into_iter().enumerate() {
            for _ in 0..pieces {
                atlas.work(&scene, &values, piece);
            }
            let changes: Vec<PointChange> = (0..count)
                .map(|k| {
                    let random = noise(k as u32, seed ^ round as u32);
                    let point = random % layout.len() as u32;
                    let old = std::mem::replace(&mut values[point as usize], (random >> 24) as u8);
                    PointChange { point, old, new: values[point as usize] }
                })
                .collect();
            if begins {
                atlas.begin_update(progress);
            }
            atlas.apply(changes);
        }
        while !atlas.work(&scene, &values, piece).is_complete() {}
        let fresh = complete(&scene, &layout, &values);
        prop_assert_eq!(news(&atlas), news(&fresh));
        for instance in 0..4 {
            prop_assert_eq!(atlas.placements(instance), fresh.placements(instance));
        }
    }
}

#[test]
fn neither_threads_nor_pieces_change_a_texel() {
    let scene = stage();
    let layout = lay(&scene, 0.05);
    let values: Vec<u8> = (0..layout.len() as u32).map(|i| noise(i, 3) as u8).collect();
    let make = |threads, piece| {
        with_threads(threads, || {
            let mut atlas = VisibilityAtlas::new(layout.clone(), &scene, None, AtlasParams::default());
            let mut progress = atlas.progress();
            assert!(!progress.is_complete());
            while !progress.is_complete() {
                let now = atlas.work(&scene, &values, piece);
                assert!(now.done > progress.done && now.done <= now.total);
                progress = now;
            }
            (0..atlas.layers()).flat_map(|layer| atlas.texels(layer).to_vec()).collect::<Vec<_>>()
        })
    };
    let one = make(1, usize::MAX);
    assert!(one == make(2, 1000) && one == make(3, 77));
}

#[test]
fn a_constant_is_kept_everywhere() {
    let scene = stage();
    let layout = lay(&scene, 0.1);
    let atlas = complete(&scene, &layout, &vec![77; layout.len()]);
    for instance in 0..4 {
        for value in middles(&scene, &atlas, instance, 1.0) {
            assert_eq!(value, 77.0 / 255.0);
        }
    }
}

#[test]
fn a_gradient_is_kept_on_a_plane() {
    let mut stage = Stage::new();
    stage.add(ground(1.0), 0, Affine3A::IDENTITY);
    let scene = stage.scene;
    let layout = lay(&scene, 0.05);
    let slope = |p: Vec3| 0.5 + 0.2 * p.x - 0.15 * p.z;
    let set = &layout.sets()[0];
    let value = |i: usize| (slope(set.position_rest(i, layout.quantum_m())) * 255.0).round() as u8;
    let atlas = complete(&scene, &layout, &(0..set.len()).map(value).collect::<Vec<_>>());
    let positions = rest_positions(&scene, 0);
    for i in 0..1000u32 {
        let triangle = i % 2;
        let (mut u, mut v) = (noise(i, 5) as f32 / 4.3e9, noise(i, 6) as f32 / 4.3e9);
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let [a, b, c] = scene.meshes[0].triangles[triangle as usize].map(|v| positions[v as usize]);
        let place = a + (b - a) * u + (c - a) * v;
        if place.x.abs().max(place.z.abs()) > 0.85 {
            continue;
        }
        let (found, truth) = (atlas.visibility(0, triangle, [u, v], false, 1.0), slope(place));
        // Points and texels are rounded to 1/255, weights to 1/256.
        assert!((found - truth).abs() < 0.006, "{found} instead of {truth} at {place}");
    }
}

#[test]
fn surfaces_are_open_until_they_are_ready_and_then_fade_in() {
    let scene = stage();
    let layout = lay(&scene, 0.1);
    let values = vec![0; layout.len()];
    let mut atlas = VisibilityAtlas::new(layout.clone(), &scene, None, AtlasParams::default());
    assert_eq!(atlas.visibility(0, 0, [0.3, 0.3], false, 1.0), 1.0);
    assert!(atlas.charts(0).is_none() && atlas.placements(0).is_empty());
    // The ground has the most points.
    while atlas.take_ready().is_empty() {
        assert_eq!(atlas.visibility(0, 0, [0.3, 0.3], false, 1.0), 1.0);
        atlas.work(&scene, &values, 10);
    }
    assert!(atlas.charts(0).is_some());
    assert_eq!([0.0, 0.5, 1.0].map(|fade| atlas.visibility(0, 0, [0.3, 0.3], false, fade)), [1.0, 0.5, 0.0]);
    assert!(!atlas.take_dirty().is_empty());
    // Halfway, then at the end.
    atlas.begin_update(0.5);
    assert_eq!([0.0, 1.0].map(|fade| atlas.visibility(0, 0, [0.3, 0.3], false, fade)), [128.0 / 255.0, 0.0]);
    atlas.begin_update(1.0);
    assert_eq!(atlas.visibility(0, 0, [0.3, 0.3], false, 0.0), 0.0);
    assert!(!atlas.take_dirty().is_empty());
    while !atlas.work(&scene, &values, 10).is_complete() {}
    // Nobody has seen the others yet.
    atlas.begin_update(0.9);
    assert_eq!([0.0, 1.0].map(|fade| atlas.visibility(1, 0, [0.3, 0.3], false, fade)), [1.0, 0.0]);
    assert_eq!(atlas.take_ready().len(), 3);
    assert!(Arc::ptr_eq(atlas.charts(2).unwrap(), atlas.charts(3).unwrap()), "one mesh, one size");
    // What is not in the scene or has no points is open.
    assert_eq!(
        [atlas.visibility(9, 0, [0.3, 0.3], false, 1.0), atlas.visibility(0, 99, [0.3, 0.3], false, 1.0)],
        [1.0; 2]
    );
}

#[test]
fn an_update_fades_from_the_one_before() {
    let scene = stage();
    let layout = lay(&scene, 0.1);
    let mut atlas = complete(&scene, &layout, &vec![200; layout.len()]);
    let all = |old, new| (0..layout.len() as u32).map(move |point| PointChange { point, old, new });
    let shown =
        |atlas: &VisibilityAtlas, fade| (atlas.visibility(1, 3, [0.3, 0.3], false, fade) * 255.0).round();
    for (old, new) in [(200, 100), (100, 40)] {
        atlas.begin_update(1.0);
        atlas.take_dirty();
        atlas.apply(all(old, new));
        let ends = [0.0, 1.0].map(|fade| shown(&atlas, fade));
        assert_eq!(ends, [f32::from(old), f32::from(new)]);
        let dirty: u32 = atlas.take_dirty().iter().map(|band| band.y.end - band.y.start).sum();
        assert!(dirty > 0 && dirty < atlas.side() * atlas.layers(), "only what changed");
    }
    // Without a beginning the fade goes on from where it began.
    atlas.apply(all(40, 10));
    assert_eq!([0.0, 1.0].map(|fade| shown(&atlas, fade)), [100.0, 10.0]);
    atlas.begin_update(1.0);
    assert_eq!(shown(&atlas, 0.0), 10.0);
    // Points that do not exist are left out.
    atlas.apply([PointChange { point: u32::MAX, old: 0, new: 255 }]);
}

#[test]
fn updates_that_come_before_a_fade_ends_do_not_jump() {
    let scene = stage();
    let layout = lay(&scene, 0.1);
    let mut values = vec![255; layout.len()];
    let mut atlas = VisibilityAtlas::new(layout.clone(), &scene, None, AtlasParams::default());
    while !atlas.work(&scene, &values, usize::MAX).is_complete() {}
    atlas.take_ready();
    let shown = |atlas: &VisibilityAtlas, fade: f32| -> Vec<f32> {
        (0..4).flat_map(|instance| middles(&scene, atlas, instance, fade)).collect()
    };
    let mut fade = 1.0;
    for (round, until) in (0u32..).zip([0.1, 0.5, 0.0, 0.95, 0.3, 1.0, 0.02, 0.7]) {
        let before = shown(&atlas, fade);
        atlas.begin_update(fade);
        // Some points change, among them such that still fade, and some go back to where they were.
        let changes: Vec<PointChange> = (0..layout.len() as u32)
            .filter(|&point| noise(point, round).is_multiple_of(3))
            .map(|point| {
                let random = noise(point, round ^ 77);
                let to = if random.is_multiple_of(2) { 255 } else { (random >> 24) as u8 };
                let old = std::mem::replace(&mut values[point as usize], to);
                PointChange { point, old, new: to }
            })
            .collect();
        atlas.apply(changes);
        for (at, (a, b)) in before.iter().zip(shown(&atlas, 0.0)).enumerate() {
            assert!((a - b).abs() <= 0.502 / 255.0, "round {round}, place {at}: {a} became {b}");
        }
        fade = until;
    }
    assert_eq!(news(&atlas), news(&complete(&scene, &layout, &values)));
}

#[test]
fn instances_beyond_the_bound_of_texels_stay_open() {
    let scene = stage();
    let layout = lay(&scene, 0.1);
    let make = |layout: &Arc<PointLayout>, max_texels| {
        let params = AtlasParams { max_texels, ..AtlasParams::default() };
        let mut atlas = VisibilityAtlas::new(layout.clone(), &scene, None, params);
        while !atlas.work(&scene, &vec![0; layout.len()], usize::MAX).is_complete() {}
        atlas
    };
    let is_refused = |(_, error): &(u32, BuildError)| matches!(error, BuildError::TooManyTexels { .. });
    let none = make(&layout, Some(0));
    assert!(none.failed().len() == 4 && none.failed().iter().all(is_refused), "{:?}", none.failed());
    assert_eq!((none.ready_count(), none.texel_count()), (0, 0));
    assert_eq!(none.visibility(0, 0, [0.3, 0.3], false, 1.0), 1.0);
    // Exactly as many as there are suffice, and one less does not for the last.
    let all: u64 = (0..4).map(|i| u64::from(make(&layout, None).charts(i).unwrap().texel_count())).sum();
    assert!(make(&layout, Some(all)).failed().is_empty());
    assert_eq!(make(&layout, Some(all - 1)).failed().len(), 1);
    // What a layout says of its spacing asks for no more than its points are worth.
    let sets = layout.sets().to_vec();
    let fine = Arc::new(PointLayout::new(layout.quantum_m(), 1e-5, sets).unwrap());
    let atlas = make(&fine, None);
    assert!(!atlas.failed().is_empty() && atlas.failed().iter().all(is_refused), "{:?}", atlas.failed());
    assert!(atlas.memory_bytes() < 100 << 20, "{} bytes", atlas.memory_bytes());
}

#[test]
fn mirrored_and_flat_instances_do_no_harm() {
    let mut stage = Stage::new();
    stage.add(cube(), 0, Affine3A::from_scale(Vec3::new(-0.5, 0.5, 0.5)));
    let flat = stage.add(cube(), 0, Affine3A::IDENTITY);
    stage.scene.instances[flat as usize].rest_from_mesh = Mat3::ZERO;
    stage.add_material(Material { alpha_mode: AlphaMode::Opaque, ..matte(Vec3::ONE) });
    let mut layout = lay(&stage.scene, 0.1);
    // The front of a mirrored instance is the mirror image of the mesh's.
    let mut sets = layout.sets().to_vec();
    for normal in &mut sets[0].normals {
        *normal = PackedNormal::pack(-normal.unpack());
    }
    let mut order: Vec<usize> = (0..sets[0].len()).collect();
    order.sort_by_key(|&i| (morton_code(sets[0].positions[i]), sets[0].normals[i]));
    sets[0].normals = order.iter().map(|&i| sets[0].normals[i]).collect();
    sets[0].positions = order.iter().map(|&i| sets[0].positions[i]).collect();
    layout = Arc::new(PointLayout::new(layout.quantum_m(), layout.spacing_m(), sets).unwrap());
    let dark_x = |i: usize| {
        let set = &layout.sets()[0];
        if i < set.len() && set.normal_rest(i).x < -0.5 { 0 } else { 255 }
    };
    let values: Vec<u8> = (0..layout.len()).map(dark_x).collect();
    let atlas = complete(&stage.scene, &layout, &values);
    let dark: Vec<bool> = middles(&stage.scene, &atlas, 0, 1.0).iter().map(|v| *v < 0.5).collect();
    // The cube's faces are -x, +x, …: mirrored, the mesh's +x faces -x at rest.
    assert_eq!(dark[..6], [false, false, true, true, false, false]);
}

/// Bounded pieces: the same law for a thousand pieces as for one. `cargo test -- --ignored` takes 3 million points.
fn build_in_pieces(spacing: f32) -> (usize, u64) {
    let mut stage = Stage::new();
    for i in 0..4 {
        stage.add(ground(20.0), 0, Affine3A::from_translation(Vec3::Y * i as f32));
    }
    let scene = stage.scene;
    let layout = lay(&scene, spacing);
    let values = vec![128; layout.len()];
    let mut atlas = VisibilityAtlas::new(layout.clone(), &scene, None, AtlasParams::default());
    let (mut longest, mut pieces) = (std::time::Duration::ZERO, 0);
    loop {
        let start = std::time::Instant::now();
        let progress = atlas.work(&scene, &values, 5000);
        longest = longest.max(start.elapsed());
        pieces += 1;
        if progress.is_complete() {
            break;
        }
    }
    let bytes = atlas.memory_bytes();
    eprintln!(
        "{} points, {} texels: {pieces} pieces, longest {longest:?}, {:.1} bytes a point",
        layout.len(),
        atlas.texel_count(),
        bytes as f64 / layout.len() as f64
    );
    assert_eq!(atlas.visibility(2, 1, [0.2, 0.5], false, 1.0), 128.0 / 255.0);
    assert_eq!(atlas.take_ready().len(), 4);
    (pieces, bytes / layout.len() as u64)
}

#[test]
fn many_points_are_taken_in_pieces() {
    let (pieces, bytes) = build_in_pieces(0.3);
    assert!(pieces > 30 && bytes < 70, "{pieces} pieces, {bytes} bytes a point");
}

#[test]
fn no_piece_is_much_longer_than_asked_for() {
    // A ball of 120,000 triangles: its charts and sites alone are worth hundreds of pieces.
    let mut stage = Stage::new();
    stage.add(sphere(200, 300), 0, Affine3A::from_scale(Vec3::splat(2.0)));
    let scene = stage.scene;
    let layout = lay(&scene, 0.02);
    let values = vec![128; layout.len()];
    let mut atlas = VisibilityAtlas::new(layout, &scene, None, AtlasParams::default());
    const PIECE: u64 = 500;
    // A chart is grown in one piece, and the largest of the ball's are worth this.
    const CHART: u64 = 7500;
    let (mut pieces, mut long, mut done) = (0, 0, 0);
    while !atlas.progress().is_complete() {
        let progress = atlas.work(&scene, &values, PIECE as usize);
        long += u32::from(progress.done - done > PIECE + CHART);
        (pieces, done) = (pieces + 1, progress.done);
    }
    // The mesh is taken in as a whole.
    assert!(pieces > 500 && long <= 1, "{pieces} pieces, {long} of them too long");
}

#[test]
#[ignore = "takes a minute"]
fn three_million_points_are_taken_in_pieces() {
    let (_, bytes) = build_in_pieces(0.0505);
    assert!(bytes < 55, "{bytes} bytes a point");
}

/// A ground with points, dark on one side of a wall as thin as a plane at x = 0.013 and open on the other; with cuts or without.
/// Gives the mean error on the dark side near the wall.
fn leak(cut: bool) -> f32 {
    let mut stage = Stage::new();
    stage.add(ground(1.0), 0, Affine3A::IDENTITY);
    let scene = stage.scene;
    let layout = lay(&scene, 0.1);
    let set = &layout.sets()[0];
    let dark = |p: Vec3| p.x > 0.013;
    let value = |i: usize| if dark(set.position_rest(i, layout.quantum_m())) { 51 } else { 255 };
    let values: Vec<u8> = (0..set.len()).map(value).collect();

    let params = ChartParams::for_spacing(layout.spacing_m(), false);
    let triangles = &scene.meshes[0].triangles;
    let charts = ChartSet::new(&rest_positions(&scene, 0), triangles, &params).unwrap();
    let sites = charts.sites(&rest_positions(&scene, 0), triangles);
    let neighbours = PointNeighbours::new(&layout, set, &WeightParams::default());
    let mut weigher = neighbours.weigher(set);
    let mut cuts = Vec::new();
    for (i, site) in (0u32..).zip(&sites) {
        let beyond = |c: &Candidate| dark(c.position_rest) != dark(site.position_rest);
        let candidates = weigher.candidates(site).iter().enumerate();
        let mask = candidates.fold(0, |mask, (bit, c)| mask | u16::from(beyond(c)) << bit);
        if mask != 0 {
            cuts.push(SiteCut { site: i, mask });
        }
    }
    let fingerprint = fingerprint(&sites, &WeightParams::default().kernel);
    let made = SetCuts { instance: 0, sites: sites.len() as u32, fingerprint, cuts };
    let cuts = Cuts::new(vec![made]).unwrap();
    let mut atlas =
        VisibilityAtlas::new(layout.clone(), &scene, cut.then_some(&cuts), AtlasParams::default());
    while !atlas.work(&scene, &values, usize::MAX).is_complete() {}

    let positions = rest_positions(&scene, 0);
    let (mut error, mut count) = (0.0, 0);
    for i in 0..40_000u32 {
        let triangle = (i % 2) as usize;
        let (mut u, mut v) = (noise(i, 5) as f32 / 4.3e9, noise(i, 6) as f32 / 4.3e9);
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let [a, b, c] = triangles[triangle].map(|v| positions[v as usize]);
        let place = a + (b - a) * u + (c - a) * v;
        if dark(place) && place.x < 0.2 {
            error += atlas.visibility(0, triangle as u32, [u, v], false, 1.0) - 0.2;
            count += 1;
        }
    }
    error / count as f32
}

#[test]
fn cuts_halve_what_leaks_under_a_thin_wall() {
    let (without, with) = (leak(false), leak(true));
    assert!(without > 0.05 && with.abs() < 0.5 * without, "{without} without cuts, {with} with");
}

#[test]
#[ignore = "measures time"]
fn a_frames_changes_are_applied_within_a_millisecond() {
    let mut stage = Stage::new();
    stage.add(ground(10.0), 0, Affine3A::IDENTITY);
    let scene = stage.scene;
    let layout = lay(&scene, 0.049);
    let values = vec![100; layout.len()];
    let mut atlas = complete(&scene, &layout, &values);
    let count = layout.len() * 34 / 1000;
    for scattered in [true, false] {
        let mut points: Vec<u32> = (0..count as u32)
            .map(|k| if scattered { noise(k, 1) % layout.len() as u32 } else { k + layout.len() as u32 / 2 })
            .collect();
        points.sort_unstable();
        points.dedup();
        let mut best = std::time::Duration::MAX;
        for round in 0..20u8 {
            let (old, new) = if round % 2 == 0 { (100, 180) } else { (180, 100) };
            let start = std::time::Instant::now();
            atlas.begin_update(1.0);
            atlas.apply(points.iter().map(|&point| PointChange { point, old, new }));
            best = best.min(start.elapsed());
        }
        eprintln!("{} of {} points, scattered: {scattered}: {best:?}", points.len(), layout.len());
        assert!(best.as_secs_f64() < 2e-3);
    }
}
