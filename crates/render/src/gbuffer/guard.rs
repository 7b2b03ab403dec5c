//! A guard band: screen-space methods see a little beyond the picture, so that what stands there blocks, too (\[McGuire2012\] sec. 2 and 4).

use dapple_scene::{Pose, PosedCamera, Projection, Scene};

use super::{GBuffer, MAX_SAMPLES, MAX_SIDE, rasterize};
use crate::RenderError;

/// How many pixels are drawn beyond each side of a picture. [`GuardBand::default`] is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GuardBand {
    pixels: u32,
}

impl GuardBand {
    /// Widest band, as a part of the picture's height.
    pub const MAX_PART: f32 = 0.5;

    /// A band that is a part of the picture's height wide, 0 … [`GuardBand::MAX_PART`], rounded up to whole pixels. The paper's is 0.18: a tenth of the
    /// width of 16 : 9 (\[McGuire2012\] Table 3).
    ///
    /// # Errors
    /// A part out of its range.
    pub fn of_height(part: f32, height: u32) -> Result<GuardBand, RenderError> {
        if !(0.0..=GuardBand::MAX_PART).contains(&part) {
            let (name, range) = ("guard band", "0 to 0.5 of the picture's height");
            return Err(RenderError::Parameter { name, found: part.into(), range });
        }
        Ok(GuardBand { pixels: (f64::from(part) * f64::from(height) - 1e-3).ceil().max(0.0) as u32 })
    }

    /// The same, but no wider than what [`rasterize`] draws of a picture of so many pixels.
    pub fn within(self, [width, height]: [u32; 2], samples_per_axis: u32) -> GuardBand {
        let fits = |pixels: u32| {
            let [columns, rows] = GuardBand { pixels }
                .size([width, height])
                .map(|side| u64::from(side) * u64::from(samples_per_axis));
            let side = u64::from(MAX_SIDE);
            GuardBand { pixels }.size([width, height]).into_iter().all(|pixels| u64::from(pixels) <= side)
                && columns.saturating_mul(rows) <= MAX_SAMPLES
        };
        // Of a range of widths that fit up to some width the last.
        let (mut fitting, mut beyond) = (0, self.pixels + 1);
        while fitting + 1 < beyond {
            let middle = fitting + (beyond - fitting) / 2;
            if fits(middle) { fitting = middle } else { beyond = middle }
        }
        GuardBand { pixels: fitting }
    }

    /// Pixels beyond each side.
    pub fn pixels(self) -> u32 {
        self.pixels
    }

    /// Width and height of what is drawn for a picture of so many pixels.
    pub fn size(self, [width, height]: [u32; 2]) -> [u32; 2] {
        [width, height].map(|side| side.saturating_add(self.pixels.saturating_mul(2)))
    }

    /// Part of what is drawn that lies beyond a picture of so many pixels, 0 … 1.
    pub fn part(self, [width, height]: [u32; 2]) -> f64 {
        let count = |[width, height]: [u32; 2]| f64::from(width) * f64::from(height);
        1.0 - count([width, height]) / count(self.size([width, height])).max(1.0)
    }

    /// The camera that sees the picture and the band: its pixels fall on those of `camera`.
    pub fn camera(self, camera: &PosedCamera, height: u32) -> PosedCamera {
        if self.pixels == 0 {
            return *camera;
        }
        let wider = (f64::from(height) + 2.0 * f64::from(self.pixels)) / f64::from(height.max(1));
        let projection = match camera.projection {
            Projection::Perspective { yfov, near } => {
                let yfov = 2.0 * libm::atan(wider * libm::tan(0.5 * f64::from(yfov)));
                Projection::Perspective { yfov: yfov as f32, near }
            }
            Projection::Orthographic { half_height, near, far } => {
                Projection::Orthographic { half_height: (f64::from(half_height) * wider) as f32, near, far }
            }
        };
        PosedCamera { projection, ..*camera }
    }

    /// Draws what `camera` sees in a picture of so many pixels, and the band around it. What is drawn is that of [`GuardBand::camera`].
    ///
    /// # Errors
    /// As of [`rasterize`], of the larger size.
    pub fn rasterize(
        self,
        scene: &Scene,
        pose: &Pose,
        camera: &PosedCamera,
        size: [u32; 2],
        samples_per_axis: u32,
    ) -> Result<GBuffer, RenderError> {
        let [width, height] = self.size(size);
        rasterize(scene, pose, &self.camera(camera, size[1]), width, height, samples_per_axis)
    }

    /// Of one value a sample of what is drawn those of the picture, row-major from the top.
    ///
    /// # Errors
    /// A list that is not as long as what is drawn for such a picture.
    pub fn crop<T: Copy>(
        self,
        values: &[T],
        size: [u32; 2],
        samples_per_axis: u32,
    ) -> Result<Vec<T>, RenderError> {
        let [columns, rows] = self.size(size).map(|side| side as usize * samples_per_axis as usize);
        RenderError::check_length("values of a picture with its guard band", values.len(), columns * rows)?;
        let band = self.pixels as usize * samples_per_axis as usize;
        let inside = values.chunks(columns.max(1)).skip(band).take(rows - 2 * band);
        Ok(inside.flat_map(|row| &row[band..columns - band]).copied().collect())
    }
}

#[cfg(test)]
mod tests {
    use dapple_scene::glam::{Affine3A, Quat};
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::alchemy::{self, AlchemyParams};
    use crate::gbuffer::Screen;
    use crate::testing::screen::{draw, look, still_life};
    use crate::testing::{Stage, cube, ground};

    #[test]
    fn bands_shrink_to_what_can_be_drawn() {
        let band = GuardBand { pixels: 108 };
        assert_eq!(band.within([1920, 1080], 4), band);
        assert_eq!(band.within([MAX_SIDE, 1080], 1).pixels, 0);
        assert_eq!(band.within([MAX_SIDE - 7, 1080], 1).pixels, 3);
        // 2^28 samples are 2048 × 2048 pixels of 64.
        assert_eq!(GuardBand { pixels: 900 }.within([2000, 2000], 8).pixels, 24);
        assert_eq!(GuardBand { pixels: u32::MAX - 1 }.within([1, 1], 1).pixels, (MAX_SIDE - 1) / 2);
    }

    fn lenses() -> [Projection; 2] {
        [
            Projection::Perspective { yfov: 0.8, near: 0.02 },
            Projection::Orthographic { half_height: 2.0, near: -3.0, far: 20.0 },
        ]
    }

    fn draw_wide(
        stage: &Stage,
        camera: &PosedCamera,
        band: GuardBand,
        size: [u32; 2],
        samples_per_axis: u32,
    ) -> (GBuffer, Screen) {
        let gbuffer = band.rasterize(&stage.scene, &stage.pose, camera, size, samples_per_axis).unwrap();
        let screen = gbuffer.screen(&stage.scene, &stage.pose, &band.camera(camera, size[1])).unwrap();
        (gbuffer, screen)
    }

    #[test]
    fn the_picture_inside_is_the_one_without() {
        let stage = still_life();
        for (projection, part) in lenses().into_iter().flat_map(|p| [0.0, 0.1, 0.5].map(|part| (p, part))) {
            let camera = PosedCamera { projection, ..look(Vec3::new(1.5, 2.0, 3.0), Vec3::ZERO) };
            for (size, n) in [([61, 37], 2), ([33, 64], 1), ([1, 1], 3)] {
                let band = GuardBand::of_height(part, size[1]).unwrap();
                let (wide, wide_screen) = draw_wide(&stage, &camera, band, size, n);
                let narrow = rasterize(&stage.scene, &stage.pose, &camera, size[0], size[1], n).unwrap();
                let screen = narrow.screen(&stage.scene, &stage.pose, &camera).unwrap();
                let inside = band.crop(wide.samples(), size, n).unwrap();
                let distances = band.crop(wide_screen.distances_m(), size, n).unwrap();
                assert_eq!(inside.len(), narrow.samples().len());
                let same = |i: &usize| {
                    let (a, b) = (inside[*i], narrow.samples()[*i]);
                    (a.instance, a.triangle) == (b.instance, b.triangle)
                };
                let other = (0..inside.len()).filter(|i| !same(i)).count();
                // An edge of a triangle may go to the other side of a sample's very middle.
                assert!(other * 1000 <= inside.len(), "{other} of {}", inside.len());
                for i in (0..inside.len()).filter(same) {
                    let (a, b) = (distances[i], screen.distances_m()[i]);
                    assert!(a == b || (a - b).abs() < 2e-5 * b.abs().max(1.0), "{a}, {b}");
                    if part == 0.0 {
                        assert_eq!(inside[i], narrow.samples()[i]);
                    }
                }
                // Lengths on the picture stay what they were.
                let [a, b] = [&wide_screen, &screen].map(|s| s.samples_per_metre(3.0));
                assert!((a / b - 1.0).abs() < 1e-6, "{a}, {b}");
            }
        }
    }

    /// An open ground, seen from above, and a low box just outside to the right of the picture.
    fn beside_a_box(projection: Projection) -> (Stage, PosedCamera) {
        let mut stage = Stage::new();
        stage.add(ground(20.0), 0, Affine3A::IDENTITY);
        let right = match projection {
            Projection::Perspective { .. } => 4.0 * libm::tanf(0.4),
            Projection::Orthographic { half_height, .. } => half_height,
        };
        let place = Affine3A::from_translation(Vec3::new(right + 0.53, 0.15, 0.0));
        stage.add(cube(), 0, place * Affine3A::from_scale(Vec3::new(0.5, 0.15, 4.0)));
        let camera = PosedCamera { projection, ..look(Vec3::new(0.0, 4.0, 0.0), Vec3::ZERO) };
        (stage, camera)
    }

    fn estimate(stage: &Stage, camera: &PosedCamera, part: f32) -> Vec<f32> {
        let size = [96, 96];
        let band = GuardBand::of_height(part, size[1]).unwrap();
        let (_, screen) = draw_wide(stage, camera, band, size, 1);
        let values = alchemy::estimate_visibility(&screen, &AlchemyParams::default()).unwrap();
        band.crop(&values, size, 1).unwrap()
    }

    #[test]
    fn what_stands_beyond_the_picture_darkens_it() {
        for projection in lenses() {
            let (stage, camera) = beside_a_box(projection);
            let (_, screen) = draw(&stage, &camera, [96, 96]);
            let nearest = screen.distances_m().iter().copied().fold(f32::INFINITY, f32::min);
            assert!(nearest > 3.99, "the box is outside: {nearest}");
            let last_columns = |values: &[f32]| {
                let last = values.chunks(96).map(|row| row[92..].iter().sum::<f32>() / 4.0);
                last.sum::<f32>() / 96.0
            };
            let [without, with] = [0.0, 0.2].map(|part| estimate(&stage, &camera, part));
            assert!(last_columns(&without) > 0.99, "{}", last_columns(&without));
            assert!(last_columns(&with) < 0.8, "{}", last_columns(&with));
            // Far from the border nothing is other than noise.
            let middle = |values: &[f32]| values[48 * 96 + 30..48 * 96 + 60].iter().sum::<f32>() / 30.0;
            assert!((middle(&with) - middle(&without)).abs() < 0.01);
        }
    }

    /// A place of the world keeps its visibility while it moves to the picture's edge and what darkens it leaves the picture.
    #[test]
    fn places_keep_their_visibility_in_a_pan() {
        for projection in lenses() {
            let (stage, camera) = beside_a_box(projection);
            let edge = match projection {
                Projection::Perspective { .. } => 4.0 * libm::tanf(0.4),
                Projection::Orthographic { half_height, .. } => half_height,
            };
            // Between the box and the picture's edge.
            let place = Vec3::new(edge - 0.12, 0.0, 0.0);
            let mut seen = [0.0, 0.25].map(|_| Vec::new());
            for step in 0..9 {
                let by = 0.05 * step as f32;
                let mut panned = camera;
                match projection {
                    Projection::Perspective { .. } => {
                        panned.world_from_view *= Affine3A::from_quat(Quat::from_rotation_y(-0.4 * by));
                    }
                    Projection::Orthographic { .. } => panned.world_from_view.translation.x += 2.0 * by,
                }
                let (_, screen) = draw(&stage, &panned, [96, 96]);
                let index = screen.sample_at(panned.view_from_world().transform_point3(place)).unwrap();
                let around = |values: &[f32]| {
                    let (column, row) = (index % 96, index / 96);
                    let at = |c: usize, r: usize| values[r.min(95) * 96 + c.min(95)];
                    let sum: f32 = (0..49).map(|i| at(column + i % 7 - 3, row + i / 7 - 3)).sum();
                    sum / 49.0
                };
                for (seen, part) in seen.iter_mut().zip([0.0, 0.25]) {
                    seen.push(around(&estimate(&stage, &panned, part)));
                }
            }
            let range = |values: &[f32]| {
                let (low, high) = values.iter().fold((1.0f32, 0.0f32), |(l, h), v| (l.min(*v), h.max(*v)));
                high - low
            };
            let [without, with] = &seen;
            assert!(range(with) < 0.06, "{projection:?}: {with:.3?}");
            assert!(range(without) > 0.15, "{projection:?}: {without:.3?}");
        }
    }

    #[test]
    fn bands_out_of_range_are_refused_and_lists_must_fit() {
        for part in [-0.1, 0.51, f32::NAN, f32::INFINITY] {
            assert!(
                GuardBand::of_height(part, 100).unwrap_err().to_string().contains("guard band"),
                "{part}"
            );
        }
        assert_eq!(GuardBand::of_height(0.1, 1080).unwrap().pixels(), 108);
        assert_eq!(GuardBand::of_height(0.1, 3).unwrap().pixels(), 1);
        assert_eq!(GuardBand::default(), GuardBand::of_height(0.0, 7).unwrap());
        let band = GuardBand::of_height(0.5, 4).unwrap();
        assert_eq!(band.size([3, 4]), [7, 8]);
        assert!((band.part([3, 4]) - (1.0 - 12.0 / 56.0)).abs() < 1e-12);
        assert!(band.crop(&[0; 55], [3, 4], 1).is_err());
    }

    proptest! {
        #[test]
        fn crops_are_the_middle(width in 1u32..9, height in 1u32..9, n in 1u32..4, part in 0.0f32..=0.5) {
            let band = GuardBand::of_height(part, height).unwrap();
            let [columns, rows] = band.size([width, height]).map(|side| (side * n) as usize);
            let numbers: Vec<[usize; 2]> = (0..columns * rows).map(|i| [i % columns, i / columns]).collect();
            let inside = band.crop(&numbers, [width, height], n).unwrap();
            let first = (band.pixels() * n) as usize;
            prop_assert_eq!(inside.len(), (width * n * height * n) as usize);
            for (i, at) in inside.iter().enumerate() {
                let (x, y) = (i % (width * n) as usize, i / (width * n) as usize);
                prop_assert_eq!(*at, [first + x, first + y]);
            }
        }
    }
}
