//! Area lights on the card against the twin: every form, open and with what points see of them, and nothing at all without lights.

use dapple_scene::area_lights::{AreaLights, EmitterShape};
use dapple_scene::{Material, PosedCamera};
use dapple_store::light_visibility::{LEAN_STEPS, Lean, LightChange, LightVisibility, OPEN, SeenLight};
use glam::{Affine3A, Vec3};

use super::super::{AtlasBand, LookupId, View};
use super::harness::{Bench, assert_agrees, compare, inputs, save, twin};
use crate::area_lights::{AreaLightTable, shade_area_lights};
use crate::compose::compose;
use crate::gbuffer::GBuffer;
use crate::image::{Rgb8Image, ToneMap};
use crate::psao::atlas::tests::lay;
use crate::psao::atlas::{AtlasParams, VisibilityAtlas};
use crate::shade::{ShadeParams, render_shadow_maps, shade, shading_points};
use crate::testing::{Stage, cube, ground, matte, sphere, turned};

const SIZE: (u32, u32) = (240, 160);

/// Matte and glossy things under one light of each form, and two more so that lights need two groups.
fn stage() -> Stage {
    let mut stage = Stage::new();
    let glossy = stage.add_material(Material { roughness_factor: 0.3, ..matte(Vec3::new(0.8, 0.5, 0.2)) });
    let metal = stage.add_material(Material {
        base_color_factor: glam::Vec4::new(0.9, 0.7, 0.4, 1.0),
        roughness_factor: 0.5,
        ..Material::default()
    });
    stage.add(ground(3.0), 0, Affine3A::IDENTITY);
    stage.add(
        sphere(24, 48),
        glossy,
        Affine3A::from_translation(Vec3::new(-0.9, 0.8, 0.2)) * Affine3A::from_scale(Vec3::splat(0.8)),
    );
    stage.add(cube(), metal, turned(0.7, Vec3::new(1.2, 0.7, -0.4)) * Affine3A::from_scale(Vec3::splat(0.5)));
    // Mirrored, and with two sides.
    let two_sided = stage.add_material(Material { double_sided: true, ..matte(Vec3::new(0.3, 0.6, 0.9)) });
    let odd = Affine3A::from_scale(Vec3::new(-0.5, 0.6, 0.4));
    stage.add(ground(1.0), two_sided, turned(0.9, Vec3::new(0.4, 0.8, 1.4)) * odd);
    let down = |at: Vec3, scale: f32| {
        Affine3A::from_translation(at)
            * Affine3A::from_rotation_x(std::f32::consts::PI)
            * Affine3A::from_scale(Vec3::splat(scale))
    };
    let small =
        |at: Vec3, scale: f32| Affine3A::from_translation(at) * Affine3A::from_scale(Vec3::splat(scale));
    for (mesh, emitter, world, radiance) in [
        (
            sphere(8, 12),
            EmitterShape::Sphere,
            small(Vec3::new(-2.0, 0.1, 1.6), 0.3),
            Vec3::new(3.0, 1.5, 0.5),
        ),
        (ground(1.0), EmitterShape::Disc, down(Vec3::new(1.5, 2.6, 0.8), 0.3), Vec3::new(0.5, 2.0, 3.0)),
        (ground(1.0), EmitterShape::Rectangle, down(Vec3::new(-1.0, 2.8, -1.0), 0.5), Vec3::splat(2.0)),
        (cube(), EmitterShape::Triangles, small(Vec3::new(2.3, 0.2, 1.8), 0.2), Vec3::new(4.0, 0.4, 2.0)),
        (
            sphere(5, 7),
            EmitterShape::Triangles,
            small(Vec3::new(-0.2, 0.2, 2.4), 0.2),
            Vec3::new(0.5, 4.0, 1.0),
        ),
        (
            ground(1.0),
            EmitterShape::Triangles,
            down(Vec3::new(0.3, 1.9, -2.0), 0.4),
            Vec3::new(1.0, 1.0, 4.0),
        ),
    ] {
        let material = stage.add_material(Material { emissive_factor: radiance, ..matte(Vec3::ZERO) });
        let light = stage.add(mesh, material, world);
        stage.scene.instances[light as usize].emitter = emitter;
    }
    stage
}

fn camera() -> PosedCamera {
    PosedCamera::look_at(Vec3::new(1.5, 3.0, 5.0), Vec3::new(0.0, 0.5, 0.2), 0.8)
}

fn table(stage: &Stage) -> AreaLightTable {
    AreaLightTable::new(&AreaLights::new(&stage.scene, &stage.pose))
}

fn dim() -> ShadeParams {
    ShadeParams { sun_without_lights: false, ..ShadeParams::default() }
}

/// What the twins draw with area lights.
fn lit_twin(stage: &Stage, params: &ShadeParams, atlas: Option<&VisibilityAtlas>) -> (Rgb8Image, GBuffer) {
    let (scene, pose, camera) = (&stage.scene, &stage.pose, &camera());
    let (_, gbuffer) = twin(scene, pose, camera, SIZE, params);
    let mut shaded = shade(scene, pose, camera, &gbuffer, &render_shadow_maps(scene, pose, params), params);
    let points = shading_points(scene, pose, camera, &gbuffer, params.specular);
    let table = table(stage);
    let reflected = shade_area_lights(&points, &table, |sample, row| match atlas {
        Some(atlas) => atlas.look_up_lights(&gbuffer.samples()[sample], table.lights(), row),
        None => row.fill(SeenLight::ALL),
    });
    shaded.direct.iter_mut().zip(reflected).for_each(|(direct, reflected)| *direct += reflected);
    (compose(&shaded, &gbuffer, None).unwrap().to_rgb8(&ToneMap::default()), gbuffer)
}

fn draw(bench: &mut Bench, stage: &Stage, params: &ShadeParams, lookup: LookupId) -> Rgb8Image {
    let views = [View::new(camera(), lookup)];
    bench.draw(SIZE, &inputs(&stage.pose, params, &views))
}

#[test]
fn every_form_of_light_is_lit_like_the_twin_and_none_changes_nothing() {
    let stage = stage();
    let Some(mut bench) = Bench::new(&stage.scene, 1, &[]) else { return };
    for (name, params) in [("area-gloss", dim()), ("area-matte", ShadeParams { specular: false, ..dim() })] {
        let before = draw(&mut bench, &stage, &params, LookupId::NONE);
        bench.scene.set_area_lights(&bench.gpu, &table(&stage));
        let card = draw(&mut bench, &stage, &params, LookupId::NONE);
        let (twin, gbuffer) = lit_twin(&stage, &params, None);
        assert_agrees(name, &card, &twin, &gbuffer);
        bench.scene.set_area_lights(&bench.gpu, &AreaLightTable::default());
        assert_eq!(draw(&mut bench, &stage, &params, LookupId::NONE), before);
        assert_ne!(card, before);
    }
}

/// An atlas of points so far apart that sees waves of each light, and a bench that has it on its card.
fn dimmed(stage: &Stage, spacing: f32, has_leans: bool) -> Option<(VisibilityAtlas, LightVisibility, Bench)> {
    let layout = lay(&stage.scene, spacing);
    let values = vec![255; layout.len()];
    let mut atlas = VisibilityAtlas::new(layout.clone(), &stage.scene, None, AtlasParams::default());
    while !atlas.work(&stage.scene, &values, usize::MAX).is_complete() {}
    let table = table(stage);
    let lights = table.lights().len() as u32;
    let mut planes = Vec::new();
    for light in 1..=lights {
        for set in layout.sets() {
            planes.extend((0..set.len()).map(|point| {
                // Along x, others for each light.
                let x = set.position_rest(point, layout.quantum_m()).x;
                let wave = libm::sinf(x * 1.3 * light as f32) * 0.5 + 0.5;
                (wave * f32::from(OPEN) + 0.5) as u8
            }));
        }
    }
    let held = LightVisibility::new(&layout, lights, planes).unwrap();
    let held = if has_leans { leaning(held) } else { held };
    atlas.resolve_lights(&held).unwrap();
    let mut bench = Bench::new(&stage.scene, 1, &[])?;
    for instance in atlas.take_ready() {
        bench.scene.set_charts(&bench.gpu, instance, atlas.charts(instance).unwrap()).unwrap();
        bench.scene.set_pages(&bench.gpu, instance, atlas.placements(instance)).unwrap();
    }
    let layers: Vec<_> = (0..atlas.layers()).map(|layer| atlas.texels(layer)).collect();
    bench.scene.upload_atlas(&bench.gpu, atlas.side(), &layers, &[]).unwrap();
    atlas.show_lights(table.lights());
    upload(&mut bench, &mut atlas);
    bench.scene.set_area_lights(&bench.gpu, &table);
    Some((atlas, held, bench))
}

/// Brings what changed onto the card.
fn upload(bench: &mut Bench, atlas: &mut VisibilityAtlas) {
    let dirty = atlas.take_dirty_lights();
    let bands = dirty.iter().map(|b| AtlasBand { layer: b.layer, first_row: b.y.start, end_row: b.y.end });
    let bands: Vec<AtlasBand> = bands.collect();
    let planes: Vec<_> = atlas.light_texels().iter().map(Vec::as_slice).collect();
    bench.scene.upload_lights(&bench.gpu, atlas.side(), &planes, atlas.shows_leans(), &bands).unwrap();
}

#[test]
fn lights_are_dimmed_by_what_points_see_of_them() {
    let stage = stage();
    let Some((mut atlas, held, mut bench)) = dimmed(&stage, 0.12, false) else { return };
    let open = lit_twin(&stage, &dim(), None).0;
    let (twin, gbuffer) = lit_twin(&stage, &dim(), Some(&atlas));
    assert_agrees("area-dimmed", &draw(&mut bench, &stage, &dim(), LookupId::ATLAS), &twin, &gbuffer);
    assert_ne!(open, twin);
    // Only what changed is written, and it is all that changed: half of the points see nothing.
    let points = held.points() as u32;
    let changes: Vec<LightChange> = (0u32..)
        .zip(held.values())
        .filter(|(index, _)| index % points > points / 2)
        .map(|(index, old)| LightChange {
            index,
            old: *old,
            old_lean: held.lean(index as usize),
            ..LightChange::default()
        })
        .collect();
    atlas.apply_lights(&changes);
    upload(&mut bench, &mut atlas);
    let (changed, gbuffer) = lit_twin(&stage, &dim(), Some(&atlas));
    let card = draw(&mut bench, &stage, &dim(), LookupId::ATLAS);
    assert_agrees("area-changed", &card, &changed, &gbuffer);
    assert_ne!(changed, twin);
}

/// The same, and what is half seen lies on another side with every few points.
fn leaning(held: LightVisibility) -> LightVisibility {
    let side = |step: usize| (step % (2 * LEAN_STEPS as usize + 1)) as i8 - LEAN_STEPS;
    let lean = |(i, value): (usize, &u8)| Lean([side(i / 40), side(i / 17)]).of_value(*value);
    let leans = held.values().iter().enumerate().map(lean).collect();
    held.with_leans(leans).unwrap()
}

#[test]
fn highlights_lean_to_what_is_seen_of_a_light() {
    let mut stage = stage();
    for material in &mut stage.scene.materials {
        material.roughness_factor = 0.3;
    }
    let Some((mut atlas, held, mut bench)) = dimmed(&stage, 0.12, true) else { return };
    assert!(atlas.shows_leans());
    let (twin, gbuffer) = lit_twin(&stage, &dim(), Some(&atlas));
    assert_agrees("area-leaning", &draw(&mut bench, &stage, &dim(), LookupId::ATLAS), &twin, &gbuffer);
    // The same shares in the middle of each light: written over the others, and another picture.
    let changes: Vec<LightChange> = (0..held.values().len())
        .map(|index| (index, held.values()[index], held.lean(index)))
        .filter(|(_, _, lean)| *lean != Lean::NONE)
        .map(|(index, old, old_lean)| LightChange {
            index: index as u32,
            old,
            new: old,
            old_lean,
            new_lean: Lean::NONE,
        })
        .collect();
    assert!(changes.len() > 500);
    atlas.apply_lights(&changes);
    upload(&mut bench, &mut atlas);
    let (middle, gbuffer) = lit_twin(&stage, &dim(), Some(&atlas));
    assert_agrees("area-middle", &draw(&mut bench, &stage, &dim(), LookupId::ATLAS), &middle, &gbuffer);
    let differ = middle.pixels.iter().zip(&twin.pixels).filter(|(a, b)| a != b).count();
    assert!(differ > middle.pixels.len() / 50, "{differ}");
}

#[test]
fn triangles_smaller_than_texels_read_one_of_their_vertices() {
    let mut stage = stage();
    // So rough that few triangles share a chart: they would have more texels than there are vertices.
    for (i, position) in stage.scene.meshes[1].positions.iter_mut().enumerate() {
        *position *= 1.0 + 0.1 * (i * i * 7 % 11 % 3) as f32;
    }
    let Some((atlas, _, mut bench)) = dimmed(&stage, 0.4, false) else { return };
    let is_fine = |instance: u32| atlas.charts(instance).is_some_and(|charts| charts.is_per_vertex());
    assert!(is_fine(1), "the ball has texels at its vertices");
    let (twin, gbuffer) = lit_twin(&stage, &dim(), Some(&atlas));
    let card = draw(&mut bench, &stage, &dim(), LookupId::ATLAS);
    save("area-vertices-card", &card);
    save("area-vertices-twin", &twin);
    let difference = compare(&card, &twin, &gbuffer);
    eprintln!("area-vertices: {difference:?}");
    assert!(difference.within > 0.9 && difference.mean < 1.0, "{difference:?}");
    let open = compare(&card, &lit_twin(&stage, &dim(), None).0, &gbuffer);
    assert!(open.mean > 5.0 * difference.mean, "{open:?} {difference:?}");
}
