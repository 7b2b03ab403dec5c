//! Entries that share places on lights, against entries that do not.

use std::f32::consts::PI;

use dapple_scene::EmitterShape;
use dapple_scene::area_lights::{AreaLights, Environment};
use dapple_scene::glam::{Affine3A, Mat3, Vec3};
use dapple_scene::{Material, Pose, Scene};

use super::together::{Member, sample};
use super::*;
use crate::test_support::{quad, scene as placed, sphere};

/// A floor, balls over it, and lights: a sphere that all see from afar, one that is near, one of triangles.
fn stage() -> (Scene, Pose) {
    let at = |x, z| Vec3::new(x, 0.0, z);
    let mut meshes = vec![quad(at(-4.0, 4.0), at(4.0, 4.0), at(4.0, -4.0), at(-4.0, -4.0))];
    for i in 0..8 {
        let angle = i as f32 * 0.9;
        let center = Vec3::new(angle.cos(), 0.3 + 0.1 * (i % 3) as f32, angle.sin()) * 0.7;
        meshes.push(sphere(center, 0.15, 12, 16));
    }
    let lights = [
        (sphere(Vec3::new(2.0, 3.0, 1.0), 0.6, 12, 16), EmitterShape::Sphere),
        (sphere(Vec3::new(0.0, 0.9, 0.0), 0.2, 12, 16), EmitterShape::Sphere),
        (sphere(Vec3::new(-2.0, 1.5, 0.0), 0.4, 12, 16), EmitterShape::Triangles),
    ];
    let dark = meshes.len();
    meshes.extend(lights.iter().map(|(mesh, _)| mesh.clone()));
    let maps: Vec<(u32, Affine3A)> = (0..meshes.len() as u32).map(|i| (i, Affine3A::IDENTITY)).collect();
    let (mut scene, pose) = placed(meshes, &maps);
    scene.materials.push(Material { emissive_factor: Vec3::splat(5.0), ..Material::default() });
    for (i, (_, shape)) in lights.into_iter().enumerate() {
        scene.meshes[dark + i].parts[0].material = scene.materials.len() as u32 - 1;
        scene.instances[dark + i].emitter = shape;
    }
    (scene, pose)
}

fn members(center: Vec3, spacing: f32, count: u32) -> Vec<Member> {
    let source = source(0);
    (0..16)
        .map(|i| {
            let at = center + Vec3::new((i % 4) as f32, 0.0, (i / 4) as f32) * spacing;
            let place = EntryPlace {
                position_world: at,
                normal_world: Vec3::Y,
                normal_shading_world: Vec3::Y,
                position_before_world: at,
                normal_before_world: Vec3::Y,
                normal_shading_before_world: Vec3::Y,
            };
            Member::new([0, i], i as u64, [count, 0], &place, &source)
        })
        .collect()
}

fn source(seed: u64) -> Source {
    Source { pick: Pick::Fluence, sequence: Sequence::Lattice, seed, with_cosine: true }
}

/// Rays that start at lights find what rays from the entries find, whatever the light and however far.
#[test]
fn rays_from_lights_are_those_to_them() {
    let (scene, pose) = stage();
    let (tracer, lights) = (Tracer::new(&scene, &pose), AreaLights::new(&scene, &pose));
    let corner = |cell: u32| Vec3::new((cell % 10) as f32 * 0.3 - 1.5, 0.0, (cell / 10) as f32 * 0.3 - 1.5);
    let dark = |drawn: &Drawn| drawn.hidden.iter().map(|hidden| f64::from(hidden.value)).sum::<f64>();
    let (mut all, mut wrong, mut near, mut count) = (0.0f64, 0, 0, 0u32);
    let runs = 24;
    for cell in 0..100 * runs {
        let mut members = members(corner(cell % 100), 0.07, 24);
        sample(&tracer, &lights, &source(1), u64::from(cell), &mut members);
        for member in &members {
            all += dark(&member.drawn) / f64::from(runs);
            count += member.drawn.rays as u32;
            for seen in &member.drawn.samples {
                let Some(distance) = lights.hit(member.origin, seen.direction) else { continue };
                near += u32::from(seen.light == 1);
                let reach = dapple_scene::area_lights::reach(seen.direction, distance);
                wrong += u32::from(tracer.occlusion(member.origin, &[reach], 1.0)[0] & 1 == 1);
            }
        }
    }
    assert!(near * 10 > count, "{near} of {count} saw the light that is near");
    assert!(wrong * 1000 < count, "{wrong} of {count} rays are not free the other way");
    // And as much is hidden as by rays of entries' own.
    let mut own = 0.0;
    for cell in 0..100 * runs {
        for (i, member) in members(corner(cell % 100), 0.07, 24).iter().enumerate() {
            let at = corner(cell % 100) + Vec3::new((i % 4) as f32, 0.0, (i / 4) as f32) * 0.07;
            let place = EntryPlace {
                position_world: at,
                normal_world: Vec3::Y,
                normal_shading_world: Vec3::Y,
                ..EntryPlace::default()
            };
            let source = source(2);
            let chooser = chooser_for(&lights, &place, &source);
            let site = u64::from(cell * 16 + i as u32);
            let drawn = take_samples(&tracer, &lights, &chooser, &place, &source, site, 0..member.count);
            own += dark(&drawn) / f64::from(runs);
        }
    }
    assert!((all / own - 1.0).abs() < 0.02, "{all} is hidden, {own} by rays of their own");
}

/// What members find is by closed form in the mean, if each wants another number of samples, too.
#[test]
fn members_have_the_irradiance_of_the_closed_form() {
    let (mut scene, pose) = stage();
    for instance in &mut scene.instances {
        instance.casts = false;
    }
    for light in scene.instances.len() - 2..scene.instances.len() {
        let mesh = scene.instances[light].mesh as usize;
        scene.meshes[mesh].parts[0].material = 0;
    }
    let (tracer, lights) = (Tracer::new(&scene, &pose), AreaLights::new(&scene, &pose));
    assert_eq!(lights.len(), 1);
    let (mut sum, mut exact) = (0.0f64, 0.0f64);
    for site in 0..256 {
        let mut members = members(Vec3::ZERO, 0.3, 24);
        members.iter_mut().enumerate().for_each(|(i, member)| member.count = 8 + i as u32);
        sample(&tracer, &lights, &source(3), site, &mut members);
        for member in &members {
            let found: f32 = member.drawn.samples.iter().map(|sample| sample.value.x).sum();
            sum += f64::from(found / member.count as f32);
            let to_light = Vec3::new(2.0, 3.0, 1.0) - member.origin;
            let d2 = to_light.length_squared();
            exact += f64::from(5.0 * PI * 0.36 / d2 * to_light.y / d2.sqrt());
        }
    }
    assert!((sum / exact - 1.0).abs() < 0.01, "{sum}, exactly {exact}");
}

/// Surroundings and what is too near have places of each entry's own: as much light as alone, from all of them together.
#[test]
fn what_nobody_can_share_is_there_too() {
    let (mut scene, pose) = stage();
    for instance in &mut scene.instances {
        instance.casts = false;
    }
    let sky = Environment::new(8, 4, vec![Vec3::splat(0.4); 32], Mat3::IDENTITY).unwrap();
    let tracer = Tracer::new(&scene, &pose);
    let lights = AreaLights::new(&scene, &pose).with_environment(&sky, &pose);
    assert_eq!(lights.len(), 4);
    // The near light is a quarter of a metre from the rim of their ball.
    let center = Vec3::new(-0.45, 0.0, -0.45);
    let ball = (center + Vec3::new(0.45, 0.0, 0.45), 0.64);
    assert!(lights.spot(1, ball, [0.5; 3]).is_none() && lights.spot(0, ball, [0.5; 3]).is_some());
    let mut found = [0.0f64; 4];
    let mut alone = [0.0f64; 4];
    let sites = 400;
    for site in 0..sites {
        let mut members = members(center, 0.3, 24);
        sample(&tracer, &lights, &source(5), site, &mut members);
        for (i, member) in members.iter().enumerate() {
            for sample in &member.drawn.samples {
                found[sample.light as usize] += f64::from(sample.value.x);
            }
            let place = EntryPlace {
                position_world: center + Vec3::new((i % 4) as f32, 0.0, (i / 4) as f32) * 0.3,
                normal_world: Vec3::Y,
                normal_shading_world: Vec3::Y,
                ..EntryPlace::default()
            };
            let chooser = chooser_for(&lights, &place, &source(6));
            let own =
                take_samples(&tracer, &lights, &chooser, &place, &source(6), site * 16 + i as u64, 0..24);
            for sample in &own.samples {
                alone[sample.light as usize] += f64::from(sample.value.x);
            }
        }
    }
    for light in 0..4 {
        let ratio = found[light] / alone[light];
        assert!((ratio - 1.0).abs() < 0.03, "light {light}: {found:?}, alone {alone:?}");
    }
}

/// Entries that came later go on from where the oldest are, and draw nothing twice when these are not there.
#[test]
fn nobody_draws_a_place_twice() {
    let (scene, pose) = stage();
    let (tracer, lights) = (Tracer::new(&scene, &pose), AreaLights::new(&scene, &pose));
    let mut group = members(Vec3::ZERO, 0.05, 16);
    group[3].taken = 32;
    let (first, _) = sample(&tracer, &lights, &source(1), 9, &mut group);
    assert_eq!(first, 32);
    let young = std::mem::take(&mut group[0].drawn.samples);
    // Moved there, the young are without the old now.
    let mut next = members(Vec3::ZERO, 0.05, 16);
    next.iter_mut().for_each(|member| member.taken = first + 16);
    sample(&tracer, &lights, &source(1), 9, &mut next);
    assert!(!young.is_empty() && !next[0].drawn.samples.is_empty());
    for sample in &next[0].drawn.samples {
        assert!(young.iter().all(|before| before.direction != sample.direction), "{sample:?}");
    }
    let mut entry = MomentEntry::default();
    entry.skip_to(first);
    entry.update_seen(&young, &[], 16, |_| 1.0, &SlcParams::default().moment);
    assert_eq!((entry.taken(), entry.samples()), (first + 16, 16));
}
