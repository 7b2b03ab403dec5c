//! The paper's server update ([Neff2023] sec. 3.3): points of posed local space, moved between cells as they move.
//!
//! Takes the pose, an [`Updater`] that holds every point's visibility at it, and what the viewer sees; returns which cells and
//! buckets changed. The measured baseline `psao-paper`. See `README.md`.

mod memory;
mod space;
#[cfg(test)]
mod tests;
mod view;

use std::sync::Arc;

use dapple_scene::{Pose, Scene};
use dapple_store::cells::{
    CellChanges, CellTable, Overflow, PackedPoint, TableLayoutError, VirtualGrid, pack_normal,
};
use glam::Vec3;
use rayon::prelude::*;

use super::generate::Anchor;
use super::update::{ConvexVolume, Updater};
pub use memory::{CellMemory, CellName, PointUpdate};
pub use view::extended_view;

/// When a point counts as changed. [Neff2023] sec. 3.3 asks for a threshold on visibility, position and normal, and gives none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperParams {
    /// A point is sent when its visibility (0 … 255) differs by more than this from what was last sent. Default 4.
    pub threshold: u8,
    /// Or when it lies further than this along an axis from where it was sent to be, in steps of a cell's edge / 32, ≥ 0.5, which is
    /// what packing alone does. Default 1.
    pub position_steps: f32,
    /// Or when its normal differs by more than this from the one sent, degrees; packing alone does up to 17.2. Default 20.
    pub normal_degrees: f32,
    /// Edge of a cell in spacings, > 0: twice the kernel's radius. Default 2.
    pub edge_spacings: f32,
}

impl Default for PaperParams {
    fn default() -> Self {
        PaperParams { threshold: 4, position_steps: 1.0, normal_degrees: 20.0, edge_spacings: 2.0 }
    }
}

/// Why no table could be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PaperError {
    /// A parameter is out of range.
    #[error("{name} is {value}, must be {must}")]
    BadParam {
        /// Which.
        name: &'static str,
        /// What it was.
        value: f32,
        /// What it may be.
        must: &'static str,
    },
    /// The grids cannot be made.
    #[error(transparent)]
    Table(#[from] TableLayoutError),
}

impl PaperParams {
    /// Finds whether the parameters lie in their ranges.
    ///
    /// # Errors
    /// The first one that does not.
    pub fn check(&self) -> Result<(), PaperError> {
        let check = |name, value: f32, good: bool, must| match good {
            true => Ok(()),
            false => Err(PaperError::BadParam { name, value, must }),
        };
        let PaperParams { position_steps, normal_degrees, edge_spacings, .. } = *self;
        check("position_steps", position_steps, position_steps >= 0.5, "at least 0.5")?;
        check("normal_degrees", normal_degrees, (0.0..=180.0).contains(&normal_degrees), "0 to 180")?;
        let is_edge = edge_spacings.is_finite() && edge_spacings > 0.0;
        check("edge_spacings", edge_spacings, is_edge, "positive and finite")
    }
}

/// What a step did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PaperCounts {
    /// Points whose change exceeded a threshold and that were in view.
    pub updated: u32,
    /// Points whose change exceeded a threshold but that were out of view: they wait.
    pub out_of_view: u32,
    /// Updated points that lay outside their instance's box and were held at its border.
    pub outside_box: u32,
    /// Cells to be sent.
    pub cells: u32,
    /// Buckets to be sent.
    pub buckets: u32,
}

/// The server's memory of the paper's scheme.
#[derive(Clone, Debug)]
pub struct PaperUpdater {
    params: PaperParams,
    sets: Vec<Set>,
    /// What was last sent of each point.
    sent: Vec<Sent>,
    memory: CellMemory,
}

#[derive(Clone, Copy, Debug)]
struct Set {
    instance: u32,
    first: u32,
    len: u32,
    bends: bool,
    grid: VirtualGrid,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sent {
    cell: [u32; 3],
    /// Not allocated: the point was nowhere.
    point: PackedPoint,
}

/// What is new of a point.
struct Found {
    point: u32,
    now: Sent,
    outside_box: bool,
    in_view: bool,
}

impl PaperUpdater {
    /// Puts every point into its cell at `pose`, with the visibility that `updater` holds.
    ///
    /// # Errors
    /// A parameter is out of range, or an instance's box has too many cells.
    pub fn new(
        scene: &Scene,
        pose: &Pose,
        updater: &Updater,
        params: PaperParams,
    ) -> Result<PaperUpdater, PaperError> {
        params.check()?;
        let (layout, anchors) = (updater.store().layout(), updater.anchors());
        let table = Arc::new(space::table_layout(scene, pose, layout, anchors, params.edge_spacings)?);
        let sets = layout.sets().iter().zip(table.grids()).map(|(set, grid)| Set {
            instance: set.instance,
            first: set.first,
            len: set.len() as u32,
            bends: scene.is_deformable(set.instance as usize),
            grid: grid.grid,
        });
        let mut paper = PaperUpdater {
            params,
            sets: sets.collect(),
            sent: vec![Sent::default(); layout.len()],
            memory: CellMemory::new(table, layout.len()),
        };
        paper.apply(paper.find(scene, pose, updater, None));
        paper.memory.commit();
        Ok(paper)
    }

    /// The table that subscribers are to hold.
    pub fn table(&self) -> &CellTable {
        self.memory.table()
    }

    /// Points that found no place, counted each time that they asked for one ([`CellMemory::overflow`]).
    pub fn overflow(&self) -> Overflow {
        self.memory.overflow()
    }

    /// Points that have no place now.
    pub fn unplaced(&self) -> usize {
        self.sent.len() - self.memory.placed()
    }

    /// Brings the table up to `pose`, where `updater` holds every point's visibility at it; points out of `view` keep what was
    /// last sent of them until they come into it (`None`: everything is in view).
    pub fn step(
        &mut self,
        scene: &Scene,
        pose: &Pose,
        updater: &Updater,
        view: Option<&ConvexVolume>,
    ) -> (CellChanges, PaperCounts) {
        let found = self.find(scene, pose, updater, view);
        let mut counts = self.apply(found);
        let changes = self.memory.commit();
        (counts.cells, counts.buckets) = (changes.cells.len() as u32, changes.buckets.len() as u32);
        (changes, counts)
    }

    /// Every point that changed by more than a threshold, in order.
    fn find(&self, scene: &Scene, pose: &Pose, updater: &Updater, view: Option<&ConvexVolume>) -> Vec<Found> {
        let (anchors, visibility) = (updater.anchors(), updater.store().visibility());
        let edge_m = self.memory.table().layout().edge_m();
        let least_cosine = libm::cosf(self.params.normal_degrees.to_radians());
        let of_point = |set: &Set, point: usize| -> Option<Found> {
            let (anchor, value, sent) = (&anchors[point], visibility[point], &self.sent[point]);
            let is_new = !sent.point.is_allocated();
            let mut changed = value.abs_diff(sent.point.visibility()) > self.params.threshold;
            let (now, outside_box) = if !set.bends && !is_new {
                (Sent { point: sent.point.with_visibility(value), ..*sent }, false)
            } else {
                match anchor.pose_local(scene, pose, set.instance as usize) {
                    None => (Sent::default(), false),
                    Some(posed) => {
                        let position_cells = set.grid.position_cells(posed.position, edge_m);
                        let held = hold(&set.grid, position_cells);
                        let corner = Vec3::from_array(sent.cell.map(|c| c as f32));
                        let moved_cells = (held - corner - sent.point.position_in_cell()).abs().max_element();
                        changed |= is_new
                            || moved_cells * PackedPoint::STEPS > self.params.position_steps
                            || posed.normal.dot(sent.point.normal()) < least_cosine;
                        let cell = set.grid.cell(held);
                        let point = PackedPoint::pack(held, cell, pack_normal(posed.normal), value);
                        (Sent { cell, point }, !set.grid.contains(position_cells))
                    }
                }
            };
            changed |= now.point.is_allocated() != sent.point.is_allocated();
            // Where nothing was and nothing is, there is nothing to say.
            if !changed || is_new && !now.point.is_allocated() {
                return None;
            }
            let in_view = view.is_none_or(|view| is_in(view, anchor, scene, pose, set.instance));
            Some(Found { point: point as u32, now, outside_box, in_view })
        };
        self.sets
            .par_iter()
            .flat_map(|set| {
                let points = (set.first..set.first + set.len).into_par_iter().with_min_len(1024);
                points.filter_map(|point| of_point(set, point as usize))
            })
            .collect()
    }

    fn apply(&mut self, found: Vec<Found>) -> PaperCounts {
        let mut counts = PaperCounts::default();
        let mut updates: Vec<PointUpdate> = Vec::with_capacity(found.len());
        let mut sets = self.sets.iter().peekable();
        for Found { point, now, outside_box, in_view } in found {
            if !in_view {
                counts.out_of_view += 1;
                continue;
            }
            counts.updated += 1;
            counts.outside_box += u32::from(outside_box);
            while sets.next_if(|set| set.first + set.len <= point).is_some() {}
            let to = sets.peek().filter(|_| now.point.is_allocated()).map(|Set { grid, .. }| {
                let name = CellName { bucket: grid.bucket(now.cell), key: grid.key(now.cell) };
                (name, now.point)
            });
            updates.push((point, to));
            self.sent[point as usize] = now;
        }
        self.memory.update(&updates);
        counts
    }
}

/// A place in cells, held in the grid.
fn hold(grid: &VirtualGrid, position_cells: Vec3) -> Vec3 {
    position_cells.clamp(Vec3::ZERO, Vec3::from_array(grid.dims.map(|d| d as f32)))
}

/// Whether a point is in view; a collapsed triangle counts as seen.
fn is_in(view: &ConvexVolume, anchor: &Anchor, scene: &Scene, pose: &Pose, instance: u32) -> bool {
    anchor.pose(scene, pose, instance as usize).is_none_or(|posed| view.contains(posed.position))
}
