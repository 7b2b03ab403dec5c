//! What screen-space methods see of a G-buffer: distance and normal of each sample, in the camera's view space.

use dapple_scene::{Pose, PosedCamera, Projection, Scene};
use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::{GBuffer, Sample};
use crate::{RenderError, projection};

/// Distance and normal of every sample, and the lens that brings samples back to places. View space: right-handed, x right,
/// y up, the camera at the origin looks along −z; metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Screen {
    columns: u32,
    rows: u32,
    /// The picture's width and height in samples: less than columns and rows where the last ones reach beyond it.
    span: [f32; 2],
    /// The point of the picture that each sample is of; empty where that is the middle of its square.
    centres: Vec<[f32; 2]>,
    lens: Lens,
    distances_m: Vec<f32>,
    normals_view: Vec<Vec3>,
}

/// How view space falls on the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lens {
    /// Half the picture's width and height: at distance 1 for a perspective, anywhere for a parallel camera.
    half_extent: [f32; 2],
    is_perspective: bool,
}

impl GBuffer {
    /// Distance of each sample along the view axis, metres, row-major from the top; infinite for the background. What a method that needs no normals is given:
    /// \[McGuire2012\] eq. 2. `camera` must be the one that was drawn.
    pub fn distances_m(&self, camera: &PosedCamera) -> Vec<f32> {
        let distance = |sample: &Sample| match sample.is_covered() {
            true => projection::view_distance(&camera.projection, sample.depth),
            false => f32::INFINITY,
        };
        self.samples.par_iter().with_min_len(1024).map(distance).collect()
    }

    /// Distances and normals for screen-space methods. `scene`, `pose` and `camera` must be those that were drawn.
    ///
    /// Normals are those of the posed triangles, as the ray-traced truth uses them, not interpolated or mapped ones.
    ///
    /// # Errors
    /// A camera that cannot project.
    pub fn screen(&self, scene: &Scene, pose: &Pose, camera: &PosedCamera) -> Result<Screen, RenderError> {
        projection::clip_from_world(camera, self.width, self.height)?;
        let lens = Lens::new(&camera.projection, f64::from(self.width) / f64::from(self.height));
        // Normals go to view space by the transpose of the way back.
        let view_from_world = Mat3::from(camera.world_from_view.matrix3).transpose();
        let (distances_m, normals_view) = (0..self.samples.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| match self.normal_world(scene, pose, i) {
                None => (f32::INFINITY, Vec3::ZERO),
                Some(normal) => (
                    projection::view_distance(&camera.projection, self.samples[i].depth),
                    (view_from_world * normal).normalize_or_zero(),
                ),
            })
            .unzip();
        Ok(Screen {
            columns: self.width_samples(),
            rows: self.height_samples(),
            span: [self.width_samples() as f32, self.height_samples() as f32],
            centres: Vec::new(),
            lens,
            distances_m,
            normals_view,
        })
    }
}

impl Lens {
    pub(super) fn new(projection: &Projection, aspect: f64) -> Lens {
        let (half_height, is_perspective) = match *projection {
            Projection::Perspective { yfov, .. } => (libm::tan(0.5 * f64::from(yfov)), true),
            Projection::Orthographic { half_height, .. } => (f64::from(half_height), false),
        };
        Lens { half_extent: [(half_height * aspect) as f32, half_height as f32], is_perspective }
    }
}

impl Screen {
    /// A picture of which distances are known and normals are not: they are zero.
    pub(super) fn without_normals(lens: Lens, columns: u32, distances_m: Vec<f32>) -> Screen {
        let rows = (distances_m.len() / columns as usize) as u32;
        let normals_view = vec![Vec3::ZERO; distances_m.len()];
        let span = [columns as f32, rows as f32];
        Screen { columns, rows, span, centres: Vec::new(), lens, distances_m, normals_view }
    }

    /// A picture on which nothing is seen.
    pub(crate) fn of_nothing(camera: &PosedCamera, [columns, rows]: [u32; 2]) -> Screen {
        let lens = Lens::new(&camera.projection, f64::from(columns) / f64::from(rows));
        Screen::without_normals(lens, columns, vec![f32::INFINITY; columns as usize * rows as usize])
    }

    /// Samples in a row.
    pub fn columns(&self) -> u32 {
        self.columns
    }

    /// Rows of samples.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Distance of each sample along the view axis, metres, row-major from the top; infinite for the background. Negative only
    /// for a parallel camera whose near plane lies behind it.
    pub fn distances_m(&self) -> &[f32] {
        &self.distances_m
    }

    /// Unit normal of each sample in view space, on the viewer's side; zero for the background.
    pub fn normals_view(&self) -> &[Vec3] {
        &self.normals_view
    }

    /// The place that a sample sees, at the sample's centre; `None` for the background and for an index that is out of range.
    pub fn position_view(&self, sample_index: usize) -> Option<Vec3> {
        self.position_at([sample_index % self.columns as usize, sample_index / self.columns as usize])
    }

    /// The point of the picture that the sample in a column and row is of, as of [`Screen::place_view`]: the middle of its square, but not in a
    /// [`Screen::half`]. The sample must be in the picture.
    pub fn centre(&self, [column, row]: [usize; 2]) -> [f32; 2] {
        match self.is_half() {
            false => [column as f32 + 0.5, row as f32 + 0.5],
            true => self.centres[row * self.columns as usize + column],
        }
    }

    /// The place at a distance that a point of the picture shows. Coordinates count samples: the first one's centre is at (0.5, 0.5).
    pub fn place_view(&self, column: f32, row: f32, distance_m: f32) -> Vec3 {
        self.places_view(column, row)(distance_m)
    }

    /// [`Screen::place_view`] of a point of the picture, by distance: for several places that it shows.
    pub(crate) fn places_view(&self, column: f32, row: f32) -> impl Fn(f32) -> Vec3 + use<> {
        let x = 2.0 * column / self.span[0] - 1.0;
        let y = 1.0 - 2.0 * row / self.span[1];
        let is_perspective = self.lens.is_perspective;
        let [half_width, half_height] = self.lens.half_extent;
        let (across, up) = (x * half_width, y * half_height);
        move |distance_m| {
            let scale = if is_perspective { distance_m } else { 1.0 };
            Vec3::new(across * scale, up * scale, -distance_m)
        }
    }

    /// Where what a point of the picture shows meets the plane through a place with a normal; `None` if it does not, or behind the camera. Coordinates as of
    /// [`Screen::place_view`].
    pub fn on_plane(&self, column: f32, row: f32, place_view: Vec3, normal_view: Vec3) -> Option<Vec3> {
        let (origin, ray) = if self.lens.is_perspective {
            (Vec3::ZERO, self.place_view(column, row, 1.0))
        } else {
            (self.place_view(column, row, 0.0), Vec3::NEG_Z)
        };
        let along = normal_view.dot(place_view - origin) / normal_view.dot(ray);
        let is_before = along.is_finite() && (along > 0.0 || !self.lens.is_perspective);
        is_before.then(|| origin + ray * along)
    }

    /// A value for each sample, row-major from the top, by its column and row; in parallel by rows in the caller's rayon pool.
    pub fn map(&self, value: impl Fn([usize; 2]) -> f32 + Sync) -> Vec<f32> {
        let columns = self.columns as usize;
        let mut values = vec![0.0; self.distances_m.len()];
        values.par_chunks_mut(columns).enumerate().for_each(|(row, values)| {
            for (column, out) in values.iter_mut().enumerate() {
                *out = value([column, row]);
            }
        });
        values
    }

    /// A screen of a quarter of the samples: of each square of 2 × 2 one, another in each row and column (\[McGuire2012\] Table 1, rotated grid). Distances,
    /// normals and places are true ones; [`Screen::centre`] says where in its square a sample lies.
    pub fn half(&self) -> Screen {
        let (columns, rows) = (self.columns.div_ceil(2), self.rows.div_ceil(2));
        let sources: Vec<usize> = half_sources(self.columns, self.rows).collect();
        let centre = |&i: &usize| {
            self.centre([i % self.columns as usize, i / self.columns as usize]).map(|at| 0.5 * at)
        };
        Screen {
            columns,
            rows,
            span: self.span.map(|side| 0.5 * side),
            centres: sources.iter().map(centre).collect(),
            lens: self.lens,
            distances_m: sources.iter().map(|&i| self.distances_m[i]).collect(),
            normals_view: sources.iter().map(|&i| self.normals_view[i]).collect(),
        }
    }

    /// Whether it is a [`Screen::half`] of another.
    pub(crate) fn is_half(&self) -> bool {
        !self.centres.is_empty()
    }

    /// The sample that lies so many to the right and down of another's centre; `None` outside of the picture.
    pub fn neighbour(&self, at: [usize; 2], by: [f32; 2]) -> Option<[usize; 2]> {
        let [column, row] = self.centre(at);
        self.sample_in([column + by[0], row + by[1]])
    }

    /// The sample that a point of the picture lies in; `None` outside of the picture. Coordinates as of [`Screen::place_view`].
    pub fn sample_in(&self, [column, row]: [f32; 2]) -> Option<[usize; 2]> {
        // Not a number is outside, too.
        let inside = column >= 0.0 && column < self.span[0] && row >= 0.0 && row < self.span[1];
        inside.then_some([column as usize, row as usize])
    }

    /// The place that the sample in a column and row sees; `None` for the background.
    pub fn position_at(&self, [column, row]: [usize; 2]) -> Option<Vec3> {
        let distance = *self.distances_m.get(row * self.columns as usize + column)?;
        distance.is_finite().then(|| {
            let [column, row] = self.centre([column, row]);
            self.place_view(column, row, distance)
        })
    }

    /// The way from a place to the eye, a unit vector.
    pub fn towards_eye(&self, place_view: Vec3) -> Vec3 {
        if self.lens.is_perspective { (-place_view).normalize_or(Vec3::Z) } else { Vec3::Z }
    }

    /// Whether the ray of the picture that goes to a place falls in front of its plane with a normal, so that it goes on behind it.
    pub(crate) fn falls_on(&self, place_view: Vec3, normal_view: Vec3) -> bool {
        if self.lens.is_perspective { normal_view.dot(place_view) <= 0.0 } else { normal_view.z >= 0.0 }
    }

    /// How many samples of the picture a metre across the view axis is long at a distance. Samples are taken to be square.
    pub fn samples_per_metre(&self, distance_m: f32) -> f32 {
        let at_one = 0.5 * self.span[1] / self.lens.half_extent[1];
        if self.lens.is_perspective { at_one / distance_m } else { at_one }
    }

    /// Index of the sample whose square of the picture a place falls on; `None` outside of the picture and behind the camera.
    pub fn sample_at(&self, position_view: Vec3) -> Option<usize> {
        let [column, row] = self.sample_in(self.point_of(position_view)?)?;
        Some(row * self.columns as usize + column)
    }

    /// The point of the picture, or beside it, that a place falls on; `None` behind the camera. Coordinates as of [`Screen::place_view`].
    pub fn point_of(&self, position_view: Vec3) -> Option<[f32; 2]> {
        let distance = -position_view.z;
        let scale = match self.lens.is_perspective {
            true if distance > 0.0 => 1.0 / distance,
            true => return None,
            false => 1.0,
        };
        let [half_width, half_height] = self.lens.half_extent;
        let column = (0.5 + 0.5 * position_view.x * scale / half_width) * self.span[0];
        let row = (0.5 - 0.5 * position_view.y * scale / half_height) * self.span[1];
        Some([column, row])
    }
}

/// Of a picture with so many columns and rows the indices of the samples that [`Screen::half`] has, row-major.
pub(crate) fn half_sources(columns: u32, rows: u32) -> impl Iterator<Item = usize> {
    let (columns, rows) = (columns as usize, rows as usize);
    let half_columns = columns.div_ceil(2);
    (0..rows.div_ceil(2) * half_columns).map(move |i| {
        let (x, y) = (i % half_columns, i / half_columns);
        let column = (2 * x + (y & 1 ^ 1)).min(columns - 1);
        let row = (2 * y + (x & 1 ^ 1)).min(rows - 1);
        row * columns + column
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::screen::{draw, look, still_life};

    fn screens() -> [Screen; 2] {
        [
            Projection::Perspective { yfov: 0.8, near: 0.02 },
            Projection::Orthographic { half_height: 2.0, near: -3.0, far: 20.0 },
        ]
        .map(|projection| {
            let camera = PosedCamera { projection, ..look(Vec3::new(1.5, 2.0, 3.0), Vec3::ZERO) };
            draw(&still_life(), &camera, [61, 37]).1
        })
    }

    #[test]
    fn neighbours_are_the_nearest_samples() {
        for screen in screens() {
            let at = |by: [f32; 2]| screen.neighbour([10, 20], by);
            assert_eq!(at([0.0, 0.0]), Some([10, 20]));
            assert_eq!(at([0.49, -0.49]), Some([10, 20]));
            assert_eq!(at([0.51, -0.51]), Some([11, 19]));
            assert_eq!(at([-10.4, 16.4]), Some([0, 36]));
            for outside in [
                [-10.6, 0.0],
                [0.0, 16.6],
                [50.6, 0.0],
                [1e30, 0.0],
                [f32::NAN, 0.0],
                [f32::NEG_INFINITY, 0.0],
            ] {
                assert_eq!(at(outside), None, "{outside:?}");
            }
        }
    }

    #[test]
    fn distances_alone_are_those_of_the_screen() {
        for projection in [
            Projection::Perspective { yfov: 0.8, near: 0.02 },
            Projection::Orthographic { half_height: 2.0, near: -3.0, far: 20.0 },
        ] {
            let camera = PosedCamera { projection, ..look(Vec3::new(1.5, 2.0, 3.0), Vec3::ZERO) };
            let (gbuffer, screen) = draw(&still_life(), &camera, [61, 37]);
            assert_eq!(gbuffer.distances_m(&camera), screen.distances_m());
        }
    }

    /// What is recovered from a depth projects back to its sample and to that depth.
    #[test]
    fn places_project_back() {
        for lens in [
            Projection::Perspective { yfov: 0.8, near: 0.02 },
            Projection::Orthographic { half_height: 2.0, near: -3.0, far: 20.0 },
        ] {
            let camera = PosedCamera { projection: lens, ..look(Vec3::new(1.5, 2.0, 3.0), Vec3::ZERO) };
            let (gbuffer, screen) = draw(&still_life(), &camera, [61, 37]);
            let matrix = projection::clip_from_view(&camera.projection, 61.0 / 37.0);
            for (i, sample) in gbuffer.samples().iter().enumerate() {
                let Some(place) = screen.position_view(i) else { continue };
                let clip = matrix * place.as_dvec3().extend(1.0);
                let column = (0.5 + 0.5 * clip.x / clip.w) * 61.0 - 0.5;
                let row = (0.5 - 0.5 * clip.y / clip.w) * 37.0 - 0.5;
                assert!((column - (i % 61) as f64).abs() < 1e-4 && (row - (i / 61) as f64).abs() < 1e-4);
                assert!((clip.z / clip.w - f64::from(sample.depth)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn halves_have_true_samples_at_their_true_places() {
        for screen in screens() {
            for (half, factor) in [(screen.half(), 2.0), (screen.half().half(), 4.0)] {
                assert_eq!(
                    [half.columns(), half.rows()],
                    [61, 37].map(|side: u32| side.div_ceil(factor as u32))
                );
                for i in 0..half.distances_m().len() {
                    let at = [i % half.columns() as usize, i / half.columns() as usize];
                    let full = half.centre(at).map(|c| (c * factor) as usize);
                    let source = full[1] * 61 + full[0];
                    assert_eq!(half.distances_m()[i], screen.distances_m()[source]);
                    assert_eq!(half.normals_view()[i], screen.normals_view()[source]);
                    let (Some(a), Some(b)) = (half.position_view(i), screen.position_view(source)) else {
                        continue;
                    };
                    assert!(a.distance(b) < 1e-5 * (1.0 + b.length()), "{a}, {b}");
                    // It is the one that its own place falls on, and no step leads back to itself.
                    assert_eq!(half.sample_at(a), Some(i));
                    assert_eq!(half.neighbour(at, [0.0, 0.0]), Some(at));
                    let scale = screen.samples_per_metre(-b.z) / half.samples_per_metre(-a.z);
                    assert!((scale - factor).abs() < 1e-4);
                }
            }
            // Of any two rows and columns of the picture both are there.
            let half = screen.half();
            let parts: Vec<[u32; 2]> =
                [[0, 0], [1, 0], [0, 1], [1, 1]].map(|at| half.centre(at).map(|c| (2.0 * c) as u32)).to_vec();
            assert_eq!(parts, [[1, 1], [3, 0], [0, 3], [2, 2]]);
        }
    }

    #[test]
    fn places_planes_and_lengths_agree_with_the_lens() {
        for screen in screens() {
            let mut seen = 0;
            for (column, row) in (1..60).flat_map(|c| (1..36).map(move |r| (c, r))) {
                let Some(place) = screen.position_at([column, row]) else { continue };
                let normal = screen.normals_view()[row * 61 + column];
                let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
                // Its own point of the picture meets its own plane there.
                let own = screen.on_plane(x, y, place, normal).unwrap();
                assert!(own.distance(place) < 1e-3, "{own}, {place}");
                // So does any other, on the plane and where the picture says.
                if let Some(other) =
                    screen.on_plane(x + 0.7, y - 0.4, place, normal).filter(|p| p.length() < 20.0)
                {
                    assert!(normal.dot(other - place).abs() < 1e-3 * (1.0 + other.length()));
                    assert!(screen.place_view(x + 0.7, y - 0.4, -other.z).distance(other) < 1e-3);
                }
                // A metre to the right is so many samples to the right.
                let length = screen.samples_per_metre(-place.z);
                let right = screen.place_view(x + length, y, -place.z);
                assert!((right - place).distance(Vec3::X) < 1e-2, "{right}, {place}");
                let eye = screen.towards_eye(place);
                assert!((eye.length() - 1.0).abs() < 1e-5 && normal.dot(eye) > -1e-3);
                seen += 1;
            }
            assert!(seen > 500, "{seen}");
        }
    }
}
