//! Irradiance and reflected light against closed forms and against sums over many places of the lights.

use std::f32::consts::{FRAC_PI_2, PI};

use dapple_scene::area_lights::EmitterShape;
use dapple_scene::{Material, Mesh, Reflectance};
use dapple_store::light_visibility::{Lean, lean_frame};
use glam::{Affine3A, Mat3, Vec2};

use super::*;
use crate::testing::{Stage, cube, ground, matte, quad, sphere, turned};

const RADIANCE: Vec3 = Vec3::new(3.0, 2.0, 1.0);

/// A stage with one light.
fn lit(mesh: Mesh, emitter: EmitterShape, world: Affine3A, two_sided: bool) -> Stage {
    let mut stage = Stage::new();
    add_light(&mut stage, mesh, emitter, world, two_sided);
    stage
}

fn add_light(stage: &mut Stage, mesh: Mesh, emitter: EmitterShape, world: Affine3A, two_sided: bool) {
    let material = Material { emissive_factor: RADIANCE, double_sided: two_sided, ..matte(Vec3::ZERO) };
    let material = stage.add_material(material);
    let light = stage.add(mesh, material, world);
    stage.scene.instances[light as usize].emitter = emitter;
}

fn table(stage: &Stage) -> AreaLightTable {
    AreaLightTable::new(&AreaLights::new(&stage.scene, &stage.pose))
}

/// Turned so that what faced up faces down, at a height.
fn facing_down(height: f32, scale: Vec3) -> Affine3A {
    Affine3A::from_translation(Vec3::Y * height) * Affine3A::from_rotation_x(PI) * Affine3A::from_scale(scale)
}

/// Every kind of light, of a radius of about 1 about the origin, tilted; by name.
fn kinds() -> Vec<(&'static str, Stage, f32)> {
    let tilt = turned(0.6, Vec3::ZERO);
    let long = Affine3A::from_scale(Vec3::new(0.95, 1.0, 0.3));
    let ribbon = Mesh { triangles: vec![[0, 1, 2], [2, 3, 0]], ..ground(1.0) };
    vec![
        ("sphere", lit(sphere(8, 12), EmitterShape::Sphere, tilt, false), 0.002),
        ("disc", lit(ground(0.7), EmitterShape::Disc, tilt, false), 0.002),
        ("disc, both sides", lit(ground(0.7), EmitterShape::Disc, tilt, true), 0.002),
        ("rectangle", lit(ground(1.0), EmitterShape::Rectangle, tilt * long, false), 0.002),
        ("two triangles", lit(ribbon, EmitterShape::Triangles, tilt * long, false), 0.002),
        (
            "cube",
            lit(cube(), EmitterShape::Triangles, tilt * Affine3A::from_scale(Vec3::splat(0.57)), false),
            0.003,
        ),
        ("faceted ball", lit(sphere(12, 20), EmitterShape::Triangles, tilt, false), 0.3),
    ]
}

/// Irradiance of the only light by so many places on it.
fn summed(stage: &Stage, position: Vec3, value: impl Fn(Vec3) -> Vec3) -> Vec3 {
    let lights = AreaLights::new(&stage.scene, &stage.pose);
    let count = 6000u32;
    let mut sum = Vec3::ZERO;
    for i in 0..count {
        let u = [
            (f64::from(i) + 0.5) / f64::from(count),
            f64::from(i) * 0.754_877_666,
            f64::from(i) * 0.569_840_291,
        ];
        let u = u.map(|u| u.fract() as f32);
        if let Some(sample) = lights.sample_light(0, position, [u[0], u[1], u[2]]) {
            sum += sample.radiance * value(sample.to_light_world) / sample.density_per_sr;
        }
    }
    sum / count as f32
}

/// Directions all around.
fn directions(count: u32) -> impl Iterator<Item = Vec3> {
    (0..count).map(move |i| {
        let y = 1.0 - 2.0 * (i as f32 + 0.5) / count as f32;
        let (sin, cos) = libm::sincosf(i as f32 * 2.399_963);
        let r = (1.0 - y * y).sqrt();
        Vec3::new(r * cos, y, r * sin)
    })
}

#[test]
fn irradiance_has_closed_forms() {
    let arrives = |stage: &Stage, position: Vec3| {
        table(stage).arrival(0, position, Vec3::Y).map_or(0.0, |a| (a.irradiance / RADIANCE).x)
    };
    for height in [0.05f32, 0.3, 1.0, 2.0, 10.0, 300.0] {
        // The corners of the square lie at distance 1.
        let disc = lit(ground(0.5f32.sqrt()), EmitterShape::Disc, facing_down(height, Vec3::ONE), false);
        let exact = PI / (1.0 + height * height);
        let found = arrives(&disc, Vec3::ZERO);
        assert!((found / exact - 1.0).abs() < 1e-4, "disc at {height}: {found}, {exact}");
        // A rectangle with half sides a, b parallel above its middle.
        let (a, b) = (1.0f32, 0.4);
        let scale = Vec3::new(a, 1.0, b);
        let rectangle = lit(ground(1.0), EmitterShape::Rectangle, facing_down(height, scale), false);
        let side = |a: f32, b: f32| {
            let root = (a * a + height * height).sqrt();
            a / root * libm::atanf(b / root)
        };
        let exact = 2.0 * (side(a, b) + side(b, a));
        let found = arrives(&rectangle, Vec3::ZERO);
        assert!((found / exact - 1.0).abs() < 2e-3, "rectangle at {height}: {found}, {exact}");
        let ball = lit(
            sphere(8, 12),
            EmitterShape::Sphere,
            Affine3A::from_translation(Vec3::Y * (height + 1.0)),
            false,
        );
        let exact = PI / (height + 1.0).powi(2);
        let found = arrives(&ball, Vec3::ZERO);
        assert!((found / exact - 1.0).abs() < 1e-4, "sphere at {height}: {found}, {exact}");
    }
    // Half of a sphere above the horizon: its irradiance is (arcsin s − s √(1 − s²)) L.
    for s in [0.05f32, 0.19, 0.21, 0.5, 0.9] {
        let world = Affine3A::from_translation(Vec3::X) * Affine3A::from_scale(Vec3::splat(s));
        let found = arrives(&lit(sphere(8, 12), EmitterShape::Sphere, world, false), Vec3::ZERO);
        let exact = libm::asinf(s) - s * (1.0 - s * s).sqrt();
        assert!((found / exact - 1.0).abs() < 0.015, "s {s}: {found}, {exact}");
    }
}

#[test]
fn irradiance_of_all_forms_is_that_of_many_places() {
    for (name, stage, tolerance) in kinds() {
        let table = table(&stage);
        let (mut worst, mut worst_cut) = (0.0f32, 0.0f32);
        for (i, towards) in directions(11).enumerate() {
            for distance in [2.0, 3.0, 8.0, 19.9, 20.1] {
                let position = towards * distance;
                for normal in directions(5) {
                    let normal = (normal - towards * (i % 3) as f32).normalize();
                    let exact = summed(&stage, position, |l| Vec3::splat(normal.dot(l).max(0.0)));
                    // Against what a surface that faces the light would have at that distance.
                    let scale = RADIANCE.x * PI / (distance * distance);
                    let found = table.arrival(0, position, normal).map_or(Vec3::ZERO, |a| a.irradiance);
                    let error = (found - exact).abs().max_element() / scale;
                    let is_cut = normal.dot(-towards).abs() < 1.0 / distance;
                    let worst = if is_cut { &mut worst_cut } else { &mut worst };
                    *worst = worst.max(error);
                }
            }
        }
        println!("{name}: {worst}, at the horizon {worst_cut}");
        assert!(worst < tolerance, "{name}: {worst}");
        assert!(worst_cut < tolerance + 0.013, "{name}, at the horizon: {worst_cut}");
    }
}

fn surface(
    roughness: f32,
    metallic: f32,
    specular: bool,
    position: Vec3,
    normal: Vec3,
    viewer: Vec3,
) -> ShadingPoint {
    let material = Material { roughness_factor: roughness, metallic_factor: metallic, ..Material::default() };
    let scene = dapple_scene::Scene::default();
    let reflectance =
        Reflectance::of(&scene, &material, &[Vec2::ZERO; 2], Vec3::new(0.9, 0.5, 0.3), specular);
    ShadingPoint {
        instance: 0,
        position_world: position,
        normal_world: normal,
        normal_shading_world: normal,
        to_viewer_world: viewer,
        reflectance,
        emitted: Vec3::splat(7.0),
    }
}

#[test]
fn from_afar_lights_are_as_large_as_their_discs() {
    const FAR: f32 = 100.0;
    for (name, stage, _) in kinds() {
        let table = table(&stage);
        let spot = table.spots().next().unwrap();
        let (mut found, mut expected) = (0.0, 0.0);
        for direction in directions(2000) {
            let arrival = table.arrival(0, direction * FAR, -direction);
            found += arrival.map_or(0.0, |arrival| luminance(arrival.irradiance)) * FAR * FAR / PI;
            let facing = if spot.facing == Vec3::ZERO { 1.0 } else { spot.facing.dot(direction).max(0.0) };
            expected += spot.strength * facing;
        }
        // The ball is told by a few places, of which some see more than a fourth.
        let most = if name == "faceted ball" { 0.1 } else { 0.01 };
        assert!((found / expected - 1.0).abs() < most, "{name}: {found}, as a disc {expected}");
    }
}

#[test]
fn what_is_reflected_is_what_many_places_give() {
    for (name, stage, tolerance) in kinds() {
        let table = table(&stage);
        for (roughness, metallic, specular, most) in [
            (1.0, 0.0, false, 0.005),
            (1.0, 0.0, true, 0.005),
            (0.6, 1.0, true, 0.06),
            (0.35, 0.0, true, 0.1),
        ] {
            let (mut difference, mut total) = (0.0, 0.0);
            for towards in directions(12) {
                for distance in [2.0, 6.0] {
                    let position = towards * distance;
                    let normal = (-towards + Vec3::new(0.2, 0.5, -0.3)).normalize();
                    for aside in [Vec3::ZERO, Vec3::X * 0.3, Vec3::new(0.3, -0.6, 0.4)] {
                        let viewer = (towards + normal * (2.0 * -towards.dot(normal)) + aside).normalize();
                        if viewer.dot(normal) < 0.1 {
                            continue;
                        }
                        let point = surface(roughness, metallic, specular, position, normal, viewer);
                        let exact = summed(&stage, position, |l| point.reflected(l));
                        let half = shade_area_lights(&[Some(point), None], &table, |_, row| {
                            row.fill(SeenLight::of(0.5))
                        });
                        assert_eq!(half[1], Vec3::ZERO);
                        difference += (half[0] * 2.0 - exact).abs().element_sum();
                        total += exact.element_sum();
                    }
                }
            }
            let error: f32 = difference / total;
            println!("{name}, roughness {roughness}, metallic {metallic}, gloss {specular}: {error}");
            assert!(error < most + tolerance, "{name} at roughness {roughness}: {error}");
        }
    }
}

/// A half or a sliver of each light is hidden by something with a straight edge: highlights are where the rest is, and as large.
#[test]
fn highlights_of_lights_half_hidden_are_of_the_half_that_is_seen() {
    for (name, stage, _) in kinds().into_iter().take(5) {
        let table = table(&stage);
        let (mut whole, mut leaning, mut total) = (0.0, 0.0, 0.0);
        for (towards, turn) in directions(12).zip(0u8..) {
            let position = towards * 4.0;
            let normal = (-towards + Vec3::new(0.2, 0.5, -0.3)).normalize();
            let edge = (-towards).any_orthonormal_vector();
            let edge =
                edge * (0.3 * f32::from(turn)).cos() + edge.cross(towards) * (0.3 * f32::from(turn)).sin();
            for offset in [0.0, -0.08, 0.08] {
                let is_seen = |l: Vec3| if edge.dot(l) > offset { 1.0 } else { 0.0 };
                let cosine = |l: Vec3| normal.dot(l).max(0.0);
                let share = |l: Vec3| cosine(l) * RADIANCE.recip().x;
                let [all, seen] = [false, true].map(|only_seen| {
                    // As a server does it: the middle of what arrives.
                    let weight = |l: Vec3| share(l) * if only_seen { is_seen(l) } else { 1.0 };
                    summed(&stage, position, |l| l * weight(l)) / RADIANCE * RADIANCE.x
                });
                let amounts = [
                    summed(&stage, position, |l| Vec3::splat(cosine(l))),
                    summed(&stage, position, |l| Vec3::splat(cosine(l) * is_seen(l))),
                ];
                let fraction = amounts[1].x / amounts[0].x;
                if !(0.1..0.9).contains(&fraction) {
                    continue;
                }
                let size = summed(&stage, position, |_| Vec3::ONE).x / RADIANCE.x;
                let depth = 2.0 * (1.0 - (summed(&stage, position, |l| l) / RADIANCE).length() / size);
                let axis = all.normalize();
                let shift = (seen.normalize() - axis) / (depth * (2.0 - depth)).sqrt();
                let lean = Lean::quantized(lean_frame(axis).map(|across| across.dot(shift))).radii();
                for aside in [Vec3::ZERO, Vec3::X * 0.15, Vec3::new(0.1, -0.2, 0.2)] {
                    let viewer = (towards + normal * (2.0 * -towards.dot(normal)) + aside).normalize();
                    let point = surface(0.25, 1.0, true, position, normal, viewer);
                    let exact = summed(&stage, position, |l| point.reflected(l) * is_seen(l));
                    let of = |lean: [f32; 2]| {
                        let seen = SeenLight { fraction, lean };
                        shade_area_lights(&[Some(point)], &table, |_, row| row.fill(seen))[0]
                    };
                    whole += (of([0.0; 2]) - exact).abs().element_sum();
                    leaning += (of(lean) - exact).abs().element_sum();
                    total += exact.element_sum();
                }
            }
        }
        println!("{name}: off by {} without leans, {} with", whole / total, leaning / total);
        assert!(leaning < 0.7 * whole, "{name}: {leaning}, {whole} of {total}");
    }
}

#[test]
fn no_light_gives_more_than_light_from_all_sides() {
    for (name, stage, _) in kinds() {
        let table = table(&stage);
        for towards in directions(40) {
            for distance in [0.0, 1e-6, 0.01, 0.2, 0.56, 0.57, 0.999, 1.0, 1.000_01, 1.01, 1.2] {
                let position = towards * distance;
                for normal in directions(9) {
                    let Some(arrival) = table.arrival(0, position, normal) else { continue };
                    let most = RADIANCE * (PI * 1.001);
                    let Arrival { irradiance, direction, cos_angle } = arrival;
                    assert!(
                        irradiance.cmple(most).all() && irradiance.cmpge(Vec3::ZERO).all(),
                        "{name} {irradiance}"
                    );
                    assert!(
                        (direction.length() - 1.0).abs() < 1e-4 && (-1.0..=1.0).contains(&cos_angle),
                        "{name}"
                    );
                    let point = surface(0.1, 0.0, true, position, normal, normal);
                    let reflected =
                        shade_area_lights(&[Some(point)], &table, |_, row| row.fill(SeenLight::ALL));
                    assert!(reflected[0].is_finite(), "{name} {reflected:?}");
                }
            }
        }
    }
    // A white floor close under a light without end is as bright as the light.
    for height in [1e-2f32, 1.0] {
        let stage = lit(ground(1e3), EmitterShape::Rectangle, facing_down(height, Vec3::ONE), false);
        let mut point = surface(1.0, 0.0, false, Vec3::new(3.0, 0.0, -7.0), Vec3::Y, Vec3::Y);
        point.reflectance.diffuse = Vec3::ONE;
        let reflected = shade_area_lights(&[Some(point)], &table(&stage), |_, row| row.fill(SeenLight::ALL));
        assert!((reflected[0] / RADIANCE - 1.0).abs().max_element() < 5e-3, "{reflected:?}");
    }
}

#[test]
fn what_is_dark_gone_or_without_area_gives_nothing() {
    let mut stage = Stage::new();
    add_light(
        &mut stage,
        sphere(4, 6),
        EmitterShape::Sphere,
        Affine3A::from_translation(Vec3::Y * 3.0),
        false,
    );
    add_light(
        &mut stage,
        ground(1.0),
        EmitterShape::Rectangle,
        facing_down(2.0, Vec3::new(1.0, 1.0, 0.0)),
        false,
    );
    add_light(&mut stage, ground(0.0), EmitterShape::Disc, facing_down(2.0, Vec3::ONE), false);
    add_light(&mut stage, ground(0.0), EmitterShape::Triangles, facing_down(2.0, Vec3::ONE), false);
    add_light(&mut stage, ground(1.0), EmitterShape::Triangles, facing_down(f32::NAN, Vec3::ONE), false);
    add_light(&mut stage, ground(1.0), EmitterShape::Disc, facing_down(2.0, Vec3::ONE), false);
    stage.pose.instances[5].world_from_mesh = Affine3A::from_mat3(Mat3::ZERO);
    let point = surface(0.5, 0.0, true, Vec3::ZERO, Vec3::Y, Vec3::Y);
    let shade = |stage: &Stage| {
        let table = table(stage);
        assert_eq!(table.lights(), [0, 1, 2, 3, 4, 5]);
        assert!((1..6).all(|slot| table.arrival(slot, Vec3::ZERO, Vec3::Y).is_none()));
        shade_area_lights(&[Some(point)], &table, |_, row| row.fill(SeenLight::ALL))[0]
    };
    let lit = shade(&stage);
    assert!(lit.is_finite() && lit.min_element() > 0.0, "{lit}");
    let none = shade_area_lights(&[Some(point)], &table(&stage), |_, row| row.fill(SeenLight::of(0.0)));
    assert_eq!(none, [Vec3::ZERO], "nothing of it is seen, and nothing emitted is added");
    stage.pose.instances[0].world_from_mesh = Affine3A::from_mat3(Mat3::ZERO);
    assert!(table(&stage).is_dark());
    assert_eq!(shade(&stage), Vec3::ZERO);
    assert_eq!(AreaLightTable::default().lights(), [0u32; 0]);
}

#[test]
fn of_too_many_lights_the_most_powerful_are_shown() {
    let mut stage = Stage::new();
    for i in 0..100u32 {
        let size = if i % 3 == 0 { 2.0 } else { 1.0 };
        add_light(
            &mut stage,
            ground(size),
            EmitterShape::Rectangle,
            Affine3A::from_rotation_x(FRAC_PI_2),
            false,
        );
    }
    let table = table(&stage);
    let expected: Vec<u32> =
        (0..100).filter(|i| i % 3 == 0).chain((0..100).filter(|i| i % 3 != 0).take(30)).collect();
    let mut expected = expected;
    expected.sort_unstable();
    assert_eq!((table.lights().len(), table.lights()), (MAX_AREA_LIGHTS, &expected[..]));
}

#[test]
fn both_sides_of_a_light_shine_alike() {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
    for emitter in [EmitterShape::Triangles, EmitterShape::Rectangle, EmitterShape::Disc] {
        let arrive = |two_sided: bool, z: f32| {
            let table = table(&lit(quad(corners), emitter, Affine3A::IDENTITY, two_sided));
            table
                .arrival(0, Vec3::new(0.2, 0.4, z), Vec3::new(0.1, 0.2, -z).normalize())
                .map(|a| a.irradiance)
        };
        assert_eq!(arrive(false, -1.0), None);
        assert_eq!(arrive(true, 1.0), arrive(false, 1.0));
        let [front, back] = [1.0, -1.0].map(|z| arrive(true, z).unwrap());
        assert!((front - back).abs().max_element() < 1e-5, "{front} {back}");
    }
}
