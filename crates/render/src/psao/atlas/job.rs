//! Makes one instance after the other ready, a piece of work at a time.

use std::sync::Arc;

use dapple_scene::Scene;
use dapple_store::charts::{
    ChartBuilder, ChartParams, ChartSet, InstanceKey, PointNeighbours, SiteFinder, add_back_sites,
};
use glam::Vec3;

use super::pages::PlacedPages;
use super::resolve::{Builder, PointTexels, Sums, add_values};
use super::{BuildError, ReadySet, SetState, VisibilityAtlas};

/// The set that is being made.
pub(super) struct Job {
    pub(super) set: usize,
    /// Empty until they are made.
    pub(super) charts: Arc<ChartSet>,
    pub(super) charts_key: InstanceKey,
    pub(super) stage: Stage,
}

pub(super) enum Stage {
    Charts(Box<ChartBuilder>),
    Sites {
        finder: Box<SiteFinder>,
        /// Of the mesh.
        positions_rest: Vec<Vec3>,
    },
    Weigh(Box<Builder>),
    Encode(Box<Builder>),
    /// Points before `next` are in the sums.
    Sum {
        table: PointTexels,
        sums: Sums,
        next: usize,
    },
}

/// Texels of work that other steps are worth, in parts of a weighed texel.
const TRIANGLES_A_TEXEL: usize = 8;
pub(super) const VISITS_A_TEXEL: usize = 32;
const SITES_A_TEXEL: usize = 32;
pub(super) const ENCODED_A_TEXEL: usize = 16;
pub(super) const SUMMED_A_TEXEL: usize = 16;

/// Most texels: so many for each point, and some for small meshes with few points.
const TEXELS_A_POINT: u64 = 16;
const SPARE_TEXELS: u64 = 1 << 20;

impl VisibilityAtlas {
    /// Begins to make the charts of a set, or takes those of an instance with the same.
    pub(super) fn begin(&mut self, scene: &Scene, set: usize) -> (Option<Job>, usize) {
        let instance_index = self.layout.sets()[set].instance;
        let instance = &scene.instances[instance_index as usize];
        let mesh = &scene.meshes[instance.mesh as usize];
        let defaults = ChartParams::for_spacing(self.layout.spacing_m(), self.moves[instance_index as usize]);
        let key = InstanceKey {
            mesh: instance.mesh,
            rest_from_mesh: instance.rest_from_mesh,
            texel_m: defaults.texel_m * self.params.texel_factor,
        };
        let same = self.sets.iter().find_map(|state| match state {
            SetState::Ready(ready) if ready.charts_key == key => Some(ready.charts.clone()),
            _ => None,
        });
        if let Some(charts) = same {
            if let Err(error) = self.check_room(scene.is_two_sided(mesh), &charts) {
                self.failed.push((instance_index, error));
                return (None, 1);
            }
            let stage = Stage::sites(&charts, key.positions_rest(&mesh.positions));
            return (Some(Job { set, charts, charts_key: key, stage }), 1);
        }
        let cost = mesh.triangles.len() / TRIANGLES_A_TEXEL + 1;
        let positions_rest = key.positions_rest(&mesh.positions);
        match ChartBuilder::new(&positions_rest, &mesh.triangles, &key.params(&defaults)) {
            Ok(builder) => {
                let stage = Stage::Charts(Box::new(builder));
                (Some(Job { set, charts: Arc::default(), charts_key: key, stage }), cost)
            }
            Err(error) => {
                self.failed.push((instance_index, error.into()));
                (None, cost)
            }
        }
    }

    /// To be asked before anything is made that grows with the texels of a chart set.
    fn check_room(&self, two_sided: bool, charts: &ChartSet) -> Result<(), BuildError> {
        let sides = if two_sided { 2 } else { 1 };
        let (needed, limit) = (self.texels + sides * u64::from(charts.texel_count()), self.max_texels());
        if needed > limit { Err(BuildError::TooManyTexels { needed, limit }) } else { Ok(()) }
    }

    pub(super) fn max_texels(&self) -> u64 {
        let of_points = TEXELS_A_POINT * self.layout.len() as u64 + SPARE_TEXELS;
        self.params.max_texels.unwrap_or(of_points)
    }

    /// One step of a job, at most `budget` texels of it where it can be cut; gives what it cost.
    pub(super) fn advance(&mut self, scene: &Scene, visibility: &[u8], job: Job, budget: usize) -> usize {
        let layout = self.layout.clone();
        let set = &layout.sets()[job.set];
        let mut job = job;
        let cost;
        job.stage = match job.stage {
            Stage::Charts(mut builder) => match builder.work(budget.saturating_mul(VISITS_A_TEXEL)) {
                Ok((visits, charts)) => {
                    cost = visits / VISITS_A_TEXEL;
                    match charts {
                        Some(charts) => {
                            let mesh = &scene.meshes[scene.instances[set.instance as usize].mesh as usize];
                            if let Err(error) = self.check_room(scene.is_two_sided(mesh), &charts) {
                                self.failed.push((set.instance, error));
                                return 1;
                            }
                            job.charts = Arc::new(charts);
                            Stage::sites(&job.charts, job.charts_key.positions_rest(&mesh.positions))
                        }
                        None => Stage::Charts(builder),
                    }
                }
                Err(error) => {
                    self.failed.push((set.instance, error.into()));
                    return 1;
                }
            },
            Stage::Sites { mut finder, positions_rest } => {
                let mesh = &scene.meshes[scene.instances[set.instance as usize].mesh as usize];
                let visits = budget.saturating_mul(VISITS_A_TEXEL);
                let visited = finder.work(&job.charts, &positions_rest, &mesh.triangles, visits);
                if visited > 0 {
                    job.stage = Stage::Sites { finder, positions_rest };
                    self.job = Some(job);
                    return visited / VISITS_A_TEXEL;
                }
                let mut sites = finder.finish();
                let mut texels = job.charts.texel_count();
                if scene.is_two_sided(mesh) {
                    add_back_sites(&mut sites, texels);
                    texels *= 2;
                }
                let neighbours = PointNeighbours::new(&layout, set, &self.params.weights);
                cost = sites.len() / SITES_A_TEXEL;
                let kernel = &self.params.weights.kernel;
                let cuts = self.cuts.as_ref().and_then(|cuts| cuts.for_sites(set.instance, &sites, kernel));
                let cuts = cuts.map_or(Vec::new(), |set| set.cuts.clone());
                Stage::Weigh(Box::new(Builder::new(neighbours, set, sites, cuts, texels)))
            }
            Stage::Weigh(mut builder) => {
                let before = builder.weighed();
                builder.weigh(set, budget);
                cost = builder.weighed() - before;
                if builder.weighed() == builder.sites() {
                    builder.begin_encoding();
                    Stage::Encode(builder)
                } else {
                    Stage::Weigh(builder)
                }
            }
            Stage::Encode(mut builder) => {
                let before = builder.encoded();
                builder.encode(budget.saturating_mul(ENCODED_A_TEXEL));
                cost = (builder.encoded() - before) / ENCODED_A_TEXEL;
                if builder.encoded() == builder.sites() {
                    let (table, sums) = builder.finish();
                    Stage::Sum { table, sums, next: 0 }
                } else {
                    Stage::Encode(builder)
                }
            }
            Stage::Sum { table, mut sums, next } => {
                let end = next.saturating_add(budget.saturating_mul(SUMMED_A_TEXEL)).min(set.len());
                let first = set.first as usize;
                add_values(&table, &mut sums, &visibility[first..first + set.len()], next..end);
                cost = (end - next) / SUMMED_A_TEXEL;
                if end == set.len() {
                    self.place(job.set, job.charts, job.charts_key, table, sums);
                    return cost;
                }
                Stage::Sum { table, sums, next: end }
            }
        };
        self.job = Some(job);
        cost
    }

    /// Gives a finished set its place in the layers.
    fn place(
        &mut self,
        set: usize,
        charts: Arc<ChartSet>,
        charts_key: InstanceKey,
        table: PointTexels,
        sums: Sums,
    ) {
        // The back's texels follow the front's.
        let sides = if sums.len() > charts.texel_count() as usize { 2 } else { 1 };
        let placements = match self.pages.place(&charts.pages().repeat(sides)) {
            Ok(placements) => placements,
            Err(error) => {
                self.failed.push((self.layout.sets()[set].instance, error.into()));
                return;
            }
        };
        self.texels += sums.len() as u64;
        let placed = PlacedPages::new(&charts, &placements, self.pages.side());
        for ((first, size), placement) in placed.firsts().zip(charts.pages().iter().cycle()).zip(&placements)
        {
            self.pages.fill(*placement, *size, |i| [255, sums.value(first + i)]);
        }
        let ready =
            ReadySet { charts, charts_key, table, sums, bent: None, lights: None, placements, placed };
        self.sets[set] = SetState::Ready(Box::new(ready));
        self.fresh.push(set);
        self.ready.push(self.layout.sets()[set].instance);
    }
}

impl Stage {
    fn sites(charts: &ChartSet, positions_rest: Vec<Vec3>) -> Stage {
        Stage::Sites { finder: Box::new(SiteFinder::new(charts)), positions_rest }
    }
}

impl Job {
    pub(super) fn memory_bytes(&self) -> u64 {
        let stage = match &self.stage {
            Stage::Charts(_) | Stage::Sites { .. } => 0,
            Stage::Weigh(builder) | Stage::Encode(builder) => builder.bytes(),
            Stage::Sum { table, sums, .. } => table.bytes() + sums.bytes(),
        };
        self.charts.memory_bytes() + stage as u64
    }
}
