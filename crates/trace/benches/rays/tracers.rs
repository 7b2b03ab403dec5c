//! Who is compared: each answers the same rays in its own best way.

use std::ops::Range;

use dapple_scene::glam::Vec3;
use dapple_trace::{Ray, Tracer};
use obvhs::cwbvh::CwBvh;
use obvhs::triangle::Triangle;
use parry3d::math::Vector;
use parry3d::query::RayCast;
use parry3d::shape::TriMesh;

use crate::embree::{self, Quality};
use crate::rays::{Batch, RAYS};

/// A column of the table: the fastest of its modes stands there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Column {
    Ours,
    OursSingle,
    Embree1,
    Embree8,
    Embree16,
    Obvhs,
    Parry,
}

impl Column {
    pub(crate) const ALL: [Column; 7] = [
        Column::Ours,
        Column::OursSingle,
        Column::Embree1,
        Column::Embree8,
        Column::Embree16,
        Column::Obvhs,
        Column::Parry,
    ];

    pub(crate) fn title(self) -> &'static str {
        match self {
            Column::Ours => "ours",
            Column::OursSingle => "1 ray",
            Column::Embree1 => "Embree1",
            Column::Embree8 => "Embree8",
            Column::Embree16 => "Embr.16",
            Column::Obvhs => "obvhs",
            Column::Parry => "parry",
        }
    }

    pub(crate) fn is_embree(self) -> bool {
        matches!(self, Column::Embree1 | Column::Embree8 | Column::Embree16)
    }
}

/// What is traced: some points of a batch, each `step`-th.
pub(crate) struct Job<'a> {
    pub(crate) batch: &'a Batch,
    pub(crate) t_max: f32,
    pub(crate) points: Range<usize>,
    pub(crate) step: usize,
}

impl Job<'_> {
    pub(crate) fn rays(&self) -> usize {
        self.points.len().div_ceil(self.step) * RAYS
    }

    /// Calls `trace` for each point; bit `i` of its answer says that ray `i` is blocked.
    #[inline]
    fn each(&self, blocked: &mut [u64], trace: impl Fn(usize) -> u64) {
        for point in self.points.clone().step_by(self.step) {
            blocked[point - self.points.start] = trace(point);
        }
    }

    /// As [`Job::each`], a ray at a time: origin and direction.
    #[inline]
    fn each_ray(&self, blocked: &mut [u64], is_blocked: impl Fn(Vec3, Vec3) -> bool) {
        self.each(blocked, |point| {
            let origin = self.batch.origins[point];
            let rays = self.batch.directions(point).iter().enumerate();
            rays.fold(0, |mask, (i, &direction)| mask | u64::from(is_blocked(origin, direction)) << i)
        });
    }
}

/// Answers a job: writes a mask for each of its points.
type Trace<'a> = Box<dyn Fn(&Job, &mut [u64]) + Sync + 'a>;

/// One way to trace.
pub(crate) struct Candidate<'a> {
    pub(crate) name: String,
    pub(crate) column: Column,
    /// Only each so many-th point is timed: slow ones would hold the others up.
    pub(crate) step: usize,
    pub(crate) trace: Trace<'a>,
}

impl<'a> Candidate<'a> {
    fn new(
        name: impl Into<String>,
        column: Column,
        trace: impl Fn(&Job, &mut [u64]) + Sync + 'a,
    ) -> Candidate<'a> {
        Candidate { name: name.into(), column, step: 1, trace: Box::new(trace) }
    }
}

/// Both of our queries.
pub(crate) fn ours(tracer: &Tracer) -> [Candidate<'_>; 2] {
    let packets = move |job: &Job, blocked: &mut [u64]| {
        let batch = job.batch;
        job.each(blocked, |p| tracer.occlusion(batch.origins[p], batch.directions(p), job.t_max)[0]);
    };
    let singles = move |job: &Job, blocked: &mut [u64]| {
        job.each_ray(blocked, |origin_world, direction_world| {
            tracer.occluded(&Ray { origin_world, direction_world, t_max: job.t_max })
        });
    };
    [
        Candidate::new("occlusion", Column::Ours, packets),
        Candidate::new("occluded", Column::OursSingle, singles),
    ]
}

/// All of Embree's ways to ask a scene.
pub(crate) fn embree(scene: &embree::Scene, quality: Quality) -> Vec<Candidate<'_>> {
    fn packets<const N: usize>(
        scene: &embree::Scene,
        quality: Quality,
        column: Column,
        coherent: bool,
    ) -> Candidate<'_> {
        let quality = if quality == Quality::High { "high" } else { "med" };
        let flag = if coherent { " coh" } else { "" };
        Candidate::new(format!("{N} {quality}{flag}"), column, move |job: &Job, blocked: &mut [u64]| {
            let batch = job.batch;
            job.each(blocked, |p| {
                scene.occlusion::<N>(batch.origins[p], &batch.arranged[p], job.t_max, coherent)
            });
        })
    }
    let mut all = vec![packets::<1>(scene, quality, Column::Embree1, false)];
    for coherent in [false, true] {
        all.push(packets::<8>(scene, quality, Column::Embree8, coherent));
        all.push(packets::<16>(scene, quality, Column::Embree16, coherent));
    }
    all
}

/// A compressed eight-wide tree of `obvhs`, a ray at a time, to the first hit found.
pub(crate) fn obvhs<'a>(tree: &'a CwBvh, triangles: &'a [Triangle]) -> Candidate<'a> {
    Candidate::new("obvhs", Column::Obvhs, move |job: &Job, blocked: &mut [u64]| {
        job.each_ray(blocked, |origin, direction| {
            let ray = obvhs::ray::Ray::new(origin.into(), direction.into(), 0.0, job.t_max);
            !tree
                .ray_traverse_miss(ray, |ray, i| triangles[tree.primitive_indices[i] as usize].intersect(ray))
        });
    })
}

/// `parry`'s triangle mesh, a ray at a time, to the nearest hit: it has no other query.
pub(crate) fn parry(mesh: &TriMesh) -> Candidate<'_> {
    let mut candidate = Candidate::new("parry", Column::Parry, move |job: &Job, blocked: &mut [u64]| {
        job.each_ray(blocked, |origin, direction| {
            let vector = |v: Vec3| Vector::new(v.x, v.y, v.z);
            let ray = parry3d::query::Ray::new(vector(origin), vector(direction));
            mesh.intersects_local_ray(&ray, job.t_max)
        });
    });
    candidate.step = 8;
    candidate
}
