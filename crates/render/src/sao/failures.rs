//! Where screen space fails: four scenes whose visibility is known, as every method sees them. Their pictures stand in the README.

use dapple_scene::PosedCamera;
use glam::{Affine3A, Vec3};

use crate::compose::view_visibility;
use crate::gbuffer::{GBuffer, GuardBand, Screen, rasterize};
use crate::image::Rgb8Image;
use crate::testing::screen::look;
use crate::testing::{Stage, check_golden, cube, ground, quad};
use crate::{alchemy, gtao, hbao, sao, ssao};

const SIZE: [u32; 2] = [128, 96];

/// A method with its defaults.
type Method = (&'static str, fn(&Screen) -> Vec<f32>);

const METHODS: [Method; 6] = [
    ("ssao", |s| ssao::estimate_visibility(s, &Default::default()).unwrap()),
    ("alchemy", |s| alchemy::estimate_visibility(s, &Default::default()).unwrap()),
    ("sao", |s| sao::estimate_visibility(s, &Default::default()).unwrap()),
    ("hbao", |s| hbao::estimate_visibility(s, &hbao::HbaoParams::hbao()).unwrap()),
    ("hbao-plus", |s| hbao::estimate_visibility(s, &hbao::HbaoParams::hbao_plus()).unwrap()),
    ("gtao", |s| gtao::estimate_visibility(s, &Default::default()).unwrap()),
];

/// A picture with its guard band.
struct Seen {
    gbuffer: GBuffer,
    wide: Screen,
    band: GuardBand,
    /// Where each sample is in the world, and of which instance.
    places: Vec<Option<(u32, Vec3)>>,
}

impl Seen {
    fn new(stage: &Stage, camera: &PosedCamera, guard: f32) -> Seen {
        let gbuffer = rasterize(&stage.scene, &stage.pose, camera, SIZE[0], SIZE[1], 1).unwrap();
        let band = GuardBand::of_height(guard, SIZE[1]).unwrap();
        let wide = band.rasterize(&stage.scene, &stage.pose, camera, SIZE, 1).unwrap();
        let wide = wide.screen(&stage.scene, &stage.pose, &band.camera(camera, SIZE[1])).unwrap();
        let place = |i| gbuffer.surface(&stage.scene, &stage.pose, i).map(|s| (s.instance, s.position_world));
        let places = (0..gbuffer.samples().len()).map(place).collect();
        Seen { gbuffer, wide, band, places }
    }

    fn visibility(&self, method: Method) -> Vec<f32> {
        self.band.crop(&method.1(&self.wide), SIZE, 1).unwrap()
    }

    /// Mean over the samples of the first instance whose place is one that counts.
    fn mean(&self, method: Method, counts: impl Fn(Vec3) -> bool) -> f32 {
        let values = self.visibility(method);
        let (mut sum, mut count) = (0.0, 0.0);
        for (value, place) in values.iter().zip(&self.places) {
            if place.is_some_and(|(instance, place)| instance == 0 && counts(place)) {
                sum += value;
                count += 1.0;
            }
        }
        assert!(count > 50.0, "{count} samples");
        sum / count
    }
}

/// Two pictures of visibility side by side.
fn pair(pictures: [(&Seen, Method); 2]) -> Rgb8Image {
    let [left, right] = pictures
        .map(|(seen, method)| view_visibility(&seen.gbuffer, &seen.visibility(method)).unwrap().pixels);
    let width = SIZE[0] as usize;
    let rows = left.chunks(width).zip(right.chunks(width));
    let gap = [[128, 128, 128]; 4];
    let pixels = rows.flat_map(|(l, r)| l.iter().chain(&gap).chain(r).copied().collect::<Vec<_>>()).collect();
    Rgb8Image { width: 2 * SIZE[0] + 4, height: SIZE[1], pixels }
}

fn of(name: &str) -> Method {
    METHODS.into_iter().find(|method| method.0 == name).unwrap()
}

/// Of every method, in the order of the README's table.
fn all(what: &str, measure: impl Fn(Method) -> f32) -> [f32; 6] {
    let found = METHODS.map(measure);
    println!("{what}: {found:.2?}");
    found
}

fn place(at: Vec3, half: Vec3) -> Affine3A {
    Affine3A::from_translation(at) * Affine3A::from_scale(half)
}

/// A plate hangs farther before a wall than the radius: the wall is open everywhere.
#[test]
fn what_hangs_far_in_front_darkens_in_a_halo() {
    let mut stage = Stage::new();
    let at = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    stage.add(quad([at(-9.0, -9.0), at(9.0, -9.0), at(9.0, 9.0), at(-9.0, 9.0)]), 0, Affine3A::IDENTITY);
    stage.add(cube(), 0, place(Vec3::new(0.0, 0.0, 0.92), Vec3::new(0.3, 0.3, 0.02)));
    let seen = Seen::new(&stage, &look(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO), 0.0);
    // Its outline falls on the wall 0.39 m from the middle.
    let near = |p: Vec3| p.x.abs().max(p.y.abs()) < 0.55;
    let found = all("halo, truth 1", |method| seen.mean(method, near));
    let [ssao, alchemy, sao, hbao, hbao_plus, gtao] = found;
    assert!(sao < 0.93 && alchemy < 0.93, "no end at the radius: {found:?}");
    assert!([ssao, hbao, hbao_plus, gtao].iter().all(|v| *v > 0.96), "an end at the radius: {found:?}");
    check_golden("sao", "failure-halo", &pair([(&seen, of("sao")), (&seen, of("gtao"))]));
}

/// A long box lies beside the picture: its light is missing with a guard band alone.
#[test]
fn what_is_beyond_the_picture_is_missing() {
    let mut stage = Stage::new();
    stage.add(ground(20.0), 0, Affine3A::IDENTITY);
    let camera = look(Vec3::new(0.0, 3.0, 0.001), Vec3::ZERO);
    // The box stands just right of the picture.
    let right = 3.0 * libm::tanf(0.4) * SIZE[0] as f32 / SIZE[1] as f32;
    stage.add(cube(), 0, place(Vec3::new(right + 0.27, 0.4, 0.0), Vec3::new(0.25, 0.4, 9.0)));
    let edge = |p: Vec3| p.x > right - 0.2;
    let [without, with] = [0.0, 0.3].map(|guard| Seen::new(&stage, &camera, guard));
    let missed = all("off the picture, without", |method| without.mean(method, edge));
    let found = all("off the picture, with", |method| with.mean(method, edge));
    for (missed, found) in missed.iter().zip(&found) {
        assert!(*missed > 0.985 && *found < 0.88, "{missed}, {found}");
    }
    check_golden("sao", "failure-off-screen", &pair([(&without, of("sao")), (&with, of("sao"))]));
}

/// A rod of 2 cm hangs 25 cm over the ground, which it hardly darkens: by (w/2) h / (x² + h²) at a distance x beside it, 2 to 4 %.
#[test]
fn thin_things_darken_like_thick_ones() {
    let mut stage = Stage::new();
    stage.add(ground(20.0), 0, Affine3A::IDENTITY);
    stage.add(cube(), 0, place(Vec3::new(0.0, 0.25, 0.0), Vec3::new(9.0, 0.01, 0.01)));
    let seen = Seen::new(&stage, &look(Vec3::new(0.0, 1.6, 0.001), Vec3::ZERO), 0.2);
    let beside = |p: Vec3| (0.03..0.15).contains(&p.z.abs());
    let found = all("thin, truth 0.97", |method| seen.mean(method, beside));
    let [_, _, _, hbao, _, gtao] = found;
    assert!(hbao < 0.9, "all under the horizon is taken for solid: {found:?}");
    assert!(gtao < 0.92, "as thick as half of the radius: {found:?}");
    let mut picture = pair([(&seen, of("sao")), (&seen, of("hbao"))]);
    // Rows in the middle: there is nothing in the others.
    picture.pixels = picture.pixels[24 * picture.width as usize..][..48 * picture.width as usize].to_vec();
    picture.height = 48;
    check_golden("sao", "failure-thin", &picture);
}

/// A beam passes before a wall and hides it, not the ground at its foot: what the wall blocked comes back.
#[test]
fn what_gets_hidden_pops_out() {
    let scene = |beam_y: f32| {
        let mut stage = Stage::new();
        stage.add(ground(20.0), 0, Affine3A::IDENTITY);
        stage.add(cube(), 0, place(Vec3::new(-0.1, 0.4, 0.0), Vec3::new(0.1, 0.4, 9.0)));
        stage.add(cube(), 0, place(Vec3::new(2.0, beam_y, 0.0), Vec3::new(0.02, 0.24, 9.0)));
        stage
    };
    let camera = look(Vec3::new(4.0, 2.2, 0.0), Vec3::new(0.0, 0.3, 0.0));
    let foot = |p: Vec3| (0.08..0.25).contains(&p.x) && p.z.abs() < 0.6;
    let [before, after] = [4.0, 1.37].map(|beam_y| Seen::new(&scene(beam_y), &camera, 0.2));
    let dark = all("pop-in, before", |method| before.mean(method, foot));
    let light = all("pop-in, after", |method| after.mean(method, foot));
    for (dark, light) in dark.iter().zip(&light) {
        assert!(light - dark > 0.1, "{dark}, {light}");
    }
    check_golden("sao", "failure-pop-in", &pair([(&before, of("sao")), (&after, of("sao"))]));
}
