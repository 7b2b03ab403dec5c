//! Where screen space fails: scenes whose visibility rays know, as a method sees them. Each method's folder has the picture of its own failures.

use dapple_scene::PosedCamera;
use dapple_trace::Tracer;
use dapple_trace::rtao::{RtaoParams, Site, trace_visibility};
use glam::{Affine3A, Vec3};

use super::screen::{EstimateShot, Shot, look};
use super::{Stage, check_golden, cube, ground, quad};
use crate::gbuffer::{GBuffer, GuardBand, rasterize};
use crate::image::Rgb8Image;

const SIZE: [u32; 2] = [128, 96];
/// What the strip shows of each picture.
const WINDOW: [u32; 2] = [104, 72];
/// Between pictures of the strip.
const GAP: u32 = 4;
const GRAY: [u8; 3] = [128; 3];
/// Visibility that the strip shows as black.
const BLACK: f32 = 0.5;
const BLUE: [u8; 3] = [60, 130, 240];

/// A scene, a camera, and the place on its first instance that tells.
struct Case {
    stage: Stage,
    camera: PosedCamera,
    /// Guard band, a part of the height.
    guard: f32,
    tells: Box<dyn Fn(Vec3) -> bool>,
    /// The window's left upper corner.
    window: [u32; 2],
}

/// Mean visibility of the places that tell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Means {
    /// A wall around the outline of a plate that hangs farther before it than the radius. The truth is 1.
    pub(crate) halo: f32,
    /// The ground at the picture's edge, a box stands beside it.
    pub(crate) off_screen: f32,
    /// The same with a guard band.
    pub(crate) guarded: f32,
    /// The ground beside a rod above it.
    pub(crate) thin: f32,
    /// The foot of a wall in sight.
    pub(crate) before: f32,
    /// The same when a beam near the eye hides the wall.
    pub(crate) after: f32,
}

/// What a method, or rays, see of all scenes.
pub(crate) struct Seen {
    pub(crate) means: Means,
    windows: Vec<Rgb8Image>,
}

fn place(at: Vec3, half: Vec3) -> Affine3A {
    Affine3A::from_translation(at) * Affine3A::from_scale(half)
}

/// A plate hangs farther before a wall than the radius: the wall is open everywhere.
fn halo() -> Case {
    let mut stage = Stage::new();
    let at = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    stage.add(quad([at(-9.0, -9.0), at(9.0, -9.0), at(9.0, 9.0), at(-9.0, 9.0)]), 0, Affine3A::IDENTITY);
    stage.add(cube(), 0, place(Vec3::new(0.0, 0.0, 0.92), Vec3::new(0.3, 0.3, 0.02)));
    let camera = look(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO);
    // Its outline falls on the wall 0.39 m from the middle.
    let tells = Box::new(|p: Vec3| p.x.abs().max(p.y.abs()) < 0.55);
    Case { stage, camera, guard: 0.0, tells, window: [12, 12] }
}

/// A long box lies beside the picture: what it takes away is missing but with a guard band.
fn off_screen(guard: f32) -> Case {
    let mut stage = Stage::new();
    stage.add(ground(20.0), 0, Affine3A::IDENTITY);
    let camera = look(Vec3::new(0.0, 3.0, 0.001), Vec3::ZERO);
    // The box stands just right of the picture.
    let right = 3.0 * libm::tanf(0.4) * SIZE[0] as f32 / SIZE[1] as f32;
    stage.add(cube(), 0, place(Vec3::new(right + 0.27, 0.4, 0.0), Vec3::new(0.25, 0.4, 9.0)));
    Case { stage, camera, guard, tells: Box::new(move |p: Vec3| p.x > right - 0.2), window: [24, 12] }
}

/// A rod of 2 cm hangs 25 cm over the ground, which it hardly darkens: by (w/2) h / (x² + h²) at a distance x beside it, 2 to 4 %.
fn thin() -> Case {
    let mut stage = Stage::new();
    stage.add(ground(20.0), 0, Affine3A::IDENTITY);
    stage.add(cube(), 0, place(Vec3::new(0.0, 0.25, 0.0), Vec3::new(9.0, 0.01, 0.01)));
    let camera = look(Vec3::new(0.0, 1.6, 0.001), Vec3::ZERO);
    let tells = Box::new(|p: Vec3| (0.03..0.15).contains(&p.z.abs()));
    Case { stage, camera, guard: 0.2, tells, window: [12, 12] }
}

/// A beam passes before a wall and hides it, not the ground at its foot: what the wall blocked comes back.
fn pop_in(is_hidden: bool) -> Case {
    let mut stage = Stage::new();
    stage.add(ground(20.0), 0, Affine3A::IDENTITY);
    stage.add(cube(), 0, place(Vec3::new(-0.1, 0.4, 0.0), Vec3::new(0.1, 0.4, 9.0)));
    let beam_y = if is_hidden { 1.37 } else { 4.0 };
    stage.add(cube(), 0, place(Vec3::new(2.0, beam_y, 0.0), Vec3::new(0.02, 0.24, 9.0)));
    let camera = look(Vec3::new(4.0, 2.2, 0.0), Vec3::new(0.0, 0.3, 0.0));
    let tells = Box::new(|p: Vec3| (0.08..0.25).contains(&p.x) && p.z.abs() < 0.6);
    Case { stage, camera, guard: 0.2, tells, window: [12, 8] }
}

/// In the order of [`Means`], which is that of the strip.
fn cases() -> [Case; 6] {
    [halo(), off_screen(0.0), off_screen(0.3), thin(), pop_in(false), pop_in(true)]
}

impl Case {
    fn gbuffer(&self) -> GBuffer {
        rasterize(&self.stage.scene, &self.stage.pose, &self.camera, SIZE[0], SIZE[1], 1).unwrap()
    }

    /// By a method that sees the guard band, too.
    fn estimated(&self, estimate: EstimateShot<'_>) -> Vec<f32> {
        let Case { stage, camera, .. } = self;
        let band = GuardBand::of_height(self.guard, SIZE[1]).unwrap();
        let gbuffer = band.rasterize(&stage.scene, &stage.pose, camera, SIZE, 1).unwrap();
        let camera = band.camera(camera, SIZE[1]);
        let screen = gbuffer.screen(&stage.scene, &stage.pose, &camera).unwrap();
        let values = estimate(&Shot { stage, camera: &camera, gbuffer: &gbuffer, screen: &screen });
        band.crop(&values, SIZE, 1).unwrap()
    }

    /// By rays, the same at every sample, so that no noise stands in the picture.
    fn traced(&self, gbuffer: &GBuffer) -> Vec<f32> {
        let Case { stage: Stage { scene, pose }, .. } = self;
        let tracer = Tracer::new(scene, pose);
        let surfaces = (0..gbuffer.samples().len()).map(|i| gbuffer.surface(scene, pose, i));
        let sites: Vec<Site> = surfaces
            .map(|surface| match surface {
                Some(s) => Site { position_world: s.position_world, normal_world: s.normal_world, key: 0 },
                None => Site { position_world: Vec3::ZERO, normal_world: Vec3::ZERO, key: 0 },
            })
            .collect();
        let mut values = vec![0.0; sites.len()];
        trace_visibility(&tracer, &sites, &RtaoParams { rays: 1024, ..RtaoParams::default() }, &mut values);
        values
    }

    /// Mean over the samples of the first instance whose place is one that tells.
    fn mean(&self, gbuffer: &GBuffer, values: &[f32]) -> f32 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (i, value) in values.iter().enumerate() {
            let surface = gbuffer.surface(&self.stage.scene, &self.stage.pose, i);
            if surface.is_some_and(|s| s.instance == 0 && (self.tells)(s.position_world)) {
                sum += value;
                count += 1.0;
            }
        }
        assert!(count > 50.0, "{count} samples");
        sum / count
    }

    /// Visibility from [`BLACK`] to 1 as gray; what is not the first instance is half blue.
    fn window(&self, gbuffer: &GBuffer, values: &[f32]) -> Rgb8Image {
        let shown = |index: usize| {
            let shade = (255.0 * (values[index] - BLACK) / (1.0 - BLACK)).round().clamp(0.0, 255.0) as u8;
            match gbuffer.samples()[index].instance {
                0 => [shade; 3],
                _ => BLUE.map(|channel| channel / 2 + shade / 2),
            }
        };
        let [left, top] = self.window;
        let rows = (top..top + WINDOW[1]).flat_map(|y| (left..left + WINDOW[0]).map(move |x| (x, y)));
        let pixels = rows.map(|(x, y)| shown((y * SIZE[0] + x) as usize)).collect();
        Rgb8Image { width: WINDOW[0], height: WINDOW[1], pixels }
    }
}

fn see(values: impl Fn(&Case, &GBuffer) -> Vec<f32>) -> Seen {
    let mut windows = Vec::new();
    let means = cases().map(|case| {
        let gbuffer = case.gbuffer();
        let values = values(&case, &gbuffer);
        windows.push(case.window(&gbuffer, &values));
        case.mean(&gbuffer, &values)
    });
    let [halo, off_screen, guarded, thin, before, after] = means;
    Seen { means: Means { halo, off_screen, guarded, thin, before, after }, windows }
}

/// As rays of the methods' radius see it.
pub(crate) fn truth() -> Seen {
    see(Case::traced)
}

/// As a method sees it.
pub(crate) fn seen_by(estimate: EstimateShot<'_>) -> Seen {
    see(|case, _| case.estimated(estimate))
}

/// A row of pictures for each of some, in the order of [`Means`].
pub(crate) fn strip(rows: &[&Seen]) -> Rgb8Image {
    let columns = cases().len() as u32;
    let width = columns * (WINDOW[0] + GAP) - GAP;
    let height = rows.len() as u32 * (WINDOW[1] + GAP) - GAP;
    let mut pixels = vec![GRAY; (width * height) as usize];
    for (row, seen) in rows.iter().enumerate() {
        for (column, window) in seen.windows.iter().enumerate() {
            let left = column * (WINDOW[0] + GAP) as usize;
            let top = row * (WINDOW[1] + GAP) as usize;
            for (y, line) in window.pixels.chunks(WINDOW[0] as usize).enumerate() {
                let start = (top + y) * width as usize + left;
                pixels[start..start + line.len()].copy_from_slice(line);
            }
        }
    }
    Rgb8Image { width, height, pixels }
}

/// Compares the picture of a single-layer method, rays above it, with its golden one; what all such methods share must hold. Returns the truth's means and its own.
pub(crate) fn check(folder: &str, method: &str, estimate: EstimateShot<'_>) -> [Means; 2] {
    let (truth, seen) = (truth(), seen_by(estimate));
    println!("truth {:.3?}\n{method} {:.3?}", truth.means, seen.means);
    check_golden(folder, &format!("failures-{method}"), &strip(&[&truth, &seen]));
    let (truth, found) = (truth.means, seen.means);
    check_truth(&truth);
    assert!(found.off_screen > 0.985, "{found:?}: what is beyond the picture is missing");
    assert!(found.guarded < 0.88, "{found:?}: a guard band brings it");
    assert!(found.after - found.before > 0.1, "{found:?}: what gets hidden pops out");
    [truth, found]
}

/// Rays neither know of pictures nor of beams a metre and a half away.
fn check_truth(truth: &Means) {
    assert!(truth.halo == 1.0 && (truth.off_screen - truth.guarded).abs() < 1e-6, "{truth:?}");
    assert!((truth.before - truth.after).abs() < 0.01, "{truth:?}");
    assert!((0.955..0.985).contains(&truth.thin), "{truth:?}: 2 to 4 % are blocked");
}
