//! The atlas: charts of real meshes, values that a function of the place gives, and what the picture shows of them.

use std::sync::Arc;

use dapple_scene::{PosedCamera, Projection};
use dapple_store::charts::{Atlas, ChartParams, ChartSet, Placement};
use glam::{Affine3A, Vec3};

use super::super::{AtlasBand, FrameInputs, LookupId, Rect, View, ViewKind};
use super::harness::{Bench, inputs, save};
use crate::gbuffer::{GBuffer, rasterize};
use crate::image::Rgb8Image;
use crate::projection;
use crate::shade::ShadeParams;
use crate::testing::{Stage, cube, ground, sphere, turned};

const SIZE: (u32, u32) = (240, 160);

/// Old and new value of a place at rest.
fn value(p: Vec3) -> [u8; 2] {
    let wave = |f: f32| (libm::sinf(f) * 0.5 + 0.5) * 255.0;
    [wave(p.x * 2.0 + p.y * 3.0) as u8, wave(p.z * 2.5 - p.y) as u8]
}

/// A scene with the charts of its instances, and an atlas of their values.
struct Charted {
    stage: Stage,
    charts: Vec<Arc<ChartSet>>,
    places: Vec<Vec<Placement>>,
    side: usize,
    layers: Vec<Vec<[u8; 2]>>,
}

impl Charted {
    fn new(side: u16, texel_m: f32) -> Charted {
        let mut stage = Stage::new();
        stage.add(ground(3.0), 0, Affine3A::IDENTITY);
        let ball = stage.add(sphere(24, 48), 0, Affine3A::from_translation(Vec3::new(-0.9, 1.0, 0.2)));
        let second =
            Affine3A::from_translation(Vec3::new(-1.0, 0.6, 2.0)) * Affine3A::from_scale(Vec3::splat(0.5));
        stage.add(sphere(24, 48), 0, second);
        // The same mesh again, at the same scale.
        stage.scene.instances[2].mesh = stage.scene.instances[ball as usize].mesh;
        stage.scene.instances[2].rest_from_mesh = stage.scene.instances[ball as usize].rest_from_mesh;
        stage.add(cube(), 0, turned(0.7, Vec3::new(1.6, 1.3, -0.4)));
        // Mirrored, and stretched.
        let odd = Affine3A::from_scale(Vec3::new(-0.4, 0.7, 0.5));
        stage.add(cube(), 0, Affine3A::from_translation(Vec3::new(0.6, 0.7, 2.0)) * odd);
        let mut atlas = Atlas::new(side, 64);
        let mut charted =
            Charted { stage, charts: Vec::new(), places: Vec::new(), side: side.into(), layers: Vec::new() };
        for i in 0..charted.stage.scene.instances.len() {
            let instance = &charted.stage.scene.instances[i];
            let mesh = &charted.stage.scene.meshes[instance.mesh as usize];
            let rest: Vec<Vec3> = mesh.positions.iter().map(|&p| instance.rest_from_mesh * p).collect();
            let params =
                ChartParams { max_side: side.min(1024), ..ChartParams::for_spacing(texel_m / 0.75, false) };
            let set = match i {
                2 => charted.charts[1].clone(),
                _ => Arc::new(ChartSet::new(&rest, &mesh.triangles, &params).unwrap()),
            };
            let places = atlas.insert(set.pages()).unwrap();
            charted.layers.resize(usize::from(atlas.layers()), vec![[255; 2]; charted.side * charted.side]);
            for site in set.sites(&rest, &mesh.triangles) {
                let (page, x, y) = set.locate(site.texel);
                let place = places[usize::from(page)];
                let at = usize::from(place.y + y) * charted.side + usize::from(place.x + x);
                charted.layers[usize::from(place.layer)][at] = value(site.position_rest);
            }
            charted.charts.push(set);
            charted.places.push(places);
        }
        charted
    }

    fn upload(&self, bench: &mut Bench) {
        for (i, (charts, places)) in self.charts.iter().zip(&self.places).enumerate() {
            bench.scene.set_charts(&bench.gpu, i as u32, charts).unwrap();
            bench.scene.set_pages(&bench.gpu, i as u32, places).unwrap();
        }
        self.upload_bands(bench, &[]);
    }

    fn upload_bands(&self, bench: &mut Bench, bands: &[AtlasBand]) {
        let layers: Vec<&[[u8; 2]]> = self.layers.iter().map(Vec::as_slice).collect();
        bench.scene.upload_atlas(&bench.gpu, self.side as u32, &layers, bands).unwrap();
    }

    /// What a sample reads, by hand.
    fn visibility(&self, gbuffer: &GBuffer, sample: usize, fade: f32) -> Option<f32> {
        let s = gbuffer.samples().get(sample).filter(|s| s.is_covered())?;
        let charts = &self.charts[s.instance as usize];
        let texel = |page: u16, x: f32, y: f32| {
            let place = self.places[s.instance as usize][usize::from(page)];
            let at = (usize::from(place.y) + y as usize) * self.side + usize::from(place.x) + x as usize;
            let [old, new] = self.layers[usize::from(place.layer)][at].map(f32::from);
            (old + (new - old) * fade) / 255.0
        };
        if charts.is_per_vertex() {
            let [b, c] = s.barycentrics;
            let values = charts
                .corner_uv_of(s.triangle as usize)
                .map(|uv| texel(uv.page, f32::from(uv.x / 32), f32::from(uv.y / 32)));
            return Some(values[0] * (1.0 - b - c) + values[1] * b + values[2] * c);
        }
        let (page, x, y) = charts.texel_at(s.triangle as usize, s.barycentrics);
        let size = charts.pages()[usize::from(page)];
        let (x, y) = (x - 0.5, y - 0.5);
        let clamp = |t: f32, extent: u16| t.clamp(0.0, f32::from(extent) - 1.0);
        let at = |dx: f32, dy: f32| {
            texel(page, clamp(x.floor() + dx, size.width), clamp(y.floor() + dy, size.height))
        };
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let row = |dy| at(0.0, dy) + (at(1.0, dy) - at(0.0, dy)) * fx;
        Some(row(0.0) + (row(1.0) - row(0.0)) * fy)
    }
}

fn camera() -> PosedCamera {
    PosedCamera::look_at(Vec3::new(2.5, 3.0, 4.5), Vec3::new(0.0, 0.6, 0.3), 0.8)
}

fn draw(bench: &mut Bench, charted: &Charted, kind: ViewKind, fade: f32) -> Rgb8Image {
    draw_from(bench, charted, &[View { kind, ..View::new(camera(), LookupId::ATLAS) }], fade)
}

fn draw_from(bench: &mut Bench, charted: &Charted, views: &[View<'_>], fade: f32) -> Rgb8Image {
    let params = ShadeParams::default();
    let inputs = FrameInputs { fade, ..inputs(&charted.stage.pose, &params, views) };
    bench.draw(SIZE, &inputs)
}

/// Fails unless nearly all covered samples show what reading by hand gives.
fn check(name: &str, bench: &mut Bench, charted: &Charted, fade: f32) {
    let picture = draw(bench, charted, ViewKind::Visibility, fade);
    check_picture(name, &picture, charted, &camera(), fade);
}

fn check_picture(name: &str, picture: &Rgb8Image, charted: &Charted, camera: &PosedCamera, fade: f32) {
    save(name, picture);
    let (width, height) = (picture.width, picture.height);
    let gbuffer = rasterize(&charted.stage.scene, &charted.stage.pose, camera, width, height, 1).unwrap();
    let (mut covered, mut near, mut sum) = (0, 0, 0.0);
    for (i, pixel) in picture.pixels.iter().enumerate() {
        if let Some(expected) = charted.visibility(&gbuffer, i, fade) {
            let error = (f32::from(pixel[0]) - expected * 255.0).abs();
            covered += 1;
            near += usize::from(error <= 2.0);
            sum += error.min(32.0);
        }
    }
    let (near, mean) = (near as f32 / covered as f32, sum / covered as f32);
    eprintln!("{name}: {covered} samples, {near} within 2 codes, mean {mean}");
    assert!(covered > 10_000 && near > 0.985 && mean < 0.6, "{name}: {near} of {covered}, mean {mean}");
}

#[test]
fn a_fragment_reads_its_texels() {
    let charted = Charted::new(128, 0.06);
    assert!(charted.layers.len() > 1, "more than one layer is tested");
    let Some(mut bench) = Bench::new(&charted.stage.scene, 1, &[]) else { return };
    let open = draw(&mut bench, &charted, ViewKind::Visibility, 1.0);
    assert!(
        open.pixels.iter().all(|&p| p == [255; 3] || p == crate::compose::BACKGROUND_RGB8),
        "open before charts"
    );
    let meshes = bench.scene.meshes.len();
    charted.upload(&mut bench);
    assert_eq!(bench.scene.meshes.len(), meshes + 4, "instances with the same charts share vertices");
    for (name, fade) in [("atlas-old", 0.0), ("atlas-half", 0.5), ("atlas-new", 1.0)] {
        check(name, &mut bench, &charted, fade);
    }
}

#[test]
fn parallel_cameras_read_the_same_texels() {
    let charted = Charted::new(128, 0.06);
    let Some(mut bench) = Bench::new(&charted.stage.scene, 1, &[]) else { return };
    charted.upload(&mut bench);
    let projection = Projection::Orthographic { half_height: 2.2, near: 0.1, far: 30.0 };
    let camera = PosedCamera { projection, ..camera() };
    let view = View { kind: ViewKind::Visibility, ..View::new(camera, LookupId::ATLAS) };
    let picture = draw_from(&mut bench, &charted, &[view], 0.5);
    check_picture("atlas-parallel", &picture, &charted, &camera, 0.5);
}

#[test]
fn both_eyes_see_the_same_visibility_at_the_same_place() {
    let charted = Charted::new(128, 0.06);
    let Some(mut bench) = Bench::new(&charted.stage.scene, 1, &[]) else { return };
    charted.upload(&mut bench);
    let eyes = [-0.032, 0.032].map(|x| {
        let mut eye = camera();
        eye.world_from_view *= Affine3A::from_translation(Vec3::new(x, 0.0, 0.0));
        eye
    });
    let (width, height) = (SIZE.0, SIZE.1);
    let view = |i: usize| View {
        kind: ViewKind::Visibility,
        viewport: Some(Rect { x: i as u32 * width, y: 0, width, height }),
        ..View::new(eyes[i], LookupId::ATLAS)
    };
    let params = ShadeParams::default();
    let views = [view(0), view(1)];
    let inputs = FrameInputs { fade: 0.5, ..inputs(&charted.stage.pose, &params, &views) };
    let pair = bench.draw((2 * width, height), &inputs);
    save("atlas-stereo", &pair);
    let scene = &charted.stage.scene;
    let [left, right] =
        eyes.map(|eye| rasterize(scene, &charted.stage.pose, &eye, width, height, 1).expect("it draws"));
    let clip_from_world = projection::clip_from_world(&eyes[1], width, height).expect("a sound camera");
    let (mut seen, mut near, mut moved) = (0, 0, 0);
    for (i, sample) in left.samples().iter().enumerate().filter(|(_, s)| s.is_covered()) {
        let mesh = &scene.meshes[scene.instances[sample.instance as usize].mesh as usize];
        let corners = mesh.triangles[sample.triangle as usize].map(|v| mesh.positions[v as usize]);
        let [b, c] = sample.barycentrics;
        let place_mesh = corners[0] * (1.0 - b - c) + corners[1] * b + corners[2] * c;
        let pose = &charted.stage.pose.instances[sample.instance as usize];
        let clip = clip_from_world * pose.world_from_mesh.transform_point3(place_mesh).as_dvec3().extend(1.0);
        let x = ((clip.x / clip.w + 1.0) * 0.5 * f64::from(width)).floor();
        let y = ((1.0 - clip.y / clip.w) * 0.5 * f64::from(height)).floor();
        if x < 0.0 || y < 0.0 || x >= f64::from(width) || y >= f64::from(height) {
            continue;
        }
        let (x, y) = (x as usize, y as usize);
        let other = &right.samples()[y * width as usize + x];
        if (other.instance, other.triangle) != (sample.instance, sample.triangle) {
            continue;
        }
        let (row, column) = (i / width as usize, i % width as usize);
        let at = |x: usize, y: usize| pair.pixels[y * 2 * width as usize + x][0];
        let difference = at(column, row).abs_diff(at(width as usize + x, y));
        seen += 1;
        moved += usize::from(x != column);
        // The pixel's middle lies up to half a pixel beside the place.
        near += usize::from(difference <= 6);
    }
    let (near, moved) = (near as f32 / seen as f32, moved as f32 / seen as f32);
    assert!(seen > 5000 && moved > 0.5, "{seen} places seen by both eyes, {moved} of them elsewhere");
    assert!(near > 0.95, "{near} of {seen} places look alike to both eyes");
}

#[test]
fn fine_meshes_read_at_their_vertices() {
    let mut charted = Charted::new(512, 0.06);
    // Charts of one triangle each would be more than there are vertices.
    let mesh = &charted.stage.scene.meshes[1];
    let rest: Vec<Vec3> = mesh.positions.clone();
    let params = ChartParams { least_cosine: 1.0, ..ChartParams::for_spacing(1.0, false) };
    let set = Arc::new(ChartSet::new(&rest, &mesh.triangles, &params).unwrap());
    assert!(set.is_per_vertex(), "the test needs a mesh finer than texels");
    let sites = set.sites(&rest, &mesh.triangles);
    let mut atlas = Atlas::new(512, 8);
    for i in 0..charted.charts.len() {
        if i == 1 || i == 2 {
            charted.charts[i] = set.clone();
        }
        charted.places[i] = atlas.insert(charted.charts[i].pages()).unwrap();
    }
    charted.layers = vec![vec![[255; 2]; 512 * 512]; usize::from(atlas.layers())];
    for i in 0..charted.charts.len() {
        let instance = &charted.stage.scene.instances[i];
        let mesh = &charted.stage.scene.meshes[instance.mesh as usize];
        let rest: Vec<Vec3> = mesh.positions.iter().map(|&p| instance.rest_from_mesh * p).collect();
        let found =
            if i == 1 || i == 2 { sites.clone() } else { charted.charts[i].sites(&rest, &mesh.triangles) };
        for site in found {
            let (page, x, y) = charted.charts[i].locate(site.texel);
            let place = charted.places[i][usize::from(page)];
            let at = usize::from(place.y + y) * 512 + usize::from(place.x + x);
            charted.layers[usize::from(place.layer)][at] = value(site.position_rest);
        }
    }
    let Some(mut bench) = Bench::new(&charted.stage.scene, 1, &[]) else { return };
    charted.upload(&mut bench);
    check("atlas-per-vertex", &mut bench, &charted, 0.7);
}

#[test]
fn only_dirty_bands_are_written_and_layers_grow() {
    let mut charted = Charted::new(256, 0.06);
    let Some(mut bench) = Bench::new(&charted.stage.scene, 1, &[]) else { return };
    charted.upload(&mut bench);
    for texel in charted.layers.iter_mut().flatten() {
        *texel = texel.map(|c| 255 - c);
    }
    let stale = draw(&mut bench, &charted, ViewKind::Visibility, 1.0);
    let last = charted.layers.len() as u32 - 1;
    let mut bands: Vec<AtlasBand> =
        (0..last).map(|layer| AtlasBand { layer, first_row: 0, end_row: 256 }).collect();
    // In two pieces, and rows that are not there.
    bands.push(AtlasBand { layer: last, first_row: 0, end_row: 100 });
    charted.upload_bands(&mut bench, &bands);
    assert_ne!(stale, draw(&mut bench, &charted, ViewKind::Visibility, 1.0));
    charted.upload_bands(
        &mut bench,
        &[
            AtlasBand { layer: last, first_row: 100, end_row: 9999 },
            AtlasBand { layer: 99, first_row: 0, end_row: 1 },
        ],
    );
    check("atlas-bands", &mut bench, &charted, 1.0);
    for _ in 0..6 {
        charted.layers.push(vec![[0; 2]; 256 * 256]);
        charted.upload_bands(&mut bench, &[]);
    }
    check("atlas-grown", &mut bench, &charted, 1.0);
    let error = bench.scene.upload_atlas(&bench.gpu, 256, &[&[[0; 2]; 7]], &[]).unwrap_err().to_string();
    assert!(error.contains('7'), "{error}");
    assert!(bench.scene.upload_atlas(&bench.gpu, 1 << 20, &[], &[]).is_err());
    let other = charted.charts[0].clone();
    assert!(bench.scene.set_charts(&bench.gpu, 1, &other).is_err(), "charts of another mesh");
    assert!(bench.scene.set_charts(&bench.gpu, 44, &other).is_err());
    assert!(bench.scene.set_pages(&bench.gpu, 44, &[]).is_err());
    bench.scene.set_pages(&bench.gpu, 0, &[]).unwrap();
    let floor_is_open = draw(&mut bench, &charted, ViewKind::Visibility, 1.0);
    assert_eq!(floor_is_open.pixels[(SIZE.1 as usize - 8) * SIZE.0 as usize + 120], [255; 3]);
}

#[test]
fn views_of_the_atlas_can_be_told_apart() {
    let charted = Charted::new(256, 0.12);
    let Some(mut bench) = Bench::new(&charted.stage.scene, 1, &[]) else { return };
    charted.upload(&mut bench);
    let inspected: Vec<Vec<[u8; 2]>> =
        charted.layers.iter().map(|layer| layer.iter().map(|t| [t[0] / 32, t[1]]).collect()).collect();
    let layers: Vec<&[[u8; 2]]> = inspected.iter().map(Vec::as_slice).collect();
    bench.scene.upload_inspection(&bench.gpu, 256, &layers, &[]).unwrap();
    let mut pictures = Vec::new();
    for (name, kind) in [
        ("view-texels", ViewKind::Texels),
        ("view-weights", ViewKind::Weights),
        ("view-age", ViewKind::Age),
        ("view-atlas-beauty", ViewKind::Beauty),
        ("view-error", ViewKind::Error { other: LookupId::NONE }),
    ] {
        let picture = draw(&mut bench, &charted, kind, 1.0);
        save(name, &picture);
        let mut colors = picture.pixels.clone();
        colors.sort_unstable();
        colors.dedup();
        assert!(colors.len() > 8, "{name} has {} colours", colors.len());
        assert!(!pictures.contains(&picture), "{name}");
        pictures.push(picture);
    }
    // Two views of an error share a picture and leave each other alone.
    let params = ShadeParams::default();
    let half = |x| {
        let scissor = Some(Rect { x, y: 0, width: SIZE.0 / 2, height: SIZE.1 });
        let kind = ViewKind::Error { other: LookupId::NONE };
        View { kind, scissor, ..View::new(camera(), LookupId::ATLAS) }
    };
    let views = [half(0), half(SIZE.0 / 2)];
    let halves = bench.draw(SIZE, &inputs(&charted.stage.pose, &params, &views));
    assert!(pictures.last() == Some(&halves), "the halves of the last picture");
    // The error of a look-up against itself is nothing.
    let none = draw(&mut bench, &charted, ViewKind::Error { other: LookupId::ATLAS }, 1.0);
    let nothing = [8, 8, 12];
    assert!(none.pixels.iter().all(|&p| p == nothing || p == crate::compose::BACKGROUND_RGB8));
    assert!(none.pixels.contains(&nothing));
}
