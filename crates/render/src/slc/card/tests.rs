//! The card's pictures against the twin's, on a made-up cache that has all there can be.

use std::mem::offset_of;

use dapple_gpu::testing::{
    block_on, check_struct, gpu_for_tests, naga::ShaderStage, translate_to_webgl2, validate,
};
use dapple_scene::area_lights::AreaLights;
use dapple_scene::{EmitterShape, Material, Reflectance};
use dapple_store::cones::{
    BACK, CacheParams, ChartPlace, ConeCache, EntryId, EntrySite, LightSet, LookUp, MomentCone, MomentEntry,
    Requests, SLABS, UpdateQueue, View,
};
use glam::{Affine3A, Vec2};

use super::*;
use crate::area_lights::AreaLightTable;
use crate::slc::{ConeLight, shade_cones};
use crate::testing::{Stage, ground, matte, sphere};

const WIDTH: usize = 64;
const HEIGHT: usize = 40;

/// The same numbers 0 … 1 everywhere, by two indices.
fn number(a: usize, b: usize) -> f32 {
    let mut h =
        (a as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (b as u64).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h = (h ^ h >> 31).wrapping_mul(0x94d0_49bb_1331_11eb);
    (h >> 40) as f32 / (1u64 << 24) as f32
}

fn upwards(a: usize, b: usize, lean: f32) -> Vec3 {
    let [x, z] = [number(a, b), number(a, b + 1)].map(|v| (2.0 * v - 1.0) * lean);
    Vec3::new(x, 1.0, z).normalize()
}

/// A sphere, a square and a triangle mesh above the floor.
fn lamps() -> AreaLightTable {
    let mut stage = Stage::new();
    let forms = [
        (sphere(8, 16), EmitterShape::Sphere),
        (ground(0.5), EmitterShape::Rectangle),
        (sphere(2, 4), EmitterShape::Triangles),
    ];
    for (i, (mesh, emitter)) in forms.into_iter().enumerate() {
        let emissive_factor = Vec3::new(3.0, 2.0 + i as f32, 1.0);
        let material =
            stage.add_material(Material { emissive_factor, double_sided: true, ..matte(Vec3::ZERO) });
        let place = Affine3A::from_translation(Vec3::new(i as f32 * 1.5 - 1.0, 2.0, 0.5));
        let light = stage.add(mesh, material, place * Affine3A::from_scale(Vec3::splat(0.3)));
        stage.scene.instances[light as usize].emitter = emitter;
    }
    AreaLightTable::new(&AreaLights::new(&stage.scene, &stage.pose))
}

struct Seen {
    points: Vec<Option<ShadingPoint>>,
    pixels: Vec<Option<PixelPlace>>,
}

/// A floor of charts and slabs, near and far, of all materials, with holes.
fn seen() -> Seen {
    let at = |i: usize| Vec2::new((i % WIDTH) as f32, (i / WIDTH) as f32);
    let point = |i: usize| {
        let p = at(i) * 0.07;
        let smooth = number(i / 7, 3);
        (!i.is_multiple_of(31)).then(|| ShadingPoint {
            instance: 0,
            position_world: Vec3::new(p.x - 2.0, 0.02 * number(i, 1), p.y - 1.0),
            normal_world: upwards(i, 20, 0.05),
            normal_shading_world: upwards(i, 30, 0.4),
            to_viewer_world: upwards(i, 40, 1.5),
            reflectance: Reflectance {
                diffuse: Vec3::new(0.6, 0.4, number(i / 5, 5)),
                f0: Vec3::new(0.04, 0.3, 0.9),
                alpha: (smooth * smooth).max(2e-3),
                specular: !(i / 3).is_multiple_of(4),
            },
            emitted: Vec3::splat(0.1 * number(i, 6)),
        })
    };
    let pixel = |i: usize| {
        let p = at(i);
        let is_slab = p.x > 40.0;
        let place = ChartPlace {
            chart: if is_slab {
                SLABS + 3
            } else {
                (i / (WIDTH * 10)) as u32 | if p.x > 30.0 { BACK } else { 0 }
            },
            uv: [p.x * 0.7 - if is_slab { 50.0 } else { 0.0 } + 0.5, p.y * 0.9 + 0.6],
            depth: if is_slab { -3.0 + p.y * 0.2 } else { 0.0 },
            size: if is_slab { [0; 2] } else { [26, 33] },
            texel_m: 0.1,
        };
        let footprint_m = 0.02 + 0.01 * p.y;
        let instance = (i % WIDTH / 16) as u32;
        (!i.is_multiple_of(23)).then_some(PixelPlace {
            instance,
            triangle: 0,
            barycentrics: [0.25; 2],
            place,
            footprint_m,
            lean: [0.0; 2],
        })
    };
    let count = WIDTH * HEIGHT;
    Seen { points: (0..count).map(point).collect(), pixels: (0..count).map(pixel).collect() }
}

fn entry(i: usize) -> MomentEntry {
    let cone = |k: usize| {
        let at = 10 * k;
        let light = LightSet::one((number(i, at) * 4.0) as u32);
        let other = LightSet::one((number(i, at + 9) * 3.0) as u32);
        let lights = if number(i, at + 1) < 0.2 { light.union(LightSet::one(9)).union(other) } else { light };
        let seen = match number(i, at + 2) {
            v if v < 0.2 => 0.0,
            v if v < 0.6 => 1.0,
            v => v,
        };
        let (cos_angle, cosine) = (1.0 - 0.3 * number(i, at + 3).powi(3), 0.05 + 0.95 * number(i, at + 4));
        let energy = Vec3::new(0.5, 0.3 + number(i, at + 5), 0.4) * number(i, at + 6);
        let cone = MomentCone::from_cap(upwards(i, at + 7, 2.0), cos_angle, energy, cosine, lights);
        MomentCone { seen: if lights.single().is_some() { seen } else { 0.0 }, ..cone }
    };
    let cones: Vec<MomentCone> = (0..(number(i, 50) * 5.0) as usize).map(cone).collect();
    let samples = if number(i, 51) < 0.1 { 0 } else { (number(i, 52) * 150.0) as u16 + 1 };
    MomentEntry::from_parts(&cones, samples, 0)
}

fn site(id: EntryId) -> Option<EntrySite> {
    let i = id.index();
    let position = Vec3::new(number(i, 60), 0.1 * number(i, 61), number(i, 62));
    // Some face elsewhere.
    let normal_world = if number(i, 63) < 0.1 { Vec3::X } else { upwards(i, 64, 0.3) };
    let site =
        EntrySite { position_world: position, normal_world, normal_shading_world: upwards(i, 66, 0.5) };
    (number(i, 68) > 0.05).then_some(site)
}

fn cache_of(seen: &Seen, look_up: &LookUp, cache: &mut ConeCache<MomentEntry>) -> UpdateQueue {
    let views = [View { width: WIDTH, pixels: &seen.pixels }];
    let queue = cache.admit(&Requests::gather(&views, look_up));
    let filled = cache.update(&queue, |_, texel, held| {
        *held = entry(texel.id.index());
        true
    });
    assert!(filled.unwrap() > 500);
    queue
}

/// Part of samples that are further apart than a hundredth, and the mean difference over the mean. Directions of 16 bits a coordinate are off by a good
/// part of the width of mirrors' lobes, which count in the mean alone, and by some hundredths of the cosine of light that grazes an entry.
fn apart(seen: &Seen, found: &[Vec3], exact: &[Vec3]) -> (f32, f32) {
    let mean = exact.iter().map(|v| v.element_sum()).sum::<f32>() / exact.len() as f32;
    let (mut off, mut sum) = (0, 0.0);
    for ((found, exact), point) in found.iter().zip(exact).zip(&seen.points) {
        let difference = (*found - *exact).abs().element_sum();
        let is_mirror = point.is_some_and(|p| p.reflectance.specular && p.reflectance.alpha < 0.05);
        let within = difference <= 1e-2 * (exact.element_sum() + 0.1 * mean);
        off += i32::from(!within && !is_mirror);
        sum += difference;
    }
    (off as f32 / exact.len() as f32, sum / exact.len() as f32 / mean)
}

#[test]
fn the_module_is_valid_within_webgl2_and_laid_out_like_its_mirror() {
    let module = validate(&module()).unwrap();
    translate_to_webgl2(&module, ShaderStage::Vertex, "cone_vertex").unwrap();
    translate_to_webgl2(&module, ShaderStage::Fragment, "cone_fragment").unwrap();
    let members = [
        ("bias", offset_of!(ConeUniform, bias)),
        ("mask", offset_of!(ConeUniform, mask)),
        ("directions", offset_of!(ConeUniform, directions)),
        ("flags", offset_of!(ConeUniform, flags)),
        ("first_row", offset_of!(ConeUniform, first_row)),
        ("lights", offset_of!(ConeUniform, lights)),
        ("pad_b", offset_of!(ConeUniform, pad_b)),
    ];
    check_struct(&module, "ConeParams", size_of::<ConeUniform>(), &members).unwrap();
}

#[test]
fn the_card_shades_as_the_twin_does() {
    let Some(gpu) = gpu_for_tests() else { return };
    let (lamps, seen) = (lamps(), seen());
    assert_eq!(lamps.lights().len(), 3);
    let plain = SlcShading::default();
    let one_texel = LookUp { blend: false, ..LookUp::default() };
    let wide = LookUp { bias: 2.5, ..LookUp::default() };
    for (name, shading, lights) in [
        ("default", plain, Some(&lamps)),
        ("cones alone", plain, None),
        ("cones of each", SlcShading { blending: Blending::Cones, ..plain }, Some(&lamps)),
        ("one texel", SlcShading { look_up: one_texel, ..plain }, Some(&lamps)),
        ("wide texels", SlcShading { look_up: wide, ..plain }, Some(&lamps)),
        ("fluence, 16", SlcShading { form: Form::Fluence, samples: Samples::Fixed(20), ..plain }, None),
        ("64", SlcShading { samples: Samples::Fixed(64), ..plain }, Some(&lamps)),
    ] {
        let mut cache = ConeCache::<MomentEntry>::new(CacheParams::default()).unwrap();
        cache_of(&seen, &shading.look_up, &mut cache);
        let light = ConeLight { cache: &cache, place_of: site, lights };
        let table = CapTable::new(&light);
        let exact = shade_cones(&table, &seen.points, &seen.pixels, &shading);
        let mut pass = ConePass::new(&gpu).unwrap();
        pass.update(&gpu, &table).unwrap();
        let view = CardView { width: WIDTH, points: &seen.points, pixels: &seen.pixels };
        let found = block_on(pass.shade(&gpu, &view, &shading)).unwrap();
        let lit = exact.iter().filter(|v| v.element_sum() > 1e-3).count();
        assert!(lit > exact.len() / 2, "{name}: {lit} lit");
        let (off, mean) = apart(&seen, &found, &exact);
        println!("{name}: {off} off, mean {mean}");
        assert!(off < 1e-3 && mean < 1e-3, "{name}: {off} of samples are off, {mean} in the mean");
    }
}

#[test]
fn only_what_changed_is_sent_and_the_picture_is_that_of_a_new_pass() {
    let Some(gpu) = gpu_for_tests() else { return };
    let (lamps, seen, shading) = (lamps(), seen(), SlcShading::default());
    // Room for few blocks: those of the second picture take the places of the first's.
    let most_bytes = 40 * ConeCache::<MomentEntry>::block_bytes();
    let mut cache =
        ConeCache::<MomentEntry>::new(CacheParams { most_bytes, ..CacheParams::default() }).unwrap();
    let mut pass = ConePass::new(&gpu).unwrap();
    let lights = size_of_val(&lamps.texels()[..]) as u64;
    let shade = |pass: &mut ConePass, seen: &Seen| {
        let view = CardView { width: WIDTH, points: &seen.points, pixels: &seen.pixels };
        block_on(pass.shade(&gpu, &view, &shading)).unwrap()
    };
    let mut moved = Seen { points: seen.points.clone(), pixels: seen.pixels.clone() };
    for pixel in moved.pixels.iter_mut().flatten() {
        pixel.instance += 4;
    }
    let mut queue = UpdateQueue::default();
    for seen in [&seen, &moved] {
        queue = cache_of(seen, &shading.look_up, &mut cache);
        let light = ConeLight { cache: &cache, place_of: site, lights: Some(&lamps) };
        let table = CapTable::new(&light);
        assert!(pass.update(&gpu, &table).unwrap() > lights);
        assert_eq!(pass.update(&gpu, &table), Ok(lights), "nothing changed but what is always sent");
        let mut fresh = ConePass::new(&gpu).unwrap();
        fresh.update(&gpu, &table).unwrap();
        assert_eq!(shade(&mut pass, seen), shade(&mut fresh, seen));
    }
    assert!(queue.evicted > 0, "blocks that were used again");
    let before = shade(&mut pass, &moved);
    let id = queue.texels.iter().find(|t| site(t.id).is_some()).unwrap().id;
    assert!(cache.change(id, |entry| *entry = entry_of_one_light()));
    let light = ConeLight { cache: &cache, place_of: site, lights: Some(&lamps) };
    let row = (ROW_TEXELS * size_of::<Texel>()) as u64;
    assert_eq!(pass.update(&gpu, &CapTable::new(&light)), Ok(lights + row), "the row of one entry");
    assert_ne!(shade(&mut pass, &moved), before);
    // A view that nobody asked for: what its blocks held before is not what the twin finds there.
    let light = ConeLight {
        cache: &cache,
        place_of: |id| site(id).filter(|_| id.index() % 3 == 0),
        lights: Some(&lamps),
    };
    let table = CapTable::new(&light);
    pass.update(&gpu, &table).unwrap();
    for seen in [&seen, &moved] {
        let exact = shade_cones(&table, &seen.points, &seen.pixels, &shading);
        let (off, mean) = apart(seen, &shade(&mut pass, seen), &exact);
        assert!(off < 1e-3 && mean < 1e-3, "{off} of samples are off, {mean} in the mean");
    }
}

#[test]
fn large_pictures_are_drawn_in_bands() {
    let Some(gpu) = gpu_for_tests() else { return };
    let (seen, shading) = (seen(), SlcShading::default());
    let mut cache = ConeCache::<MomentEntry>::new(CacheParams::default()).unwrap();
    cache_of(&seen, &shading.look_up, &mut cache);
    let light = ConeLight { cache: &cache, place_of: site, lights: None };
    let mut pass = ConePass::new(&gpu).unwrap();
    pass.update(&gpu, &CapTable::new(&light)).unwrap();
    let mut shade = |width, points: &[_], pixels: &[_]| {
        block_on(pass.shade(&gpu, &CardView { width, points, pixels }, &shading)).unwrap()
    };
    let plain = shade(WIDTH, &seen.points, &seen.pixels);
    // Mostly empty columns beside it, so that it takes several bands.
    let width = (4 * BAND_SAMPLES as usize / HEIGHT).min(2048);
    let rows = 3 * BAND_SAMPLES as usize / width / 2;
    let (mut points, mut pixels) = (vec![None; width * rows], vec![None; width * rows]);
    let first = rows - HEIGHT;
    for y in 0..HEIGHT {
        let (to, from) = ((first + y) * width, y * WIDTH);
        points[to..to + WIDTH].copy_from_slice(&seen.points[from..from + WIDTH]);
        pixels[to..to + WIDTH].copy_from_slice(&seen.pixels[from..from + WIDTH]);
    }
    let large = shade(width, &points, &pixels);
    let part: Vec<Vec3> = (0..HEIGHT).flat_map(|y| large[(first + y) * width..][..WIDTH].to_vec()).collect();
    assert_eq!(part, plain);
    assert_eq!(
        large.iter().filter(|v| **v != Vec3::ZERO).count(),
        plain.iter().filter(|v| **v != Vec3::ZERO).count()
    );
}

fn entry_of_one_light() -> MomentEntry {
    let cone = MomentCone::from_cap(Vec3::Y, 0.9, Vec3::splat(40.0), 0.9, LightSet::one(0));
    MomentEntry::from_parts(&[cone], 64, 64)
}

#[test]
fn what_cannot_be_drawn_is_said() {
    let Some(gpu) = gpu_for_tests() else { return };
    let (seen, shading) = (seen(), SlcShading::default());
    let mut pass = ConePass::new(&gpu).unwrap();
    let mut draw = |width: usize, points: &[Option<ShadingPoint>], pixels: &[Option<PixelPlace>]| {
        block_on(pass.shade(&gpu, &CardView { width, points, pixels }, &shading)).unwrap_err()
    };
    for error in [
        draw(0, &seen.points, &seen.pixels),
        draw(WIDTH, &seen.points[1..], &seen.pixels[1..]),
        draw(WIDTH, &seen.points, &seen.pixels[WIDTH..]),
        draw(WIDTH, &[], &[]),
    ] {
        assert!(matches!(error, CardError::Size { .. }) && error.to_string().contains("rows of"), "{error}");
    }
    // Without a cache surfaces only emit.
    let view = CardView { width: WIDTH, points: &seen.points, pixels: &seen.pixels };
    let dark = block_on(pass.shade(&gpu, &view, &shading)).unwrap();
    assert!(dark.iter().zip(&seen.points).all(|(v, p)| *v == p.map_or(Vec3::ZERO, |p| p.emitted)));
    let mut cache = ConeCache::<MomentEntry>::new(CacheParams::default()).unwrap();
    cache_of(&seen, &shading.look_up, &mut cache);
    let light = ConeLight { cache: &cache, place_of: site, lights: None };
    let error = Entries::default().take(&CapTable::new(&light), 2).unwrap_err();
    assert!(matches!(error, CardError::Blocks { most: 6, .. }), "{error}");
}
