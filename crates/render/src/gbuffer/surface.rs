//! The surface that a sample sees, in the world and at rest.

use dapple_scene::{Mesh, Pose, Scene, TextureRef};
use glam::{Mat3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::{GBuffer, Sample, raster::world_triangle};
use crate::texture::{self, Encoding};

/// Everything about the surface that a sample sees. Normals point to the viewer's side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Where it is now, metres.
    pub position_world: Vec3,
    /// Unit normal of the posed triangle.
    pub normal_world: Vec3,
    /// Unit interpolated normal, with the normal map where the mesh has tangents or texture coordinates. On the same
    /// side of the surface as `normal_world`.
    pub normal_shading_world: Vec3,
    /// Where it is at rest: `rest_from_mesh` of the place in the mesh before skinning and morphing, metres.
    pub position_rest: Vec3,
    /// Unit normal of the resting triangle, same side.
    pub normal_rest: Vec3,
    /// Both texture coordinate sets; zero where the mesh has none.
    pub uv: [Vec2; 2],
    /// Vertex colour, linear RGBA; white where the mesh has none.
    pub color: Vec4,
    /// Index into [`Scene::materials`].
    pub material: u32,
}

/// The part of a [`Surface`] that a look-up of points needs; cheaper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestSurface {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// As in [`Surface`].
    pub position_rest: Vec3,
    /// As in [`Surface`].
    pub normal_rest: Vec3,
}

/// Where a sample's place on its mesh is in the posed local space of another time ([`Scene::local_from_posed`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalSurface {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Metres.
    pub position_local: Vec3,
    /// Unit normal of the posed triangle, to the side that the sample sees; zero where it has collapsed.
    pub normal_local: Vec3,
}

impl GBuffer {
    /// The surface that a sample sees; `None` for the background, and for an index that is out of range (of the
    /// buffer, or because the scene or pose is another than the one drawn).
    pub fn surface(&self, scene: &Scene, pose: &Pose, sample_index: usize) -> Option<Surface> {
        let sample = self.samples.get(sample_index).filter(|s| s.is_covered())?;
        let found = Found::new(scene, sample)?;
        let rest = found.rest_surface();
        let corners_world = world_triangle(scene, pose, sample.instance as usize, sample.triangle as usize)?;
        let world_from_mesh = pose.instances.get(sample.instance as usize)?.world_from_mesh;
        let linear = Mat3::from(world_from_mesh.matrix3);
        let normal_world = found.geometric_normal(&corners_world, linear);
        let uv = interpolate_uv(found.mesh, found.indices, found.weights);
        let material = triangle_material(found.mesh, sample.triangle)?;
        let normal_shading_world = found
            .shading_normal(scene, pose, material, linear, &uv, &corners_world)
            .map_or(normal_world, |n| on_side_of(n, normal_world));
        Some(Surface {
            instance: sample.instance,
            position_world: blend(corners_world, found.weights),
            normal_world,
            normal_shading_world,
            position_rest: rest.position_rest,
            normal_rest: rest.normal_rest,
            uv,
            color: interpolate_color(found.mesh, found.indices, found.weights),
            material,
        })
    }

    /// [`Surface::normal_world`] alone, cheaper; `None` as in [`GBuffer::surface`].
    pub(super) fn normal_world(&self, scene: &Scene, pose: &Pose, sample_index: usize) -> Option<Vec3> {
        let sample = self.samples.get(sample_index).filter(|s| s.is_covered())?;
        let corners = world_triangle(scene, pose, sample.instance as usize, sample.triangle as usize)?;
        let world_from_mesh = pose.instances.get(sample.instance as usize)?.world_from_mesh;
        Some(Found::new(scene, sample)?.geometric_normal(&corners, Mat3::from(world_from_mesh.matrix3)))
    }

    /// Parts of a vector along the first edge of the posed triangle that a sample sees, and in its plane across that (towards the third
    /// corner); `None` as in [`GBuffer::surface`], and where the triangle has collapsed.
    pub(crate) fn lean(
        &self,
        scene: &Scene,
        pose: &Pose,
        sample_index: usize,
        vector_world: Vec3,
    ) -> Option<[f32; 2]> {
        let sample = self.samples.get(sample_index).filter(|s| s.is_covered())?;
        let corners = world_triangle(scene, pose, sample.instance as usize, sample.triangle as usize)?;
        let frame = frame(&corners, false)?;
        Some([frame.x_axis.dot(vector_world), frame.y_axis.dot(vector_world)])
    }

    /// Rest position and normal of the surface that a sample sees; `None` as in [`GBuffer::surface`].
    pub fn surface_rest(&self, scene: &Scene, sample_index: usize) -> Option<RestSurface> {
        let sample = self.samples.get(sample_index).filter(|s| s.is_covered())?;
        Found::new(scene, sample).map(|found| found.rest_surface())
    }

    /// How the triangle that a sample sees has turned since rest: takes directions in rest space to the world, as the triangle carries
    /// them along without stretching them. `None` as in [`GBuffer::surface`], and where the triangle has collapsed.
    pub fn world_from_rest(&self, scene: &Scene, pose: &Pose, sample_index: usize) -> Option<Mat3> {
        let sample = self.samples.get(sample_index).filter(|s| s.is_covered())?;
        let found = Found::new(scene, sample)?;
        let corners_rest = found.indices.map(|v| found.rest_from_mesh * found.mesh.positions[v as usize]);
        let corners_world = world_triangle(scene, pose, sample.instance as usize, sample.triangle as usize)?;
        let linear = Mat3::from(pose.instances.get(sample.instance as usize)?.world_from_mesh.matrix3);
        let rest = frame(&corners_rest, found.rest_from_mesh.determinant() < 0.0)?;
        Some(frame(&corners_world, linear.determinant() < 0.0)? * rest.transpose())
    }

    /// Where the place on the mesh that a sample sees is in its instance's local space at `pose`, which may be of another time
    /// than the one drawn ([Neff2023] sec. 3.5); `None` as in [`GBuffer::surface`].
    pub fn surface_local(&self, scene: &Scene, pose: &Pose, sample_index: usize) -> Option<LocalSurface> {
        let sample = self.samples.get(sample_index).filter(|s| s.is_covered())?;
        let found = Found::new(scene, sample)?;
        let instance = sample.instance as usize;
        pose.instances.get(instance)?;
        let local_from_posed = scene.local_from_posed(pose, instance);
        let vertices = scene.vertex_positions(pose, instance);
        let mut corners = [Vec3::ZERO; 3];
        for (corner, &v) in corners.iter_mut().zip(&found.indices) {
            *corner = local_from_posed.transform_point3(*vertices.get(v as usize)?);
        }
        Some(LocalSurface {
            instance: sample.instance,
            position_local: blend(corners, found.weights),
            normal_local: found.geometric_normal(&corners, Mat3::from(local_from_posed.matrix3)),
        })
    }

    /// `f` of [`GBuffer::surface_local`] of every sample, in parallel, in the order of the samples.
    pub fn map_surfaces_local<T: Send>(
        &self,
        scene: &Scene,
        pose: &Pose,
        f: impl Fn(usize, Option<&LocalSurface>) -> T + Sync,
    ) -> Vec<T> {
        let indices = (0..self.samples.len()).into_par_iter().with_min_len(1024);
        indices.map(|i| f(i, self.surface_local(scene, pose, i).as_ref())).collect()
    }

    /// `f` of the surface of every sample (`None` for the background), in parallel, in the order of the samples.
    pub fn map_surfaces<T: Send>(
        &self,
        scene: &Scene,
        pose: &Pose,
        f: impl Fn(usize, Option<&Surface>) -> T + Sync,
    ) -> Vec<T> {
        let indices = (0..self.samples.len()).into_par_iter().with_min_len(1024);
        indices.map(|i| f(i, self.surface(scene, pose, i).as_ref())).collect()
    }

    /// `f` of the rest surface of every sample (`None` for the background), in parallel, in the order of the samples.
    pub fn map_surfaces_rest<T: Send>(
        &self,
        scene: &Scene,
        f: impl Fn(usize, Option<&RestSurface>) -> T + Sync,
    ) -> Vec<T> {
        let indices = (0..self.samples.len()).into_par_iter().with_min_len(1024);
        indices.map(|i| f(i, self.surface_rest(scene, i).as_ref())).collect()
    }
}

/// Axes of a triangle: along its first edge, into it, and its front's normal, which the first two make unless they are those of a mirrored
/// one.
fn frame([a, b, c]: &[Vec3; 3], mirrored: bool) -> Option<Mat3> {
    let (ab, ac) = (*b - *a, *c - *a);
    let tangent = ab.try_normalize()?;
    let face = ab.cross(ac).try_normalize()?;
    Some(Mat3::from_cols(tangent, face.cross(tangent), if mirrored { -face } else { face }))
}

/// A sample with what it refers to in the scene.
struct Found<'a> {
    sample: &'a Sample,
    mesh: &'a Mesh,
    indices: [u32; 3],
    weights: [f32; 3],
    rest_from_mesh: Mat3,
}

impl<'a> Found<'a> {
    fn new(scene: &'a Scene, sample: &'a Sample) -> Option<Found<'a>> {
        let instance = scene.instances.get(sample.instance as usize)?;
        let mesh = scene.meshes.get(instance.mesh as usize)?;
        let indices = *mesh.triangles.get(sample.triangle as usize)?;
        if indices.iter().any(|&v| v as usize >= mesh.positions.len()) {
            return None;
        }
        let [b1, b2] = sample.barycentrics;
        let weights = [(1.0 - b1 - b2).max(0.0), b1, b2];
        Some(Found { sample, mesh, indices, weights, rest_from_mesh: instance.rest_from_mesh })
    }

    fn rest_surface(&self) -> RestSurface {
        let corners = self.indices.map(|v| self.rest_from_mesh * self.mesh.positions[v as usize]);
        RestSurface {
            instance: self.sample.instance,
            position_rest: blend(corners, self.weights),
            normal_rest: self.geometric_normal(&corners, self.rest_from_mesh),
        }
    }

    /// −1 where the surface is seen from its back.
    fn facing(&self) -> f32 {
        if self.sample.back_face { -1.0 } else { 1.0 }
    }

    /// Unit normal of transformed corners on the viewer's side: a mirror turns the winding round.
    fn geometric_normal(&self, corners: &[Vec3; 3], linear: Mat3) -> Vec3 {
        let [a, b, c] = *corners;
        // Differences of edges lose less than those of far-away positions; f64 keeps small triangles apart from zero.
        let (e1, e2) = ((b - a).as_dvec3(), (c - a).as_dvec3());
        let normal = e1.cross(e2).normalize_or_zero().as_vec3();
        let mirror = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
        normal * (mirror * self.facing())
    }

    /// The interpolated (and mapped) normal in the world, not yet forced to a side; `None` if it vanishes.
    fn shading_normal(
        &self,
        scene: &Scene,
        pose: &Pose,
        material: u32,
        linear: Mat3,
        uv: &[Vec2; 2],
        corners_world: &[Vec3; 3],
    ) -> Option<Vec3> {
        let deformed = pose.instances.get(self.sample.instance as usize)?.deformed.as_ref();
        let normals = deformed.map_or(&self.mesh.normals, |d| &d.normals);
        let mut corners = [Vec3::ZERO; 3];
        for (corner, &v) in corners.iter_mut().zip(&self.indices) {
            *corner = *normals.get(v as usize)?;
        }
        // Cofactors are the inverse transpose up to the determinant, and defined for flat scales too.
        let mirror = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
        let cofactor = Mat3::from_cols(
            linear.y_axis.cross(linear.z_axis),
            linear.z_axis.cross(linear.x_axis),
            linear.x_axis.cross(linear.y_axis),
        );
        let normal = (cofactor * blend(corners, self.weights) * mirror).try_normalize()?;
        let mapped =
            self.mapped_normal(scene, material, linear, uv, corners_world, normal, deformed.is_some());
        Some(mapped.unwrap_or(normal) * self.facing())
    }

    /// The normal map's normal about the interpolated `normal` (front side), if there is a map and a tangent.
    #[allow(clippy::too_many_arguments)] // all of them are parts of one surface
    fn mapped_normal(
        &self,
        scene: &Scene,
        material: u32,
        linear: Mat3,
        uv: &[Vec2; 2],
        corners_world: &[Vec3; 3],
        normal: Vec3,
        deformed: bool,
    ) -> Option<Vec3> {
        let map = scene.materials.get(material as usize)?.normal_texture.as_ref()?;
        // Stored tangents are those of the mesh at rest: where vertices moved, the texture coordinates tell.
        let stored = if deformed { None } else { self.stored_tangent(linear) };
        let (tangent, up) = stored
            .map(|t| {
                let mirror = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
                (t.truncate(), normal.cross(t.truncate()) * (t.w * mirror))
            })
            .or_else(|| self.tangent_from_uv(&map.texture, corners_world))?;
        let tangent = (tangent - normal * normal.dot(tangent)).try_normalize()?;
        let bitangent = normal.cross(tangent);
        let bitangent = if bitangent.dot(up) < 0.0 { -bitangent } else { bitangent };
        let texel = texture::sample(scene, &map.texture, uv, Encoding::Linear);
        let n = texel.truncate() * 2.0 - 1.0;
        (tangent * (n.x * map.scale) + bitangent * (n.y * map.scale) + normal * n.z).try_normalize()
    }

    fn stored_tangent(&self, linear: Mat3) -> Option<Vec4> {
        let [a, b, c] = self.indices;
        let tangents = &self.mesh.tangents;
        let corners = [*tangents.get(a as usize)?, *tangents.get(b as usize)?, *tangents.get(c as usize)?];
        let tangent = linear * blend(corners.map(|t| t.truncate()), self.weights);
        Some(tangent.extend(if corners[0].w < 0.0 { -1.0 } else { 1.0 }))
    }

    /// Directions in which u grows and v falls (glTF's v points down, a normal map's green up).
    fn tangent_from_uv(&self, map: &TextureRef, corners: &[Vec3; 3]) -> Option<(Vec3, Vec3)> {
        let uvs = &self.mesh.uvs[usize::from(map.uv_set.min(1))];
        let mut uv = [Vec2::ZERO; 3];
        for (uv, &v) in uv.iter_mut().zip(&self.indices) {
            *uv = map.image_from_uv.transform_point2(*uvs.get(v as usize)?);
        }
        let (d1, d2) = (uv[1] - uv[0], uv[2] - uv[0]);
        let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
        let sign = if d1.perp_dot(d2) < 0.0 { -1.0 } else { 1.0 };
        let tangent = (e1 * d2.y - e2 * d1.y) * sign;
        let down = (e2 * d1.x - e1 * d2.x) * sign;
        Some((tangent.try_normalize()?, -down.try_normalize()?))
    }
}

/// `n` moved to the side of the unit normal `side` by the shortest way.
fn on_side_of(n: Vec3, side: Vec3) -> Vec3 {
    const SMALLEST_COSINE: f32 = 1e-3;
    let cosine = n.dot(side);
    if cosine >= SMALLEST_COSINE {
        return n;
    }
    (n + side * (SMALLEST_COSINE - cosine)).try_normalize().unwrap_or(side)
}

fn blend(corners: [Vec3; 3], weights: [f32; 3]) -> Vec3 {
    corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2]
}

/// Both texture coordinate sets at a place of a triangle; zero where the mesh has none.
pub(super) fn interpolate_uv(mesh: &Mesh, indices: [u32; 3], weights: [f32; 3]) -> [Vec2; 2] {
    [0, 1].map(|set| {
        let uvs = &mesh.uvs[set];
        indices
            .iter()
            .zip(weights)
            .map(|(&v, w)| uvs.get(v as usize).copied().unwrap_or(Vec2::ZERO) * w)
            .fold(Vec2::ZERO, |sum, uv| sum + uv)
    })
}

/// The vertex colour at a place of a triangle; white where the mesh has none.
pub(super) fn interpolate_color(mesh: &Mesh, indices: [u32; 3], weights: [f32; 3]) -> Vec4 {
    if mesh.colors.is_empty() {
        return Vec4::ONE;
    }
    indices
        .iter()
        .zip(weights)
        .map(|(&v, w)| mesh.colors.get(v as usize).copied().unwrap_or(Vec4::ONE) * w)
        .fold(Vec4::ZERO, |sum, c| sum + c)
}

/// The material of a triangle.
fn triangle_material(mesh: &Mesh, triangle: u32) -> Option<u32> {
    let after = mesh.parts.partition_point(|part| part.first_triangle <= triangle);
    // Empty parts may share a first triangle; the last of them starts the range.
    mesh.parts.get(after.checked_sub(1)?).map(|part| part.material)
}
