//! Which light of entries is shaded by the shapes of lights, and that it is as much as they see.

use dapple_scene::area_lights::{AreaLights, Environment};
use dapple_scene::{EmitterShape, Material, Mesh, Reflectance, ShadingPoint};
use dapple_store::cones::{
    CacheParams, ChartPlace, ConeCache, EntrySite, LightSet, LookUp, MomentCone, MomentEntry, PixelPlace,
    Requests, View,
};
use dapple_store::light_visibility::SeenLight;
use glam::{Affine3A, Vec3};
use proptest::prelude::*;

use super::blend::level;
use super::cap::Toward;
use super::*;
use crate::area_lights::{AreaLightTable, shade_area_lights};
use crate::testing::{Stage, matte, sphere};

const LAMP: Vec3 = Vec3::new(0.5, 2.0, -0.4);

fn lamp(emitter: EmitterShape, mesh: Mesh) -> AreaLightTable {
    let mut stage = Stage::new();
    let material =
        stage.add_material(Material { emissive_factor: Vec3::new(3.0, 2.0, 1.0), ..matte(Vec3::ZERO) });
    let light =
        stage.add(mesh, material, Affine3A::from_translation(LAMP) * Affine3A::from_scale(Vec3::splat(0.2)));
    stage.scene.instances[light as usize].emitter = emitter;
    AreaLightTable::new(&AreaLights::new(&stage.scene, &stage.pose))
}

fn floor(roughness: f32) -> ShadingPoint {
    let (diffuse, f0) = (Vec3::splat(0.4), Vec3::splat(0.3));
    ShadingPoint {
        instance: 0,
        position_world: Vec3::ZERO,
        normal_world: Vec3::Y,
        normal_shading_world: Vec3::Y,
        to_viewer_world: Vec3::new(-0.5, 1.5, 0.3).normalize(),
        reflectance: Reflectance { diffuse, f0, alpha: roughness * roughness, specular: true },
        emitted: Vec3::splat(0.125),
    }
}

/// A cone of light 0, of so much of it, with an energy that is wrong.
fn cone(seen: f32, energy: f32) -> MomentCone {
    let cone = MomentCone::from_cap(LAMP.normalize(), 0.995, Vec3::splat(energy), 0.95, LightSet::one(0));
    MomentCone { seen, ..cone }
}

/// A place between four texels.
fn between_four() -> PixelPlace {
    PixelPlace {
        instance: 0,
        triangle: 0,
        barycentrics: [0.25; 2],
        place: ChartPlace { chart: 0, uv: [8.0; 2], depth: 0.0, size: [50, 50], texel_m: 1.0 },
        footprint_m: 1.0,
        lean: [0.0; 2],
    }
}

/// What a place shows whose four entries hold these cones, young ones.
fn shaded(point: &ShadingPoint, cones: [&[MomentCone]; 4], lights: Option<&AreaLightTable>) -> Vec3 {
    shaded_after(16, point, cones, lights)
}

/// The same of entries of so many samples.
fn shaded_after(
    samples: u16,
    point: &ShadingPoint,
    cones: [&[MomentCone]; 4],
    lights: Option<&AreaLightTable>,
) -> Vec3 {
    shaded_by(&SlcShading::default(), samples, point, cones, lights)
}

fn shaded_by(
    shading: &SlcShading,
    samples: u16,
    point: &ShadingPoint,
    cones: [&[MomentCone]; 4],
    lights: Option<&AreaLightTable>,
) -> Vec3 {
    let pixels = [Some(between_four())];
    let mut cache = ConeCache::<MomentEntry>::new(CacheParams::default()).unwrap();
    let queue = cache.admit(&Requests::gather(&[View { width: 1, pixels: &pixels }], &LookUp::default()));
    assert_eq!(queue.texels.len(), 4, "a place between four texels");
    let update = |i: usize, _: &_, entry: &mut MomentEntry| {
        *entry = MomentEntry::from_parts(cones[i], samples, u32::from(samples));
        true
    };
    assert_eq!(cache.update(&queue, update), Ok(4));
    let site = EntrySite { position_world: Vec3::ZERO, normal_world: Vec3::Y, normal_shading_world: Vec3::Y };
    let light = ConeLight { cache: &cache, place_of: |_| Some(site), lights };
    shade_cones(&CapTable::new(&light), &[Some(*point)], &pixels, shading)[0]
}

fn by_shape(point: &ShadingPoint, table: &AreaLightTable) -> Vec3 {
    shade_area_lights(&[Some(*point)], table, |_, row| row.fill(SeenLight::ALL))[0]
}

#[track_caller]
fn assert_near(found: Vec3, exact: Vec3) {
    assert!(found.distance(exact) <= 1e-4 * exact.length(), "{found}, {exact}");
}

#[test]
fn a_light_that_is_seen_whole_has_its_own_shape_whatever_its_energy() {
    let table = lamp(EmitterShape::Sphere, sphere(8, 12));
    for roughness in [0.2, 0.8] {
        let point = floor(roughness);
        let exact = point.emitted + by_shape(&point, &table);
        for energy in [1e-3, 0.1, 7.0] {
            let whole = [cone(1.0, energy)];
            assert_near(shaded(&point, [&whole; 4], Some(&table)), exact);
            // Two cones that it fell into.
            let parts = [cone(0.3, energy), cone(0.7, energy)];
            assert_near(shaded(&point, [&parts; 4], Some(&table)), exact);
        }
    }
}

#[test]
fn entries_that_see_part_of_a_light_have_that_part() {
    let table = lamp(EmitterShape::Sphere, sphere(8, 12));
    let point = floor(0.9);
    let matte = ShadingPoint { reflectance: Reflectance { specular: false, ..point.reflectance }, ..point };
    let exact = by_shape(&matte, &table);
    let [whole, half] = [[cone(1.0, 0.2)], [cone(0.5, 0.1)]];
    // Two of four see all of it, one half, one nothing.
    let found = shaded(&matte, [&whole, &whole, &half, &[]], Some(&table));
    assert_near(found, matte.emitted + exact * 0.625);
}

#[test]
fn what_is_not_known_or_has_no_form_is_left_to_cones() {
    let table = lamp(EmitterShape::Sphere, sphere(8, 12));
    let ball = lamp(EmitterShape::Triangles, sphere(12, 20));
    let point = floor(0.5);
    let cones = [cone(1.0, 0.2)];
    let alone = shaded(&point, [&cones; 4], None);
    let unknown = [cone(0.0, 0.2)];
    assert_eq!(shaded(&point, [&unknown; 4], Some(&table)), alone);
    // Of many triangles: places stand for it.
    assert_eq!(shaded(&point, [&cones; 4], Some(&ball)), alone);
    assert_eq!(ball.slot_of_form(0), None);
    // One that is not in the table.
    assert_eq!((table.slot_of_form(0), table.slot_of_form(1)), (Some(0), None));
    assert!(shaded(&point, [&cones; 4], Some(&table)) != alone);
}

#[test]
fn settled_entries_show_parts_by_their_cones_and_what_is_narrow_and_whole_by_its_shape() {
    let table = lamp(EmitterShape::Sphere, sphere(8, 12));
    let (rough, smooth) = (floor(0.9), floor(0.05));
    let [whole, half] = [[cone(1.0, 0.2)], [cone(0.5, 0.1)]];
    let settled = |point, cones: &[MomentCone], lights| shaded_after(200, point, [cones; 4], lights);
    assert_near(settled(&rough, &whole, Some(&table)), rough.emitted + by_shape(&rough, &table));
    assert_eq!(settled(&rough, &half, Some(&table)), settled(&rough, &half, None));
    // Wider than the lobe.
    assert_eq!(settled(&smooth, &whole, Some(&table)), settled(&smooth, &whole, None));
    assert!(shaded(&smooth, [&whole; 4], Some(&table)) != shaded(&smooth, [&whole; 4], None));
    // Half way.
    let between = shaded_after(64, &rough, [&half; 4], Some(&table));
    assert_near(between, 0.5 * (settled(&rough, &half, None) + shaded(&rough, [&half; 4], Some(&table))));
}

/// The highlights of all four, where there are any to be seen.
#[test]
fn smooth_surfaces_show_the_cones_of_each_entry() {
    let from = |x: f32| {
        let direction = Vec3::new(x, 1.5, -0.3).normalize();
        [MomentCone::from_cap(direction, 0.999, Vec3::splat(0.2), 0.95, LightSet::one(0))]
    };
    let [a, b, c, d] = [0.3, 0.45, 0.6, 0.75].map(from);
    let each = SlcShading { blending: Blending::Cones, ..SlcShading::default() };
    let found = |roughness, shading| shaded_by(&shading, 16, &floor(roughness), [&a, &b, &c, &d], None);
    assert_eq!(found(0.3, SlcShading::default()), found(0.3, each));
    assert!(found(0.9, SlcShading::default()) != found(0.9, each));
    // Each as much as it weighs.
    let alone = [&a, &b, &c, &d].map(|cones| shaded(&floor(0.3), [cones; 4], None));
    assert_near(found(0.3, each), alone.iter().sum::<Vec3>() / 4.0);
}

/// Two lamps in one cone over a polished floor: their mirror images are where the lamps are, and of what stands between them there is none.
#[test]
fn smooth_surfaces_mirror_the_lights_of_a_cone_of_several() {
    let mut stage = Stage::new();
    let lamps = [Vec3::new(0.9, 1.5, 0.0), Vec3::new(-0.7, 1.6, 0.2)];
    // Of equal luminance.
    let colors = [Vec3::new(2.0, 0.6, 0.5), Vec3::new(0.4, 0.8, 3.230_2)];
    for (at, emissive_factor) in lamps.into_iter().zip(colors) {
        let material = stage.add_material(Material { emissive_factor, ..matte(Vec3::ZERO) });
        let place = Affine3A::from_translation(at) * Affine3A::from_scale(Vec3::splat(0.1));
        let light = stage.add(sphere(8, 12), material, place);
        stage.scene.instances[light as usize].emitter = EmitterShape::Sphere;
    }
    let table = AreaLightTable::new(&AreaLights::new(&stage.scene, &stage.pose));
    // Fluence of a small light is as its solid angle.
    let one = |light: usize| {
        let direction = lamps[light].normalize();
        let energy = colors[light] * (direction.y / lamps[light].length_squared());
        MomentCone::from_cap(direction, 0.9999, energy, direction.y, LightSet::one(light as u32))
    };
    let apart = [one(0), one(1)];
    let moment = apart[0].moment + apart[1].moment;
    let fluence = apart[0].fluence + apart[1].fluence;
    let energy = apart[0].energy + apart[1].energy;
    let lights = apart[0].lights.union(apart[1].lights);
    let together = MomentCone { energy, fluence, moment, lights, ..MomentCone::default() };
    let (mut ours, mut caps, mut all) = (0.0, 0.0, 0.0);
    for step in -16..=16 {
        let to_viewer_world = Vec3::new(step as f32 * 0.08, 1.5, -0.1).normalize();
        let point = ShadingPoint { to_viewer_world, ..floor(0.35) };
        // By the cones of each: without shapes.
        let exact = shaded_after(255, &point, [&apart; 4], None);
        ours += shaded_after(255, &point, [&[together]; 4], Some(&table)).distance(exact);
        caps += shaded_after(255, &point, [&[together]; 4], None).distance(exact);
        all += exact.length();
    }
    println!("{} and {}", ours / all, caps / all);
    assert!(ours < 0.05 * all && caps > 0.3 * all, "{} and {}", ours / all, caps / all);
    // What may hold none of the lights is left to its cone, and what may hold the light of a sky, which no lamp mirrors.
    let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x82\x80\x80\x80\x82";
    let sky = Environment::from_hdr(hdr).unwrap();
    let outdoors = AreaLights::new(&stage.scene, &stage.pose).with_environment(&sky, &stage.pose);
    let outdoors = AreaLightTable::new(&outdoors);
    let of_sky = MomentCone { lights: lights.union(LightSet::one(2)), ..together };
    let by_cone = shaded(&floor(0.35), [&[together]; 4], None);
    assert_eq!(shaded(&floor(0.35), [&[of_sky]; 4], Some(&outdoors)), by_cone);
    assert!(shaded(&floor(0.35), [&[together]; 4], Some(&outdoors)) != by_cone);
    let other = MomentCone { lights: LightSet::one(5).union(LightSet::one(7)), ..together };
    let point = floor(0.35);
    assert_eq!(shaded(&point, [&[other]; 4], Some(&table)), shaded(&point, [&[other]; 4], None));
}

/// Lights of a cone are together as high as its light is, wherever the first guess has them.
#[test]
fn lights_of_a_cone_are_as_high_as_its_light() {
    let light = |height: f32, weight: f32| {
        let direction = Vec3::new((1.0 - height * height).sqrt(), height, 0.0);
        Toward { direction, weight, tint: Vec3::ONE, ..Toward::default() }
    };
    let height_of = |lights: &[Toward]| {
        let all: f32 = lights.iter().map(|light| light.weight).sum();
        lights.iter().map(|light| light.weight * light.direction.y).sum::<f32>() / all
    };
    for truth in [[3.0, 1.0, 1.0], [1.0, 1.0, 2.0], [1.0, 4.0, 3.0]] {
        let heights = [0.1, 0.35, 0.6];
        let exact: Vec<Toward> =
            heights.iter().zip(truth).map(|(height, weight)| light(*height, weight)).collect();
        let mean = exact.iter().map(|light| light.direction * light.weight).sum::<Vec3>()
            / exact.iter().map(|light| light.weight).sum::<f32>();
        let cap = Cap {
            direction: mean.normalize(),
            cos_angle: 2.0 * mean.length() - 1.0,
            energy: Vec3::ONE,
            mean_cosine: mean.y,
        };
        let mut guess = heights.map(|height| light(height, 1.0));
        level(&mut guess, &cap, Vec3::Y);
        assert!((height_of(&guess) - mean.y).abs() < 2e-3, "{}, {}", height_of(&guess), mean.y);
        assert!(guess.iter().all(|light| light.weight > 0.0));
    }
    // One alone has nowhere to go.
    let mut alone = [light(0.3, 2.0)];
    let above = Cap { direction: Vec3::Y, cos_angle: 0.9, energy: Vec3::ONE, mean_cosine: 0.95 };
    level(&mut alone, &above, Vec3::Y);
    assert!((height_of(&alone) - 0.3).abs() < 1e-6);
}

/// Whatever changes, of the entries or of the lights, caps that are kept are those made anew.
#[test]
fn caps_that_are_kept_are_as_if_made_anew() {
    let point = floor(0.5);
    let pixels = [Some(between_four())];
    let mut cache = ConeCache::<MomentEntry>::new(CacheParams::default()).unwrap();
    let queue = cache.admit(&Requests::gather(&[View { width: 1, pixels: &pixels }], &LookUp::default()));
    let holds = |energy: f32| MomentEntry::from_parts(&[cone(0.9, energy)], 16, 16);
    cache
        .update(&queue, |_, _, entry| {
            *entry = holds(0.2);
            true
        })
        .unwrap();
    let [ball, triangles] =
        [lamp(EmitterShape::Sphere, sphere(8, 12)), lamp(EmitterShape::Triangles, sphere(12, 20))];
    let site = EntrySite { position_world: Vec3::ZERO, normal_world: Vec3::Y, normal_shading_world: Vec3::Y };
    let mut kept = KeptCaps::default();
    let mut seen = Vec::new();
    for step in 0..8 {
        if step == 4 {
            assert!(cache.change(queue.texels[1].id, |entry| *entry = holds(3.0)));
        }
        let lights = [None, Some(&ball), Some(&triangles), Some(&ball)][step % 4];
        let light = ConeLight { cache: &cache, place_of: |_| Some(site), lights };
        let shade =
            |table: &CapTable<'_, _>| shade_cones(table, &[Some(point)], &pixels, &SlcShading::default())[0];
        let [found, anew] = [kept.table(&light, |block| cache.changed_at(block)), CapTable::new(&light)]
            .map(|table| shade(&table));
        assert_eq!(found, anew, "step {step}");
        seen.push(found);
    }
    assert!(seen[0] != seen[1] && seen[1] != seen[2] && seen[0] != seen[4], "{seen:?}");
}

/// Unit, of any three numbers.
fn unit(v: [f32; 3]) -> Vec3 {
    Vec3::from(v).normalize_or(Vec3::Y)
}

fn any_direction() -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(-1.0f32..1.0).prop_map(unit)
}

/// Mirrors and chalk, black and white, seen from anywhere, also from below.
fn any_point() -> impl Strategy<Value = ShadingPoint> {
    let part = || prop_oneof![Just(0.0f32), Just(1.0), 0.0f32..1.0];
    let reflectance = (part(), part(), part(), any::<bool>());
    let normals = (any_direction(), any_direction(), any_direction());
    (reflectance, normals, prop_oneof![Just(0.0f32), -1e5f32..1e5]).prop_map(|(of, normals, x)| {
        let (diffuse, f0, roughness, specular) = of;
        let (normal_world, leaning, to_viewer_world) = normals;
        let material = Material {
            metallic_factor: f0,
            roughness_factor: roughness,
            unlit: false,
            ..matte(Vec3::splat(diffuse))
        };
        let stage = Stage::new();
        let uv = [glam::Vec2::ZERO; 2];
        let reflectance = Reflectance::of(&stage.scene, &material, &uv, Vec3::splat(diffuse), specular);
        let lean = if leaning.dot(normal_world) > 0.0 { leaning } else { normal_world };
        ShadingPoint {
            instance: 0,
            position_world: Vec3::new(x, 0.0, 0.0),
            normal_world,
            normal_shading_world: lean,
            to_viewer_world,
            reflectance,
            emitted: Vec3::ZERO,
        }
    })
}

/// From hardly any light to all that an entry holds, from points to all around, at the horizon and below it.
fn any_cone() -> impl Strategy<Value = MomentCone> {
    let width = prop_oneof![Just(1.0f32), Just(-1.0), -1.0f32..1.0];
    let cosine = prop_oneof![Just(0.0f32), Just(1.0), 0.0f32..1.0];
    let rest = (-11.0f32..15.0, 0u32..3, prop_oneof![Just(0.0f32), Just(1.0), 0.0f32..1.0]);
    (any_direction(), width, cosine, rest).prop_map(|(direction, width, cosine, (power, light, seen))| {
        let energy = Vec3::new(1.0, 0.5, 0.0) * libm::exp10f(power);
        let cone = MomentCone::from_cap(direction, width, energy, cosine, LightSet::one(light));
        MomentCone { seen, ..cone }
    })
}

proptest! {
    #[test]
    fn no_material_and_no_cone_breaks_a_picture(
        point in any_point(),
        cones in prop::array::uniform4(prop::collection::vec(any_cone(), 0..=4)),
        samples in 0u16..300,
        shapes in any::<bool>(),
    ) {
        let table = shapes.then(|| lamp(EmitterShape::Sphere, sphere(4, 6)));
        let found = shaded_after(samples, &point, cones.each_ref().map(Vec::as_slice), table.as_ref());
        prop_assert!(found.is_finite() && found.min_element() >= 0.0, "{found}");
    }
}
