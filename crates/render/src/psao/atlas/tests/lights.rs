//! Visibility of lights in the atlas: as exact as that of points, by the same weights, through sets that come and go.

use dapple_scene::PosedCamera;
use dapple_store::light_visibility::{LEAN_STEPS, Lean, LightChange, LightVisibility, OPEN, SeenLight};

use super::*;
use crate::gbuffer::rasterize;

const LIGHTS: u32 = 3;

fn values(layout: &PointLayout, seed: u32, has_leans: bool) -> LightVisibility {
    let count = layout.len() as u32 * LIGHTS;
    let values: Vec<u8> = (0..count).map(|i| (noise(i, seed) % (u32::from(OPEN) + 1)) as u8).collect();
    let leans = (0..count).zip(&values).map(|(i, value)| lean(noise(i, !seed)).of_value(*value)).collect();
    let values = LightVisibility::new(layout, LIGHTS, values).unwrap();
    if has_leans { values.with_leans(leans).unwrap() } else { values }
}

fn lean(random: u32) -> Lean {
    Lean([random % 9, random / 9 % 9].map(|step| step as i8 - LEAN_STEPS))
}

/// Changes some values here and in the atlas.
fn change(atlas: &mut VisibilityAtlas, held: &mut LightVisibility, count: usize, seed: u32) {
    let all = held.values().len() as u32;
    if all == 0 {
        return;
    }
    for k in 0..count {
        let random = noise(k as u32, seed);
        let index = random % all;
        let (old, old_lean) = (held.values()[index as usize], held.lean(index as usize));
        let new = (random >> 27) as u8;
        let new_lean = if held.has_leans() { lean(random >> 9).of_value(new) } else { Lean::NONE };
        let change = LightChange { index, old, new, old_lean, new_lean };
        held.apply(&[change]).unwrap();
        atlas.apply_lights(&[change]);
    }
}

/// The texels of shown lights of an instance, page by page.
fn texels_of(atlas: &VisibilityAtlas, instance: u32) -> Vec<[u8; LIGHTS_A_TEXEL]> {
    let Some(charts) = atlas.charts(instance) else { return Vec::new() };
    let mut texels = Vec::new();
    for group in atlas.light_texels() {
        for (place, size) in atlas.placements(instance).iter().zip(charts.pages().iter().cycle()) {
            for y in u32::from(place.y)..u32::from(place.y + size.height) {
                let start = ((u32::from(place.layer) * atlas.side() + y) * atlas.side() + u32::from(place.x))
                    as usize;
                texels.extend(&group[start..start + usize::from(size.width)]);
            }
        }
    }
    texels
}

/// How many texels show something, in all groups.
fn written(atlas: &VisibilityAtlas) -> usize {
    atlas.light_texels().iter().flatten().filter(|texel| is_written(texel)).count()
}

/// Neither all of four lights nor the middle of two.
fn is_written(texel: &[u8; LIGHTS_A_TEXEL]) -> bool {
    *texel != [255; LIGHTS_A_TEXEL] && *texel != [128; LIGHTS_A_TEXEL]
}

/// What every triangle of an instance reads of every light.
fn fractions(scene: &Scene, atlas: &VisibilityAtlas, instance: u32) -> Vec<Option<f32>> {
    let mesh = &scene.meshes[scene.instances[instance as usize].mesh as usize];
    let triangles = 0..mesh.triangles.len() as u32;
    let of = |triangle| {
        (0..LIGHTS).map(move |light| atlas.light_fraction(instance, triangle, [0.3, 0.2], false, light))
    };
    triangles.flat_map(of).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn changes_lead_to_what_a_fresh_atlas_has(
        seed: u32,
        has_leans: bool,
        shown in Just(vec![1u32, 0, 8, 7, 2]).prop_shuffle(),
        rounds in prop::collection::vec((0usize..200, prop::collection::btree_set(0u32..4, 0..3), 1usize..4000), 1..6),
    ) {
        let scene = stage();
        let all = lay(&scene, 0.1);
        let mut layout: Arc<PointLayout> = all.only(&[0, 2]).into();
        let mut held = values(&layout, seed, has_leans);
        let mut atlas = VisibilityAtlas::new(layout.clone(), &scene, None, AtlasParams::default());
        for (round, (count, toggled, texels)) in (1u32..).zip(rounds) {
            // Some instances go, others come; what stays keeps its values.
            let there = |i: &u32| layout.set_of_instance(*i).is_some();
            let gone: Vec<u32> = toggled.iter().copied().filter(there).collect();
            let now: Vec<u32> = (0..4).filter(|i| there(i) != toggled.contains(i)).collect();
            let next: Arc<PointLayout> = all.only(&now).into();
            let mut fresh = values(&next, seed ^ round, has_leans);
            for set in next.sets() {
                let Some(before) = layout.set_of_instance(set.instance).filter(|_| !gone.contains(&set.instance)) else { continue };
                for light in 0..LIGHTS {
                    let to = light as usize * next.len() + set.first as usize;
                    let from = light as usize * layout.len() + before.first as usize;
                    for k in 0..set.len() {
                        fresh.set(to + k, held.values()[from + k], held.lean(from + k));
                    }
                }
            }
            held = fresh;
            if round == 2 {
                atlas.show_lights(&shown);
            }
            atlas.change_sets(&scene, next.clone(), None, &gone);
            layout = next;
            atlas.resolve_lights(&held).unwrap();
            change(&mut atlas, &mut held, count, seed ^ round);
            atlas.work(&scene, &vec![9; layout.len()], texels);
            atlas.resolve_lights(&held).unwrap();
            change(&mut atlas, &mut held, count, !seed ^ round);
        }
        while !atlas.work(&scene, &vec![9; layout.len()], usize::MAX).is_complete() {}
        atlas.resolve_lights(&held).unwrap();
        let mut fresh = complete(&scene, &layout, &vec![9; layout.len()]);
        atlas.show_lights(&shown);
        fresh.show_lights(&shown);
        fresh.resolve_lights(&held).unwrap();
        let count = |atlas: &VisibilityAtlas| {
            let all = (0..4).flat_map(|i| texels_of(atlas, i));
            all.filter(is_written).count()
        };
        prop_assert_eq!(count(&atlas), written(&atlas), "what is nobody's is open");
        prop_assert!(layout.is_empty() || written(&atlas) > 0);
        prop_assert!(atlas.light_texels().iter().all(|group| group.len() == atlas.texel_count()));
        for instance in 0..4 {
            let found = fractions(&scene, &atlas, instance);
            prop_assert!(found.iter().all(Option::is_some) == layout.set_of_instance(instance).is_some());
            prop_assert_eq!(found, fractions(&scene, &fresh, instance), "instance {}", instance);
            prop_assert_eq!(texels_of(&atlas, instance), texels_of(&fresh, instance), "instance {}", instance);
        }
        atlas.forget_lights();
        prop_assert_eq!(written(&atlas), 0);
        prop_assert!((0..4).all(|instance| fractions(&scene, &atlas, instance).iter().all(Option::is_none)));
    }
}

#[test]
fn what_is_open_or_blocked_everywhere_is_so_in_the_picture() {
    let scene = stage();
    let layout = lay(&scene, 0.1);
    let mut atlas = complete(&scene, &layout, &vec![9; layout.len()]);
    let memory = atlas.memory_bytes();
    let points = layout.len();
    let planes = [OPEN, 0, 13].iter().flat_map(|value| vec![*value; points]).collect();
    let lights = LightVisibility::new(&layout, LIGHTS, planes).unwrap();
    let usual = std::mem::replace(&mut atlas.params.max_light_bytes, 1000);
    assert!(matches!(atlas.resolve_lights(&lights), Err(BuildError::TooManyLights { limit: 1000, .. })));
    assert_eq!(atlas.memory_bytes(), memory, "nothing is taken in");
    atlas.params.max_light_bytes = usual;
    atlas.resolve_lights(&lights).unwrap();
    let more = atlas.memory_bytes() - memory;
    assert!(more > 0 && more <= 2 * u64::from(LIGHTS) * atlas.texel_count() as u64, "{more} bytes");
    let pose = scene.pose(0.0);
    let camera = PosedCamera::look_at(Vec3::new(0.9, 1.4, 1.8), Vec3::ZERO, 0.7);
    let gbuffer = rasterize(&scene, &pose, &camera, 48, 48, 1).unwrap();
    let mut seen = 0;
    for sample in gbuffer.samples() {
        let mut row = [SeenLight::of(0.5); 4];
        // A light that nothing is known of is open, as all is for the background.
        atlas.look_up_lights(sample, &[2, 1, 7, 0], &mut row);
        let expected = if sample.is_covered() { [13.0 / 31.0, 0.0, 1.0, 1.0] } else { [1.0; 4] };
        for (found, expected) in row.iter().zip(expected) {
            assert!(
                (found.fraction - expected).abs() <= 0.5 / 255.0 + 1e-6 && found.lean == [0.0; 2],
                "{row:?}"
            );
        }
        seen += u32::from(sample.is_covered());
    }
    assert!(seen > 600, "{seen}");
}
