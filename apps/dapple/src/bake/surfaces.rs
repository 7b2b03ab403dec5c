//! The posed surfaces of a scene: places on them, and what is measured there.

use dapple_scene::glam::{Mat3, Vec3};
use dapple_scene::{Pose, Scene};
use dapple_trace::Tracer;
use dapple_trace::inside::{Solids, is_inside};
use dapple_trace::rtao::{BentVisibility, RtaoParams, Site, SmoothSite, trace_bent};
use rayon::prelude::*;

/// A scene in one pose, and the rays through it.
pub(crate) struct Surfaces<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) pose: &'a Pose,
    tracer: Tracer,
    solids: Solids,
    /// Whether an instance's map turns counter-clockwise into clockwise.
    mirrored: Vec<bool>,
    /// Inverse transpose of each instance's map.
    normal_maps: Vec<Mat3>,
    params: RtaoParams,
    /// Whether bent normals are wanted too.
    bent: bool,
}

/// A place on a triangle of an instance; the weights are those of its second and third corner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Place {
    pub(crate) instance: u32,
    pub(crate) triangle: u32,
    pub(crate) weights: [f32; 2],
    /// Chooses the directions of its rays: places that are averaged share a key …
    pub(crate) key: u64,
    /// … and divide its directions among them.
    pub(crate) turn: u32,
}

/// What was measured at a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Measured {
    /// 1 open, 0 blocked.
    pub(crate) visibility: f32,
    /// Mean of the open directions in the space of the mesh ([`BentVisibility::open_world`]), zero if not wanted.
    pub(crate) open_mesh: Vec3,
    /// Nobody can see this place: it lies inside of a body, or is cut out by its material's alpha.
    pub(crate) hidden: bool,
}

/// Least cosine between the normal that a place is shaded with and that of its face.
const LEAST_SHADING_COSINE: f32 = 0.3;

/// Fewest rays a place of one of several instances.
const LEAST_RAYS: u32 = 8;

/// Sums what was measured; hidden places count only while nothing else was measured.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sum {
    visibility: f32,
    open_mesh: Vec3,
    seen: u32,
    hidden: u32,
}

impl Sum {
    pub(crate) fn add(&mut self, measured: &Measured) {
        let is_first_seen = !measured.hidden && self.seen == 0;
        if is_first_seen {
            (self.visibility, self.open_mesh) = (0.0, Vec3::ZERO);
        }
        if !measured.hidden || self.seen == 0 {
            self.visibility += measured.visibility;
            self.open_mesh += measured.open_mesh;
        }
        self.seen += u32::from(!measured.hidden);
        self.hidden += u32::from(measured.hidden);
    }

    /// The mean; hidden if all was. All open where nothing was measured.
    pub(crate) fn mean(&self) -> Measured {
        let count = if self.seen > 0 { self.seen } else { self.hidden };
        if count == 0 {
            return Measured { visibility: 1.0, open_mesh: Vec3::ZERO, hidden: true };
        }
        let scale = 1.0 / count as f32;
        Measured {
            visibility: self.visibility * scale,
            open_mesh: self.open_mesh * scale,
            hidden: self.seen == 0,
        }
    }
}

impl<'a> Surfaces<'a> {
    pub(crate) fn new(scene: &'a Scene, pose: &'a Pose, params: RtaoParams, bent: bool) -> Surfaces<'a> {
        let mirrored =
            pose.instances.iter().map(|posed| posed.world_from_mesh.matrix3.determinant() < 0.0).collect();
        let normal_map = |posed: &dapple_scene::PosedInstance| {
            Mat3::from(posed.world_from_mesh.matrix3).inverse().transpose()
        };
        let normal_maps = pose.instances.iter().map(normal_map).collect();
        let (tracer, solids) = (Tracer::new(scene, pose), Solids::new(scene));
        Surfaces { scene, pose, tracer, solids, mirrored, normal_maps, params, bent }
    }

    pub(crate) fn params(&self) -> RtaoParams {
        self.params
    }

    /// Whether bent normals are measured.
    pub(crate) fn measures_bent(&self) -> bool {
        self.bent
    }

    /// The mesh of an instance.
    pub(crate) fn mesh_of(&self, instance: usize) -> &'a dapple_scene::Mesh {
        &self.scene.meshes[self.scene.instances[instance].mesh as usize]
    }

    /// Corners of a triangle in the world.
    pub(crate) fn corners_world(&self, instance: usize, triangle: usize) -> [Vec3; 3] {
        let positions = self.scene.vertex_positions(self.pose, instance);
        let map = &self.pose.instances[instance].world_from_mesh;
        self.mesh_of(instance).triangles[triangle].map(|v| map.transform_point3(positions[v as usize]))
    }

    /// Area of a triangle in the world, 0 if it cannot be told.
    pub(crate) fn area_m2(&self, instance: usize, triangle: usize) -> f64 {
        let [a, b, c] = self.corners_world(instance, triangle).map(|p| p.as_dvec3());
        let area = 0.5 * (b - a).cross(c - a).length();
        if area.is_finite() { area } else { 0.0 }
    }

    /// Where rays start at a place, and on which side; without a normal where the triangle has no area.
    fn site(&self, place: &Place) -> Site {
        let instance = place.instance as usize;
        let [a, b, c] = self.corners_world(instance, place.triangle as usize);
        let [v, w] = place.weights;
        let face = (b - a).cross(c - a).try_normalize().unwrap_or(Vec3::ZERO);
        let normal_world = if self.mirrored[instance] { -face } else { face };
        Site { position_world: a + (b - a) * v + (c - a) * w, normal_world, key: place.key }
    }

    /// Measures places with so many rays each, in parallel.
    pub(crate) fn measure(&self, places: &[Place], rays: u32) -> Vec<Measured> {
        let sites: Vec<SmoothSite> =
            places.par_iter().with_min_len(256).map(|place| self.smooth_site(place, rays)).collect();
        let params = RtaoParams { rays, ..self.params };
        let mut bent = vec![BentVisibility::default(); sites.len()];
        trace_bent(&self.tracer, &sites, &params, &mut bent);
        let finish =
            |directions: &mut Vec<Vec3>,
             ((place, smooth), bent): ((&Place, &SmoothSite), &BentVisibility)| {
                let site = &smooth.site;
                Measured {
                    visibility: bent.visibility,
                    open_mesh: if self.bent { self.to_mesh(place, bent.open_world) } else { Vec3::ZERO },
                    hidden: site.normal_world == Vec3::ZERO
                        || self.is_hole(place)
                        || is_inside(self.scene, &self.tracer, &self.solids, site, directions),
                }
            };
        places.par_iter().zip(&sites).zip(&bent).with_min_len(64).map_init(Vec::new, finish).collect()
    }

    /// Where rays start at a place, and the normal that it is shaded with.
    fn smooth_site(&self, place: &Place, rays: u32) -> SmoothSite {
        let site = self.site(place);
        let instance = place.instance as usize;
        let posed = &self.pose.instances[instance];
        let mesh = self.mesh_of(instance);
        let normals = posed.deformed.as_ref().map_or(&mesh.normals, |deformed| &deformed.normals);
        let [a, b, c] = mesh.triangles[place.triangle as usize].map(|v| normals[v as usize]);
        let [v, w] = place.weights;
        let between = a * (1.0 - v - w) + b * v + c * w;
        let shading = (self.normal_maps[instance] * between).normalize_or_zero();
        // A normal far from the face's is a slip of its maker.
        let usable = shading.is_finite() && shading.dot(site.normal_world) > LEAST_SHADING_COSINE;
        let shading_normal_world = if usable { shading } else { site.normal_world };
        let first_ray = place.turn.saturating_mul(rays);
        let axes_world = self.axes(place, shading_normal_world);
        SmoothSite { site, shading_normal_world, first_ray, axes_world }
    }

    /// Axes about a normal that turn with the instance, and are mirrored where it is, so that the same place of equal instances
    /// in equal surroundings measures the same; `None` for a triangle without a first edge across the normal.
    fn axes(&self, place: &Place, normal_world: Vec3) -> Option<[Vec3; 2]> {
        let instance = place.instance as usize;
        let [a, b, _] = self.corners_world(instance, place.triangle as usize);
        let edge = (b - a).try_normalize()?;
        let x = (edge - normal_world * edge.dot(normal_world)).try_normalize()?;
        let y = normal_world.cross(x);
        Some([x, if self.mirrored[instance] { -y } else { y }])
    }

    /// Measures places on several instances of one mesh, and gives the mean of what can be seen; `rays` are shared among them.
    pub(crate) fn measure_mean(&self, members: &[u32], places: &[Place], rays: u32) -> Vec<Measured> {
        let rays = rays.div_ceil(members.len().max(1) as u32).max(LEAST_RAYS.min(rays));
        let mut sums: Vec<Sum> = vec![Sum::default(); places.len()];
        let mut moved = places.to_vec();
        for (turn, &member) in (0u32..).zip(members) {
            for (moved, place) in moved.iter_mut().zip(places) {
                moved.instance = member;
                moved.turn = place.turn * members.len() as u32 + turn;
            }
            for (sum, measured) in sums.iter_mut().zip(self.measure(&moved, rays)) {
                sum.add(&measured);
            }
        }
        sums.iter().map(Sum::mean).collect()
    }

    fn is_hole(&self, place: &Place) -> bool {
        self.scene.is_hole(self.mesh_of(place.instance as usize), place.triangle, place.weights)
    }

    /// A direction of light in the space that the mesh's normals are given in: those who transform it as a normal get back
    /// the direction in the world. On a mesh that bends it turns with its triangle.
    fn to_mesh(&self, place: &Place, direction_world: Vec3) -> Vec3 {
        let instance = place.instance as usize;
        let posed = &self.pose.instances[instance];
        let mesh = self.mesh_of(instance);
        let length = direction_world.length();
        // Normals go to the world by the inverse transpose, so back by the transpose.
        let mut direction = Mat3::from(posed.world_from_mesh.matrix3).transpose() * direction_world;
        if posed.deformed.is_some() {
            let positions = self.scene.vertex_positions(self.pose, instance);
            let corners = mesh.triangles[place.triangle as usize];
            let (bent, rest) =
                (corners.map(|v| positions[v as usize]), corners.map(|v| mesh.positions[v as usize]));
            if let (Some(bent), Some(rest)) = (frame(bent), frame(rest)) {
                direction = rest * (bent.transpose() * direction);
            }
        }
        direction.normalize_or_zero() * length
    }
}

/// Axes along a triangle's first edge, within its plane, and along its normal.
fn frame([a, b, c]: [Vec3; 3]) -> Option<Mat3> {
    let x = (b - a).try_normalize()?;
    let z = (b - a).cross(c - a).try_normalize()?;
    Some(Mat3::from_cols(x, z.cross(x), z))
}
