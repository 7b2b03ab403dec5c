//! Places spread evenly over all surfaces of a scene, at rest and in the world, and the truth there.

use anyhow::Result;
use dapple_render::gbuffer::RestSurface;
use dapple_scene::glam::Vec3;
use dapple_scene::{Pose, Scene};
use dapple_trace::Tracer;
use dapple_trace::psao::generate::{GenerateParams, generate_points};
use dapple_trace::rtao::{RtaoParams, Site, trace_visibility};

/// A place on a surface, as every reconstruction wants it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) rest: RestSurface,
    pub(super) triangle: u32,
    /// On the side from which the triangle's vertices run clockwise.
    pub(super) back: bool,
    /// Weights of vertices 1 and 2.
    pub(super) barycentrics: [f32; 2],
    pub(super) position_world: Vec3,
    pub(super) normal_world: Vec3,
}

/// Places and what is true there.
pub(super) struct Samples {
    pub(super) places: Vec<Place>,
    /// Whether the animation moves the place's instance.
    pub(super) moving: Vec<bool>,
    pub(super) truth: Vec<f32>,
}

/// How places are spread and their truth is found.
#[derive(Debug, Clone, Copy)]
pub(super) struct SampleParams {
    /// Places a square metre.
    pub(super) per_m2: f32,
    pub(super) rays: u32,
    pub(super) radius_m: f32,
    pub(super) seed: u32,
}

impl Samples {
    /// Places like points: evenly spread, both sides of double-sided surfaces, none in holes or inside geometry. They
    /// are not the points themselves: the seed is another. `rest_pose` is the scene at time 0, `pose` the one that is lit.
    pub(super) fn new(
        scene: &Scene,
        (rest_pose, rest_tracer): (&Pose, &Tracer),
        (pose, tracer): (&Pose, &Tracer),
        params: &SampleParams,
    ) -> Result<Samples> {
        let generate = GenerateParams {
            // Half of what is spawned is kept.
            points_per_m2: 2.0 * params.per_m2,
            seed: params.seed ^ 0x5eed_0000,
            ..GenerateParams::default()
        };
        let points = generate_points(scene, rest_pose, rest_tracer, &generate, &|_| ())?;
        let moves = scene.moving_instances();
        let mut places = Vec::new();
        for set in points.layout.sets() {
            let anchors = &points.anchors[set.first as usize..set.first as usize + set.len()];
            places.extend(anchors.iter().filter_map(|anchor| {
                place(scene, pose, set.instance, anchor.triangle(), anchor.barycentrics(), anchor.is_back())
            }));
        }
        let moving = places.iter().map(|p| moves[p.rest.instance as usize]).collect();
        let sites: Vec<Site> = (0u64..)
            .zip(&places)
            .map(|(key, p)| Site { position_world: p.position_world, normal_world: p.normal_world, key })
            .collect();
        let mut truth = vec![0.0; sites.len()];
        let rtao =
            RtaoParams { rays: params.rays, radius_m: params.radius_m, seed: u64::from(params.seed) + 1 };
        trace_visibility(tracer, &sites, &rtao, &mut truth);
        Ok(Samples { places, moving, truth })
    }

    /// What reconstructions take.
    pub(super) fn fragments(&self) -> Vec<Option<RestSurface>> {
        self.places.iter().map(|p| Some(p.rest)).collect()
    }
}

/// A place on a triangle, or `None` where it has no area at rest or in the pose.
fn place(
    scene: &Scene,
    pose: &Pose,
    instance: u32,
    triangle: u32,
    barycentrics: [f32; 2],
    back: bool,
) -> Option<Place> {
    let placed = &scene.instances[instance as usize];
    let mesh = &scene.meshes[placed.mesh as usize];
    let posed = &pose.instances[instance as usize];
    let vertices = scene.vertex_positions(pose, instance as usize);
    let indices = mesh.triangles[triangle as usize];
    let on = |corners: [Vec3; 3], mirrored: bool| {
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).try_normalize()?;
        let position = a + (b - a) * barycentrics[0] + (c - a) * barycentrics[1];
        Some((position, if mirrored != back { -normal } else { normal }))
    };
    let at_rest = indices.map(|v| placed.rest_from_mesh * mesh.positions[v as usize]);
    let (position_rest, normal_rest) = on(at_rest, placed.rest_from_mesh.determinant() < 0.0)?;
    let world = &posed.world_from_mesh;
    let in_world = indices.map(|v| world.transform_point3(vertices[v as usize]));
    let (position_world, normal_world) = on(in_world, world.matrix3.determinant() < 0.0)?;
    let rest = RestSurface { instance, position_rest, normal_rest };
    Some(Place { rest, triangle, back, barycentrics, position_world, normal_world })
}

/// Errors of one method over a class of places.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Errors {
    pub(super) places: u64,
    squares: f64,
    sum: f64,
}

impl Errors {
    /// Over the places that `class` accepts, by index.
    pub(super) fn over(truth: &[f32], found: &[f32], class: impl Fn(usize) -> bool) -> Errors {
        let mut errors = Errors::default();
        for (_, (truth, found)) in truth.iter().zip(found).enumerate().filter(|(i, _)| class(*i)) {
            let error = f64::from(*found) - f64::from(*truth);
            errors.places += 1;
            errors.squares += error * error;
            errors.sum += error;
        }
        errors
    }

    /// dB, peak 1; `None` without places or error.
    pub(super) fn psnr_db(&self) -> Option<f64> {
        (self.squares > 0.0).then(|| -10.0 * (self.squares / self.places as f64).log10())
    }

    /// Mean of found − truth; `None` without places.
    pub(super) fn bias(&self) -> Option<f64> {
        (self.places > 0).then(|| self.sum / self.places as f64)
    }
}
