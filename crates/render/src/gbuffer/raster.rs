//! The rasteriser core: clipping, snapping, exact edge tests, depth. Draws G-buffers and shadow maps.

use dapple_scene::{Pose, Scene};
use glam::{DMat4, DVec2, DVec4, Vec3};
use rayon::prelude::*;

/// Triangles set up by one task.
const CHUNK_TRIANGLES: u32 = 1024;
/// Tasks whose triangles are held in memory together.
const BATCH_CHUNKS: usize = 256;
/// The guard band: triangles are clipped where |x| or |y| exceeds this many times w.
const GUARD: f64 = 3.0;
/// Positions times this many units, at most (see `View::subdivision_bits`).
const MAX_SUBDIVISION_BITS: u32 = 16;

/// A grid of samples and what it looks at.
pub(crate) struct View {
    /// Clip space, reverse z.
    pub(crate) clip_from_world: DMat4,
    /// Samples in a row.
    pub(crate) columns: u32,
    /// Rows of samples.
    pub(crate) rows: u32,
}

/// Takes the samples that triangles cover.
pub(crate) trait Sink: Sync {
    /// What a sample of the target holds.
    type Pixel: Send;
    /// What is worked out once a triangle (and band).
    type State;

    /// Before the samples of a triangle.
    fn begin(&self, triangle: &Triangle) -> Self::State;
    /// A covered sample at column, row `at`. Calls come in any order: keep what does not depend on it.
    fn sample(
        &self,
        state: &Self::State,
        triangle: &Triangle,
        at: [u32; 2],
        depth: f32,
        pixel: &mut Self::Pixel,
    );
}

/// A triangle on the sample grid: a whole one of a mesh, or what clipping left of it.
pub(crate) struct Triangle {
    /// Index of the instance.
    pub(crate) instance: u32,
    /// Index in the mesh.
    pub(crate) index: u32,
    /// Index of the material.
    pub(crate) material: u32,
    /// Seen from the back.
    pub(crate) back_face: bool,
    /// Snapped corners in units of 2^-bits samples; clockwise on the screen (y down).
    corners: [[i32; 2]; 3],
    depth: DepthPlane,
    first_row: u32,
    end_row: u32,
}

/// z/w over the screen is a plane; its values stay within those at the corners.
struct DepthPlane {
    at: DVec2,
    value: f64,
    slope: DVec2,
    min: f64,
    max: f64,
}

impl View {
    /// Normalised device coordinates of a sample's centre.
    pub(crate) fn ndc(&self, [column, row]: [u32; 2]) -> DVec2 {
        DVec2::new(
            (2.0 * f64::from(column) + 1.0) / f64::from(self.columns) - 1.0,
            1.0 - (2.0 * f64::from(row) + 1.0) / f64::from(self.rows),
        )
    }

    /// A mesh triangle in clip space; `None` if an index is out of range or a number not finite.
    pub(crate) fn clip_triangle(
        &self,
        scene: &Scene,
        pose: &Pose,
        instance: usize,
        index: usize,
    ) -> Option<[DVec4; 3]> {
        let corners = world_triangle(scene, pose, instance, index)?;
        let clip = corners.map(|p| self.clip_from_world * p.as_dvec3().extend(1.0));
        clip.iter().all(|c| c.is_finite()).then_some(clip)
    }

    /// Bits below the sample: as many as keep the products of edge tests within 63 bits. Coordinates inside the guard
    /// band are below 2 × side × 2^bits ≤ 2^30, differences of them below 2^30.6, and a test is a sum of two products.
    fn subdivision_bits(&self) -> u32 {
        let side = self.columns.max(self.rows).max(1);
        let side_bits = 32 - (side - 1).leading_zeros();
        MAX_SUBDIVISION_BITS.min(29 - side_bits.min(29))
    }

    fn screen(&self, clip: &DVec4) -> DVec2 {
        DVec2::new(
            (0.5 + 0.5 * clip.x / clip.w) * f64::from(self.columns),
            (0.5 - 0.5 * clip.y / clip.w) * f64::from(self.rows),
        )
    }
}

/// The posed corners of a mesh triangle in the world.
pub(crate) fn world_triangle(scene: &Scene, pose: &Pose, instance: usize, index: usize) -> Option<[Vec3; 3]> {
    let posed = pose.instances.get(instance)?;
    let mesh = scene.meshes.get(scene.instances.get(instance)?.mesh as usize)?;
    let positions = posed.deformed.as_ref().map_or(&mesh.positions, |d| &d.positions);
    let [a, b, c] = *mesh.triangles.get(index)?;
    let corner = |v: u32| Some(posed.world_from_mesh.transform_point3(*positions.get(v as usize)?));
    Some([corner(a)?, corner(b)?, corner(c)?])
}

/// Perspective-correct weights of three clip-space vertices at a place of the picture, each ≥ 0, sum 1.
///
/// In coordinates relative to the sample, x' = x − w·ndc.x, y' likewise, the weight of vertex 0 is proportional to
/// x₁'y₂' − y₁'x₂' (and cyclic): the solution of Σ bᵢ xᵢ' = Σ bᵢ yᵢ' = 0. Weights a little below 0 (the sample may lie
/// outside by half a unit of snapping) are raised to 0.
pub(crate) fn barycentrics(clip: &[DVec4; 3], ndc: DVec2) -> [f32; 3] {
    let relative = clip.map(|c| DVec2::new(c.x - c.w * ndc.x, c.y - c.w * ndc.y));
    let e = [
        relative[1].perp_dot(relative[2]),
        relative[2].perp_dot(relative[0]),
        relative[0].perp_dot(relative[1]),
    ];
    let scale = 1.0 / (e[0] + e[1] + e[2]);
    let b = e.map(|e| (e * scale).clamp(0.0, 1.0));
    let sum = b[0] + b[1] + b[2];
    if !(sum.is_finite() && sum > 0.0) {
        return [1.0 / 3.0; 3];
    }
    let (b1, b2) = ((b[1] / sum) as f32, (b[2] / sum) as f32);
    // Two floats that each round up may pass 1 together.
    let b2 = b2.min(1.0 - b1);
    [(1.0 - b1 - b2).max(0.0), b1, b2]
}

/// A run of triangles of one material in one instance.
struct Chunk {
    instance: u32,
    material: u32,
    first: u32,
    end: u32,
    cull: bool,
    mirrored: bool,
}

/// Draws all instances that `include` accepts. With `cull`, back faces of single-sided materials are left out.
pub(crate) fn draw<S: Sink>(
    view: &View,
    scene: &Scene,
    pose: &Pose,
    cull: bool,
    include: impl Fn(usize) -> bool,
    sink: &S,
    pixels: &mut [S::Pixel],
) {
    let chunks = split(scene, pose, cull, include);
    // Bands are small enough to balance, large enough that few triangles lie in two.
    let band_rows = view.rows.div_ceil(128).max(16);
    for batch in chunks.chunks(BATCH_CHUNKS) {
        let drawn: Vec<(u32, u32, Vec<Triangle>)> = batch
            .par_iter()
            .map(|chunk| {
                let mut triangles = Vec::with_capacity((chunk.end - chunk.first) as usize);
                for index in chunk.first..chunk.end {
                    set_up(view, scene, pose, chunk, index, &mut triangles);
                }
                let first = triangles.iter().map(|t| t.first_row).min().unwrap_or(0);
                let end = triangles.iter().map(|t| t.end_row).max().unwrap_or(0);
                (first, end, triangles)
            })
            .collect();
        pixels.par_chunks_mut(view.columns as usize * band_rows as usize).enumerate().for_each(
            |(band, pixels)| {
                let first_row = band as u32 * band_rows;
                let end_row = (first_row + band_rows).min(view.rows);
                for (_, _, triangles) in drawn.iter().filter(|d| d.0 < end_row && d.1 > first_row) {
                    for triangle in
                        triangles.iter().filter(|t| t.first_row < end_row && t.end_row > first_row)
                    {
                        fill(view, triangle, first_row, end_row, sink, pixels);
                    }
                }
            },
        );
    }
}

fn split(scene: &Scene, pose: &Pose, cull: bool, include: impl Fn(usize) -> bool) -> Vec<Chunk> {
    let mut chunks = Vec::new();
    for (i, (instance, posed)) in scene.instances.iter().zip(&pose.instances).enumerate() {
        if !include(i) || !posed.is_there() {
            continue;
        }
        let mesh = &scene.meshes[instance.mesh as usize];
        let mirrored = posed.world_from_mesh.matrix3.determinant() < 0.0;
        for part in &mesh.parts {
            let cull = cull && !scene.materials[part.material as usize].double_sided;
            let end = part.first_triangle + part.triangle_count;
            for first in (part.first_triangle..end).step_by(CHUNK_TRIANGLES as usize) {
                let end = end.min(first.saturating_add(CHUNK_TRIANGLES));
                chunks.push(Chunk {
                    instance: i as u32,
                    material: part.material,
                    first,
                    end,
                    cull,
                    mirrored,
                });
            }
        }
    }
    chunks
}

/// Clips, snaps and orients one mesh triangle.
fn set_up(view: &View, scene: &Scene, pose: &Pose, chunk: &Chunk, index: u32, out: &mut Vec<Triangle>) {
    let Some(clip) = view.clip_triangle(scene, pose, chunk.instance as usize, index as usize) else { return };
    let outside_view = |plane: fn(&DVec4) -> f64| clip.iter().all(|c| plane(c) < 0.0);
    if outside_view(|c| c.w + c.x)
        || outside_view(|c| c.w - c.x)
        || outside_view(|c| c.w + c.y)
        || outside_view(|c| c.w - c.y)
        || outside_view(|c| c.w - c.z)
        || outside_view(|c| c.z)
    {
        return;
    }
    let polygon = Polygon::clipped(&clip);
    let corners = &polygon.corners[..polygon.len];
    if corners.len() < 3 {
        return;
    }
    let bits = view.subdivision_bits();
    let unit = f64::from(1u32 << bits);
    let mut screen = [DVec2::ZERO; MAX_CORNERS];
    let mut depth = [0.0f64; MAX_CORNERS];
    let mut snapped = [[0i32; 2]; MAX_CORNERS];
    for (i, corner) in corners.iter().enumerate() {
        screen[i] = view.screen(corner);
        depth[i] = corner.z / corner.w;
        snapped[i] = [(screen[i].x * unit).round() as i32, (screen[i].y * unit).round() as i32];
    }
    for i in 1..corners.len() - 1 {
        let fan = [0, i, i + 1];
        let mut corners = fan.map(|k| snapped[k]);
        let twice_area = edge(corners[0], corners[1], corners[2]);
        // Counter-clockwise in the mesh is clockwise under a mirror, and y points down on the screen.
        let back_face = (twice_area > 0) != chunk.mirrored;
        if twice_area == 0 || (back_face && chunk.cull) {
            continue;
        }
        if twice_area < 0 {
            corners.swap(1, 2);
        }
        let span = |axis: usize, limit: u32| {
            let values = corners.map(|c| c[axis]);
            let (min, max) =
                (values[0].min(values[1]).min(values[2]), values[0].max(values[1]).max(values[2]));
            centers_between(i64::from(min), i64::from(max), bits, limit)
        };
        let (first_column, end_column) = span(0, view.columns);
        let (first_row, end_row) = span(1, view.rows);
        if first_row >= end_row || first_column >= end_column {
            continue;
        }
        out.push(Triangle {
            instance: chunk.instance,
            index,
            material: chunk.material,
            back_face,
            corners,
            depth: DepthPlane::through(fan.map(|k| screen[k]), fan.map(|k| depth[k])),
            first_row,
            end_row,
        });
    }
}

/// Sample indices whose centres lie in [min, max] (units of 2^-bits), cut to 0 … limit.
fn centers_between(min: i64, max: i64, bits: u32, limit: u32) -> (u32, u32) {
    let half = (1i64 << bits) >> 1;
    // Arithmetic shifts round down.
    let first = (min - half + (1i64 << bits) - 1) >> bits;
    let end = ((max - half) >> bits) + 1;
    (first.clamp(0, i64::from(limit)) as u32, end.clamp(0, i64::from(limit)) as u32)
}

/// Twice the signed area of (a, b, p): positive where p lies to the right of a → b (y down).
fn edge(a: [i32; 2], b: [i32; 2], p: [i32; 2]) -> i64 {
    let d = |i: usize, v: [i32; 2]| i64::from(v[i]) - i64::from(a[i]);
    d(0, b) * d(1, p) - d(1, b) * d(0, p)
}

impl DepthPlane {
    fn through(at: [DVec2; 3], value: [f64; 3]) -> DepthPlane {
        let (e1, e2) = (at[1] - at[0], at[2] - at[0]);
        let (d1, d2) = (value[1] - value[0], value[2] - value[0]);
        let scale = 1.0 / e1.perp_dot(e2);
        let slope = DVec2::new((d1 * e2.y - d2 * e1.y) * scale, (d2 * e1.x - d1 * e2.x) * scale);
        DepthPlane {
            at: at[0],
            value: value[0],
            // A sliver without area keeps the depth of its first corner.
            slope: if slope.is_finite() { slope } else { DVec2::ZERO },
            min: value[0].min(value[1]).min(value[2]),
            max: value[0].max(value[1]).max(value[2]),
        }
    }

    fn depth(&self, at: DVec2) -> f32 {
        let depth = self.value + self.slope.x * (at.x - self.at.x) + self.slope.y * (at.y - self.at.y);
        depth.max(self.min).min(self.max) as f32
    }
}

/// Hands the covered samples of a triangle within a band of rows to the sink.
fn fill<S: Sink>(
    view: &View,
    triangle: &Triangle,
    first_row: u32,
    end_row: u32,
    sink: &S,
    pixels: &mut [S::Pixel],
) {
    let state = sink.begin(triangle);
    let bits = view.subdivision_bits();
    let (unit, half) = (1i64 << bits, (1i64 << bits) >> 1);
    // Each edge as a function of column and row, E = base + column·by_column + row·by_row ≥ 0 inside. The top-left
    // rule gives a sample that lies on an edge to one of the two triangles: the other sees −1.
    let edges: [(i64, i64, i64); 3] = std::array::from_fn(|i| {
        let [ax, ay] = triangle.corners[i].map(i64::from);
        let [bx, by] = triangle.corners[(i + 1) % 3].map(i64::from);
        let (dx, dy) = (bx - ax, by - ay);
        let is_top_left = dy < 0 || (dy == 0 && dx > 0);
        let base = dx * (half - ay) - dy * (half - ax) - i64::from(!is_top_left);
        (base, -dy * unit, dx * unit)
    });
    for row in triangle.first_row.max(first_row)..triangle.end_row.min(end_row) {
        let (mut first, mut last) = (0i64, i64::from(view.columns) - 1);
        for (base, by_column, by_row) in edges {
            let value = base + by_row * i64::from(row);
            match by_column.signum() {
                // value + column·by_column ≥ 0, solved for the column in whole numbers.
                1 => first = first.max(-value.div_euclid(by_column)),
                -1 => last = last.min(value.div_euclid(-by_column)),
                _ if value < 0 => last = -1,
                _ => {}
            }
        }
        let start = (row - first_row) as usize * view.columns as usize;
        for column in first..=last {
            let column = column as u32;
            let depth = triangle.depth.depth(DVec2::new(f64::from(column) + 0.5, f64::from(row) + 0.5));
            sink.sample(&state, triangle, [column, row], depth, &mut pixels[start + column as usize]);
        }
    }
}

/// A triangle cut by six planes has at most nine corners.
const MAX_CORNERS: usize = 9;

struct Polygon {
    corners: [DVec4; MAX_CORNERS],
    len: usize,
}

impl Polygon {
    /// What is left of a triangle in front of the near plane, before the far plane, and inside the guard band.
    ///
    /// An edge that two triangles share is cut at the same place in both: cutting goes from the inner end to the outer
    /// one, whatever the triangle's direction.
    fn clipped(clip: &[DVec4; 3]) -> Polygon {
        let planes: [fn(&DVec4) -> f64; 6] = [
            |c| c.w - c.z,
            |c| c.z,
            |c| GUARD * c.w + c.x,
            |c| GUARD * c.w - c.x,
            |c| GUARD * c.w + c.y,
            |c| GUARD * c.w - c.y,
        ];
        let mut polygon = Polygon { corners: [DVec4::ZERO; MAX_CORNERS], len: 3 };
        polygon.corners[..3].copy_from_slice(clip);
        for plane in planes {
            if polygon.corners[..polygon.len].iter().all(|c| plane(c) >= 0.0) {
                continue;
            }
            polygon = polygon.cut(plane);
        }
        // Behind the camera only in the corner cases that rounding leaves.
        if polygon.corners[..polygon.len].iter().any(|c| c.w <= 0.0) {
            polygon.len = 0;
        }
        polygon
    }

    fn cut(&self, plane: fn(&DVec4) -> f64) -> Polygon {
        let mut out = Polygon { corners: [DVec4::ZERO; MAX_CORNERS], len: 0 };
        let mut push = |c: DVec4| {
            if out.len < MAX_CORNERS {
                out.corners[out.len] = c;
                out.len += 1;
            }
        };
        for i in 0..self.len {
            let (a, b) = (self.corners[i], self.corners[(i + 1) % self.len]);
            let (da, db) = (plane(&a), plane(&b));
            if da >= 0.0 {
                push(a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                let (inner, outer, di, d_o) = if da >= 0.0 { (a, b, da, db) } else { (b, a, db, da) };
                push(inner + (outer - inner) * (di / (di - d_o)));
            }
        }
        out
    }
}
