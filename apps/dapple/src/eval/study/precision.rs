//! Places and normals from depth alone, and how exact they are: \[McGuire2012\] eq. 2 to 4 for our conventions, and the way from the host's matrices to a buffer's
//! bits that limits them (sec. 2.1 and 3.1, figures 3 and 4). `dapple_render::gbuffer::Screen` has the same places for reversed z.
//!
//! Conventions: view space is right-handed, y up, the camera looks along −z, *D* = −*z*; rows of a picture go down. For a matrix P with w = *D* (all perspectives)
//! and third row (0, 0, a, b) depth is *d* = *b*/*D* − *a*, so that
//!
//! ```text
//! eq. 2   D = c0 / (d c1 + c2)     reversed z: c = (n, 1, 0) without a far plane, (n f, f − n, n) with one
//!                                  standard z: c = (n, −1, 1),                   (n f, n − f, f)
//! eq. 3   x = D (2 (column + ½)/w − 1 + P02) / P00      y = D (1 − 2 (row + ½)/h + P12) / P11
//! eq. 4   n = normalize(∂C/∂row × ∂C/∂column)           down the picture is −y, so that it points to the eye
//! ```

use dapple_scene::glam::{DMat3, DMat4, DVec3, DVec4, Mat3, Mat4, Vec3, Vec4};

/// What a depth buffer keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DepthFormat {
    /// Whole numbers of so many bits, 1 … 32, for 0 … 1.
    Fixed(u32),
    /// IEEE 754 single precision.
    Float,
}

impl DepthFormat {
    /// The formats of figure 3.
    pub(super) const ALL: [DepthFormat; 4] =
        [DepthFormat::Fixed(16), DepthFormat::Fixed(24), DepthFormat::Fixed(32), DepthFormat::Float];

    /// A depth after it was kept.
    fn kept(self, depth: f32) -> f32 {
        match self {
            DepthFormat::Float => depth,
            DepthFormat::Fixed(bits) => {
                let steps = ((1u64 << bits.clamp(1, 32)) - 1) as f64;
                ((f64::from(depth.clamp(0.0, 1.0)) * steps).round() / steps) as f32
            }
        }
    }
}

impl std::fmt::Display for DepthFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            DepthFormat::Fixed(bits) => write!(f, "{bits}-bit fixed"),
            DepthFormat::Float => write!(f, "32-bit float"),
        }
    }
}

/// Everything between a scene and a place that is recovered from its depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pipeline {
    /// Bits of the depth buffer.
    pub(super) format: DepthFormat,
    /// Whether near is 1 and far 0.
    pub(super) reversed: bool,
    /// Distance of the near plane, metres, > 0.
    pub(super) near_m: f64,
    /// Distance of the far plane, metres, beyond the near plane; `None` for infinite.
    pub(super) far_m: Option<f64>,
    /// Whether the host multiplies matrices in double precision before it rounds them for the card.
    pub(super) host_double: bool,
    /// Whether the card sums the four products of a row of the matrix in pairs, as a dot product does, and not one after the other.
    pub(super) dot_products: bool,
}

impl Default for Pipeline {
    /// Ours: reversed z without a far plane in single precision.
    fn default() -> Self {
        Pipeline {
            format: DepthFormat::Float,
            reversed: true,
            near_m: 0.1,
            far_m: None,
            host_double: true,
            dot_products: false,
        }
    }
}

impl Pipeline {
    /// The lens, with these cotangents of half its angles.
    fn clip_from_view(&self, fx: f64, fy: f64) -> DMat4 {
        let n = self.near_m;
        let (a, b) = match (self.reversed, self.far_m) {
            (true, None) => (0.0, n),
            (true, Some(f)) => (n / (f - n), n * f / (f - n)),
            (false, None) => (-1.0, -n),
            (false, Some(f)) => (-f / (f - n), -n * f / (f - n)),
        };
        DMat4::from_cols(
            DVec4::new(fx, 0.0, 0.0, 0.0),
            DVec4::new(0.0, fy, 0.0, 0.0),
            DVec4::new(0.0, 0.0, a, -1.0),
            DVec4::new(0.0, 0.0, b, 0.0),
        )
    }

    /// The constants of eq. 2.
    pub(super) fn constants(&self) -> [f32; 3] {
        let n = self.near_m;
        let c = match (self.reversed, self.far_m) {
            (true, None) => [n, 1.0, 0.0],
            (true, Some(f)) => [n * f, f - n, n],
            (false, None) => [n, -1.0, 1.0],
            (false, Some(f)) => [n * f, n - f, f],
        };
        c.map(|c| c as f32)
    }
}

/// Eq. 2 and 3 with their constants, in single precision as a card works them out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reconstruction {
    c: [f32; 3],
    /// Factors of column and row, and what is added to them.
    xy: [[f32; 2]; 2],
}

impl Reconstruction {
    /// For a matrix with w = *D* and a picture of so many samples; `c` are the constants of eq. 2.
    pub(super) fn new(clip_from_view: &DMat4, c: [f32; 3], [columns, rows]: [u32; 2]) -> Reconstruction {
        let (p, columns, rows) = (clip_from_view, f64::from(columns), f64::from(rows));
        let (p00, p11, p02, p12) = (p.x_axis.x, p.y_axis.y, p.z_axis.x, p.z_axis.y);
        let factor = [2.0 / (columns * p00), -2.0 / (rows * p11)].map(|x| x as f32);
        let added = [(1.0 / columns - 1.0 + p02) / p00, (1.0 - 1.0 / rows + p12) / p11].map(|x| x as f32);
        Reconstruction { c, xy: [factor, added] }
    }

    /// Eq. 2, metres.
    pub(super) fn distance_m(&self, depth: f32) -> f32 {
        self.c[0] / (depth * self.c[1] + self.c[2])
    }

    /// Eq. 3: the place that a sample shows at a distance, view space.
    pub(super) fn place_view(&self, column: u32, row: u32, distance_m: f32) -> Vec3 {
        let [factor, added] = self.xy;
        Vec3::new(
            distance_m * (column as f32 * factor[0] + added[0]),
            distance_m * (row as f32 * factor[1] + added[1]),
            -distance_m,
        )
    }

    /// Eq. 4, of a sample, of the one to its right and of the one below; zero where they lie on a line.
    pub(super) fn normal_view(place: Vec3, right: Vec3, below: Vec3) -> Vec3 {
        (below - place).cross(right - place).normalize_or_zero()
    }
}

/// How far off what is recovered is at one distance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Deviation {
    /// Distance of the triangles along the view axis, metres.
    pub(super) distance_m: f64,
    /// Of the distance, metres: the mean and the most.
    pub(super) z_mean_m: f64,
    /// See above.
    pub(super) z_max_m: f64,
    /// Of the face's normal, degrees: the mean and the most.
    pub(super) normal_mean_degrees: f64,
    /// See above.
    pub(super) normal_max_degrees: f64,
    /// Triangles that were drawn.
    pub(super) triangles: u32,
}

/// The picture: 1920 × 1080, 60° high.
const SIZE: [u32; 2] = [1920, 1080];
const YFOV: f64 = std::f64::consts::FRAC_PI_3;
/// Cameras and objects stand within so many metres of the world's origin.
const WORLD_M: f64 = 20.0;
/// Places of corners on the picture are kept in this part of a pixel (8 bits, as cards do).
const SUBPIXELS: f64 = 256.0;

/// Draws `count` triangles at a distance with places, turns and shapes at random, each with a camera and an object of its own; recovers distance and normal in
/// the middle of each, and compares them with exact geometry. The same for the same arguments on every machine.
pub(super) fn deviation(pipeline: &Pipeline, distance_m: f64, count: u32) -> Deviation {
    let mut found = Deviation { distance_m, ..Deviation::default() };
    for number in 0..count {
        let mut random = Random::new(u64::from(number) << 32 ^ distance_m.to_bits());
        let Some([z, degrees]) = one(pipeline, distance_m, &mut random) else { continue };
        found.triangles += 1;
        found.z_mean_m += z;
        found.z_max_m = found.z_max_m.max(z);
        found.normal_mean_degrees += degrees;
        found.normal_max_degrees = found.normal_max_degrees.max(degrees);
    }
    let drawn = f64::from(found.triangles.max(1));
    found.z_mean_m /= drawn;
    found.normal_mean_degrees /= drawn;
    found
}

/// Errors of one triangle, metres and degrees; none if it is seen at more than 75° from its normal or does not cover the quad in its middle.
fn one(pipeline: &Pipeline, distance_m: f64, random: &mut Random) -> Option<[f64; 2]> {
    let size = SIZE.map(f64::from);
    let fy = 1.0 / libm::tan(0.5 * YFOV);
    let fx = fy * size[1] / size[0];
    // What a program holds: placements in single precision.
    let camera = random.turn();
    let eye = random.place(WORLD_M).as_vec3();
    let object = random.turn();
    let half = DVec3::new(0.8 * size[0] / size[1], 0.8, 0.0) / fy * distance_m;
    let middle_view = DVec3::new(random.signed() * half.x, random.signed() * half.y, -distance_m);
    let origin = (camera.as_dmat3() * middle_view + eye.as_dvec3()).as_vec3();
    // As large on the picture at any distance, near the object's origin.
    let corners = [0, 1, 2].map(|_| random.place(0.25 * distance_m).as_vec3());

    // Exact geometry.
    let world_from_view = affine(camera.as_dmat3(), eye.as_dvec3());
    let world_from_object = affine(object.as_dmat3(), origin.as_dvec3());
    let view_from_object = world_from_view.inverse() * world_from_object;
    let exact = corners.map(|corner| view_from_object.transform_point3(corner.as_dvec3()));
    let mut normal = (exact[1] - exact[0]).cross(exact[2] - exact[0]).try_normalize()?;
    let centre = (exact[0] + exact[1] + exact[2]) / 3.0;
    if normal.dot(centre) > 0.0 {
        normal = -normal;
    }
    if normal.dot(-centre.normalize()) < 0.26 || exact.iter().any(|corner| -corner.z < pipeline.near_m) {
        return None;
    }

    // The host's matrix, the card's corners.
    let lens = pipeline.clip_from_view(fx, fy);
    let matrix = if pipeline.host_double {
        (lens * view_from_object).as_mat4()
    } else {
        let world_from_object = affine32(object, origin);
        lens.as_mat4() * affine32(camera, eye).inverse() * world_from_object
    };
    let clip = corners.map(|corner| transform(&matrix, corner, pipeline.dot_products));
    let depths = clip.map(|c| c.z / c.w);
    let snapped = clip.map(|c| {
        let column = (0.5 + 0.5 * c.x / c.w) * SIZE[0] as f32;
        let row = (0.5 - 0.5 * c.y / c.w) * SIZE[1] as f32;
        [column, row].map(|x| (f64::from(x) * SUBPIXELS).round() / SUBPIXELS)
    });

    // The quad in the middle.
    let at = [0, 1].map(|axis| (snapped[0][axis] + snapped[1][axis] + snapped[2][axis]) / 3.0);
    if !(0..2).all(|axis| at[axis] >= 0.0 && at[axis] < size[axis] - 1.0) {
        return None;
    }
    let [column, row] = at.map(|x| x as u32);
    let reconstruction = Reconstruction::new(&lens, pipeline.constants(), SIZE);
    let place = |column: u32, row: u32| {
        let depth = interpolate(&snapped, &depths, column, row)?;
        let distance_m = reconstruction.distance_m(pipeline.format.kept(depth));
        Some(reconstruction.place_view(column, row, distance_m))
    };
    let [own, right, below] = [place(column, row)?, place(column + 1, row)?, place(column, row + 1)?];

    // What the sample's ray meets of the exact plane.
    let ndc = [2.0 * (f64::from(column) + 0.5) / size[0] - 1.0, 1.0 - 2.0 * (f64::from(row) + 0.5) / size[1]];
    let ray = DVec3::new(ndc[0] / fx, ndc[1] / fy, -1.0);
    let exact_m = normal.dot(centre) / normal.dot(ray);
    let found = Reconstruction::normal_view(own, right, below).as_dvec3();
    let degrees = libm::acos(found.dot(normal).clamp(-1.0, 1.0)).to_degrees();
    Some([(f64::from(-own.z) - exact_m).abs(), degrees])
}

/// A row vector times a matrix, in single precision; `dot` sums in pairs.
fn transform(matrix: &Mat4, point: Vec3, dot: bool) -> Vec4 {
    let v = [point.x, point.y, point.z, 1.0];
    let component = |row: usize| {
        let products = [0, 1, 2, 3].map(|i| matrix.col(i)[row] * v[i]);
        match dot {
            true => (products[0] + products[1]) + (products[2] + products[3]),
            false => ((products[3] + products[2]) + products[1]) + products[0],
        }
    };
    Vec4::new(component(0), component(1), component(2), component(3))
}

/// Depth at a sample's centre as a rasteriser finds it, in single precision; none outside of the triangle.
fn interpolate(corners: &[[f64; 2]; 3], depths: &[f32; 3], column: u32, row: u32) -> Option<f32> {
    let at = [f64::from(column) + 0.5, f64::from(row) + 0.5];
    let edge =
        |a: [f64; 2], b: [f64; 2], p: [f64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let area = edge(corners[0], corners[1], corners[2]);
    let weights = [(1, 2), (2, 0), (0, 1)].map(|(a, b)| edge(corners[a], corners[b], at) / area);
    if !weights.iter().all(|weight| *weight >= 0.0) {
        return None;
    }
    let (b1, b2) = (weights[1] as f32, weights[2] as f32);
    Some(depths[0] + b1 * (depths[1] - depths[0]) + b2 * (depths[2] - depths[0]))
}

fn affine(turn: DMat3, at: DVec3) -> DMat4 {
    DMat4::from_translation(at) * DMat4::from_mat3(turn)
}

fn affine32(turn: Mat3, at: Vec3) -> Mat4 {
    Mat4::from_translation(at) * Mat4::from_mat3(turn)
}

/// Numbers that look random and are the same everywhere (SplitMix64).
struct Random(u64);

impl Random {
    fn new(seed: u64) -> Random {
        Random(seed)
    }

    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn signed(&mut self) -> f64 {
        2.0 * self.next() - 1.0
    }

    fn place(&mut self, within: f64) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed()) * within
    }

    /// Three turns about axes, rounded as a program holds them.
    fn turn(&mut self) -> Mat3 {
        let mut about = |axis: usize| {
            let (sin, cos) = libm::sincos(std::f64::consts::PI * self.signed());
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            let mut columns = [[0.0; 3]; 3];
            columns[axis][axis] = 1.0;
            (columns[i][i], columns[j][j]) = (cos, cos);
            (columns[i][j], columns[j][i]) = (sin, -sin);
            DMat3::from_cols_array_2d(&columns)
        };
        (about(0) * about(1) * about(2)).as_mat3()
    }
}

#[cfg(test)]
mod tests {
    use dapple_render::gbuffer::rasterize;
    use dapple_scene::{Mesh, PosedCamera, Projection, Scene};
    use proptest::prelude::*;

    use super::super::hidden_layers::{add_mesh, add_rectangle};
    use super::*;

    fn lens(pipeline: &Pipeline, shift: [f64; 2]) -> DMat4 {
        let mut matrix = pipeline.clip_from_view(1.1, 1.7);
        (matrix.z_axis.x, matrix.z_axis.y) = (shift[0], shift[1]);
        matrix
    }

    fn pipelines() -> Vec<Pipeline> {
        let far = [None, Some(50.0), Some(1e4)];
        let both = far.into_iter().flat_map(|far_m| {
            [true, false].map(|reversed| Pipeline { reversed, far_m, ..Pipeline::default() })
        });
        both.collect()
    }

    proptest! {
        /// What is recovered projects back to its sample and its depth, through lenses that look aside, too.
        #[test]
        fn places_project_back(
            columns in 1u32..3000, rows in 1u32..3000, at in [0.0f64..1.0, 0.0..1.0], depth in 0.002f64..0.98,
            shift in [-0.5f64..0.5, -0.5..0.5],
        ) {
            for pipeline in pipelines() {
                let matrix = lens(&pipeline, shift);
                let reconstruction = Reconstruction::new(&matrix, pipeline.constants(), [columns, rows]);
                let (column, row) = ((at[0] * f64::from(columns)) as u32, (at[1] * f64::from(rows)) as u32);
                let distance_m = reconstruction.distance_m(depth as f32);
                let place = reconstruction.place_view(column, row, distance_m).as_dvec3();
                let clip = matrix * place.extend(1.0);
                let (x, y) = ((0.5 + 0.5 * clip.x / clip.w) * f64::from(columns), (0.5 - 0.5 * clip.y / clip.w) * f64::from(rows));
                prop_assert!(distance_m as f64 >= 0.99 * pipeline.near_m, "{pipeline:?}: {distance_m}");
                prop_assert!((x - f64::from(column) - 0.5).abs() < 1e-3, "{pipeline:?}: {x}, {column}");
                prop_assert!((y - f64::from(row) - 0.5).abs() < 1e-3, "{pipeline:?}: {y}, {row}");
                prop_assert!((clip.z / clip.w - depth).abs() < 1e-6, "{pipeline:?}: {}, {depth}", clip.z / clip.w);
            }
        }
    }

    /// Places of a picture of ours are those of eq. 2 and 3, and eq. 4 makes the geometry's normals of them.
    #[test]
    fn the_screen_is_reconstructed_from_depth_alone() {
        let mut scene = Scene::default();
        let mut slope = Mesh::default();
        let at = |x: f32, z: f32| Vec3::new(x, 0.3 * x - 0.2 * z, z);
        add_rectangle(&mut slope, [at(-9.0, 9.0), at(9.0, 9.0), at(9.0, -9.0), at(-9.0, -9.0)]);
        add_mesh(&mut scene, slope);
        let pose = scene.pose(0.0);
        let camera = PosedCamera::look_at(Vec3::new(3.2, 6.4, 1.8), Vec3::new(0.5, 0.5, 0.0), 0.8);
        let Projection::Perspective { yfov, near } = camera.projection else { panic!("a perspective") };
        let [width, height] = [120, 90];
        let gbuffer = rasterize(&scene, &pose, &camera, width, height, 1).unwrap();
        let screen = gbuffer.screen(&scene, &pose, &camera).unwrap();
        let pipeline = Pipeline { near_m: f64::from(near), ..Pipeline::default() };
        let fy = 1.0 / libm::tan(0.5 * f64::from(yfov));
        let lens = pipeline.clip_from_view(fy * f64::from(height) / f64::from(width), fy);
        let reconstruction = Reconstruction::new(&lens, pipeline.constants(), [width, height]);
        let place = |column: u32, row: u32| {
            let depth = gbuffer.samples()[(row * width + column) as usize].depth;
            reconstruction.place_view(column, row, reconstruction.distance_m(depth))
        };
        let mut seen = 0;
        for (column, row) in (0..118).flat_map(|column| (0..88).map(move |row| (column, row))) {
            let index = (row * width + column) as usize;
            let (Some(expected), own) = (screen.position_view(index), place(column, row)) else { continue };
            assert!(own.distance(expected) < 1e-5 * expected.length(), "{own}, {expected}");
            let quad = [place(column + 1, row), place(column, row + 1)];
            let normal = Reconstruction::normal_view(own, quad[0], quad[1]);
            assert!(normal.dot(screen.normals_view()[index]) > 0.999, "{normal}");
            assert!(normal.dot(-own) > 0.0, "towards the eye");
            seen += 1;
        }
        assert!(seen > 5000, "{seen}");
    }

    /// The worst over 0.5 … 50 m.
    fn worst(pipeline: Pipeline) -> [f64; 2] {
        let distances = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0];
        let all = distances.map(|distance_m| deviation(&pipeline, distance_m, 2000));
        assert!(all.iter().all(|found| found.triangles > 500), "{all:?}");
        let most = |value: fn(&Deviation) -> f64| all.iter().map(value).fold(0.0, f64::max);
        [most(|found| found.z_max_m), most(|found| found.normal_max_degrees)]
    }

    const FAR_M: [f64; 3] = [100.0, 1000.0, 1e4];

    fn standard(format: DepthFormat, far_m: Option<f64>) -> Pipeline {
        Pipeline { format, reversed: false, far_m, ..Pipeline::default() }
    }

    /// Figure 3: from 24 bits on the format changes nothing with standard z, because what comes before it destroys more; that there is no far plane does.
    #[test]
    fn an_infinite_far_plane_matters_more_than_the_format() {
        let [_, fixed24, fixed32, float] = DepthFormat::ALL;
        let infinite = worst(standard(fixed24, None))[0];
        // The paper has 2 mm, of distances that it does not say.
        assert!((1e-3..5e-3).contains(&infinite), "{infinite} m");
        for far_m in FAR_M.map(Some).into_iter().chain([None]) {
            let [a, b, c] = [fixed24, fixed32, float].map(|format| worst(standard(format, far_m))[0]);
            assert!((a - b).abs() < 0.02 * a && (a - c).abs() < 0.02 * a, "{far_m:?}: {a}, {b}, {c}");
            let Some(_) = far_m else { continue };
            assert!(infinite < 0.85 * a, "{far_m:?}: {a}, without {infinite}");
            // With matrices in single precision it is more than twice as much.
            let single = |far_m| worst(Pipeline { host_double: false, ..standard(fixed24, far_m) })[0];
            let (with, without) = (single(far_m), single(None));
            assert!(without < 0.5 * with && with > 1.3 * a, "{far_m:?}: {with}, without {without}");
        }
        // 16 bits are another matter.
        assert!(worst(standard(DepthFormat::Fixed(16), None))[0] > 0.1);
    }

    /// Figure 4, and what reversed z makes of both.
    #[test]
    fn reversed_single_precision_keeps_normals_within_a_fifth_of_a_degree() {
        let [z_m, degrees] = worst(Pipeline::default());
        assert!(z_m < 5e-4 && degrees < 0.2, "{z_m} m, {degrees}");
        let [standard_m, standard_degrees] = worst(standard(DepthFormat::Fixed(24), None));
        assert!(standard_m > 10.0 * z_m && standard_degrees > 10.0 * degrees);
        // Near the eye standard z does, too: the paper's pictures are of rooms.
        for distance_m in [0.5, 1.0, 2.0] {
            let near = deviation(&standard(DepthFormat::Fixed(24), None), distance_m, 2000);
            assert!(near.normal_max_degrees < 0.2 && near.z_max_m < 2e-3, "{near:?}");
        }
    }

    #[test]
    fn deviations_are_the_same_again_and_grow_with_the_distance() {
        let at = |distance_m| deviation(&standard(DepthFormat::Fixed(24), None), distance_m, 500);
        assert_eq!(at(3.0), at(3.0));
        let (near, far) = (at(2.0), at(40.0));
        assert!(far.z_mean_m > 20.0 * near.z_mean_m, "{near:?}, {far:?}");
        assert!(far.z_mean_m < far.z_max_m && far.normal_mean_degrees < far.normal_max_degrees);
    }
}
