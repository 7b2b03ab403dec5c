//! The paper's scheme: the table is what the points say, whatever way it came about, and only changes make bytes.

use std::collections::BTreeMap;

use dapple_scene::PosedCamera;
use dapple_scene::glam::{Affine3A, Quat};
use dapple_store::cells::{CELL_POINTS, InstanceGrid, TableLayout};
use proptest::prelude::*;

use super::*;
use crate::Tracer;
use crate::psao::generate::{GenerateParams, generate_points};
use crate::psao::update::{StepInput, UpdateParams};
use crate::test_support::{cube, deform, quad, scene, sphere};

/// Points by cell, in any order.
fn contents(memory: &CellMemory) -> BTreeMap<CellName, Vec<PackedPoint>> {
    let table = memory.table();
    let mut cells = BTreeMap::new();
    for (bucket, entries) in (0..).zip(table.buckets()) {
        for entry in entries.0.iter().filter(|entry| entry.cell != 0) {
            let points = table.cells()[entry.cell as usize - 1].0;
            let mut points: Vec<PackedPoint> = points.into_iter().filter(|p| p.is_allocated()).collect();
            points.sort_unstable();
            let twice = cells.insert(CellName { bucket, key: entry.key }, points);
            assert_eq!(twice, None, "a cell stands twice in its bucket");
        }
    }
    cells
}

/// Free places and entries are at the end, no cell is without points, and none serves twice.
fn assert_compact(memory: &CellMemory) {
    let table = memory.table();
    let mut used = Vec::new();
    for bucket in table.buckets() {
        let end = bucket.0.iter().position(|entry| entry.cell == 0).unwrap_or(8);
        assert!(bucket.0[end..].iter().all(|entry| entry.cell == 0));
        for entry in &bucket.0[..end] {
            let points = table.cells()[entry.cell as usize - 1].0;
            let end = points.iter().position(|p| !p.is_allocated()).unwrap_or(CELL_POINTS);
            assert!(end > 0 && points[end..].iter().all(|p| !p.is_allocated()));
            used.push(entry.cell);
        }
    }
    let count = used.len();
    used.sort_unstable();
    used.dedup();
    assert_eq!(used.len(), count);
}

fn layout(dims: [u32; 3], buckets: u32) -> Arc<TableLayout> {
    let grid = VirtualGrid { dims, count: buckets, ..VirtualGrid::default() };
    Arc::new(TableLayout::new(0.1, 0.2, vec![InstanceGrid { instance: 0, grid }]).unwrap())
}

fn name(layout: &TableLayout, cell: [u32; 3]) -> CellName {
    let grid = layout.grid_of(0).unwrap();
    CellName { bucket: grid.bucket(cell), key: grid.key(cell) }
}

fn packed(at: u32) -> PackedPoint {
    PackedPoint(1 << 31 | at)
}

proptest! {
    #[test]
    fn after_any_moves_the_table_is_the_one_made_afresh(
        steps in prop::collection::vec(
            prop::collection::vec((0u32..40, 0u32..8, any::<u16>(), 0u8..6), 0..20), 1..30),
    ) {
        // Eight cells, and a bucket has room for all: only cells can overflow, and none does with so few points at once.
        let layout = layout([2, 2, 2], 3);
        let mut memory = CellMemory::new(layout.clone(), 40);
        let mut client = CellTable::new(layout.clone());
        let mut points: BTreeMap<u32, (CellName, PackedPoint)> = BTreeMap::new();
        for step in steps {
            let mut updates = BTreeMap::new();
            for (point, cell, word, kind) in step {
                let name = name(&layout, [cell & 1, cell >> 1 & 1, cell >> 2]);
                let there = points.values().filter(|(n, _)| *n == name).count()
                    + updates.values().filter(|to: &&Option<(CellName, _)>| to.is_some_and(|(n, _)| n == name)).count();
                if kind == 0 || there >= CELL_POINTS {
                    updates.insert(point, None);
                } else {
                    updates.insert(point, Some((name, packed(u32::from(word)))));
                }
            }
            for (&point, &to) in &updates {
                match to {
                    Some(to) => points.insert(point, to),
                    None => points.remove(&point),
                };
            }
            let updates: Vec<PointUpdate> = updates.into_iter().collect();
            memory.update(&updates);
            let changes = memory.commit();
            assert_compact(&memory);
            // What is said to have changed is all that changed.
            for &bucket in &changes.buckets {
                *client.bucket_mut(bucket) = memory.table().buckets()[bucket as usize];
            }
            for &cell in &changes.cells {
                *client.cell_mut(cell) = memory.table().cells()[cell as usize];
            }
            prop_assert!(client.holds_same(memory.table()));
        }
        prop_assert_eq!(memory.overflow(), Overflow::default());
        let mut afresh = CellMemory::new(layout, 40);
        afresh.update(&points.iter().map(|(&point, &to)| (point, Some(to))).collect::<Vec<_>>());
        afresh.commit();
        prop_assert_eq!(contents(&memory), contents(&afresh));
        prop_assert_eq!(memory.placed(), points.len());
        prop_assert_eq!(memory.table().point_count(), points.len());
    }
}

#[test]
fn what_overflows_is_counted_and_finds_room_later() {
    let layout = layout([100, 1, 1], 1);
    let mut memory = CellMemory::new(layout.clone(), 30);
    let at = |point: u32, x: u32| (point, Some((name(&layout, [x, 0, 0]), packed(point))));
    // Nine points in one cell, then a point in each of nine more: eight entries have the bucket.
    memory.update(&(0..9).map(|point| at(point, 0)).collect::<Vec<_>>());
    memory.update(&(9..18).map(|point| at(point, point)).collect::<Vec<_>>());
    memory.commit();
    assert_eq!(memory.overflow(), Overflow { cell: 2, bucket: 2 });
    assert_eq!((memory.placed(), memory.table().point_count()), (14, 14));
    assert_compact(&memory);
    // The cell loses three points; one that found no place asks again.
    memory.update(&[(0, None), (1, None), (2, None), at(8, 0)]);
    // A cell is deserted and another takes its entry in the same step.
    memory.update(&[(9, None), at(17, 17)]);
    memory.commit();
    assert_eq!(memory.overflow(), Overflow { cell: 2, bucket: 2 });
    assert_eq!(memory.placed(), 14 - 3 + 1 - 1 + 1);
    assert_compact(&memory);
    assert!(memory.commit().is_empty());
}

/// A floor, and on it a cube of 0.4 m at `x`; far above both a ball that touches nothing.
fn stage() -> (Scene, Pose) {
    let floor =
        quad(Vec3::ZERO, Vec3::new(0.0, 0.0, 4.0), Vec3::new(4.0, 0.0, 4.0), Vec3::new(4.0, 0.0, 0.0));
    let ball = sphere(Vec3::ZERO, 0.25, 8, 16);
    let at = Affine3A::from_translation;
    let (scene, mut pose) = scene(
        vec![floor, cube(), ball],
        &[(0, Affine3A::IDENTITY), (1, Affine3A::IDENTITY), (2, at(Vec3::new(2.0, 5.0, 2.0)))],
    );
    place_cube(&mut pose, 1.0);
    (scene, pose)
}

fn place_cube(pose: &mut Pose, x: f32) {
    let at = Vec3::new(x, 0.0, 2.0);
    pose.instances[1].world_from_mesh =
        Affine3A::from_scale_rotation_translation(Vec3::splat(0.4), Quat::IDENTITY, at);
}

struct Running {
    scene: Scene,
    tracer: Tracer,
    updater: Updater,
    paper: PaperUpdater,
}

impl Running {
    fn new(scene: Scene, pose: &Pose, params: PaperParams) -> Running {
        let tracer = Tracer::new(&scene, pose);
        let generate = GenerateParams { points_per_m2: 300.0, ..Default::default() };
        let points = generate_points(&scene, pose, &tracer, &generate, &|_| ()).unwrap();
        let updater = Updater::new(&scene, pose, &tracer, points, UpdateParams::default(), &|_| ()).unwrap();
        let paper = PaperUpdater::new(&scene, pose, &updater, params).unwrap();
        Running { scene, tracer, updater, paper }
    }

    fn step(&mut self, pose: &Pose, view: Option<&ConvexVolume>) -> (CellChanges, PaperCounts) {
        self.tracer.update(&self.scene, pose);
        self.updater.step(&self.scene, pose, &mut self.tracer, &StepInput::default());
        self.paper.step(&self.scene, pose, &self.updater, view)
    }

    /// The table made anew at a pose.
    fn afresh(&self, pose: &Pose) -> PaperUpdater {
        PaperUpdater::new(&self.scene, pose, &self.updater, self.paper.params).unwrap()
    }
}

#[test]
fn a_still_scene_and_an_open_rigid_mover_change_nothing() {
    let (scene, pose) = stage();
    let mut running = Running::new(scene, &pose, PaperParams::default());
    assert_eq!(running.step(&pose, None), (CellChanges::default(), PaperCounts::default()));
    // The ball rises and turns, where nothing is near.
    let mut moved = pose.clone();
    moved.instances[2].world_from_mesh =
        Affine3A::from_rotation_translation(Quat::from_rotation_x(1.0), Vec3::new(1.0, 6.0, 2.5));
    assert_eq!(running.step(&moved, None), (CellChanges::default(), PaperCounts::default()));
}

#[test]
fn what_bends_is_sent_even_if_its_visibility_stays() {
    let (scene, mut pose) = stage();
    let positions = scene.meshes[2].positions.clone();
    deform(&mut pose, 2, positions.clone());
    // Instances without skin or targets never bend; morph targets tell that this one can.
    let mut scene = scene;
    scene.meshes[2].morph_targets.push(dapple_scene::MorphTarget::default());
    let mut running = Running::new(scene, &pose, PaperParams::default());
    assert!(running.step(&pose, None).0.is_empty());
    let mut bent = pose.clone();
    deform(&mut bent, 2, positions.iter().map(|p| *p * Vec3::new(0.6, 1.0, 0.6)).collect());
    let (changes, counts) = running.step(&bent, None);
    let points = running.updater.store().layout().set_of_instance(2).unwrap().len() as u32;
    assert!(counts.updated > points / 2 && counts.updated <= points, "{} of {points}", counts.updated);
    assert!(!changes.cells.is_empty() && !changes.buckets.is_empty());
    assert_eq!(counts.outside_box, 0);
    // Every point lies within the threshold of where it is.
    let paper = &running.paper;
    let layout = paper.table().layout();
    for set in running.paper.sets.iter().filter(|set| set.bends) {
        for point in set.first..set.first + set.len {
            let posed =
                running.updater.anchors()[point as usize].pose_local(&running.scene, &bent, 2).unwrap();
            let sent = paper.sent[point as usize];
            let corner = Vec3::from_array(sent.cell.map(|c| c as f32));
            let place = set.grid.origin + (corner + sent.point.position_in_cell()) * layout.edge_m();
            assert!((place - posed.position).abs().max_element() <= 1.001 / 32.0 * layout.edge_m());
        }
    }
    // It stretches out of the box that was made for it.
    deform(&mut bent, 2, positions.iter().map(|p| *p * Vec3::new(3.0, 1.0, 1.0)).collect());
    assert!(running.step(&bent, None).1.outside_box > 0);
}

#[test]
fn without_thresholds_the_table_is_the_one_made_anew() {
    let (scene, mut pose) = stage();
    // Small cells, so that none overflows: what is discarded depends on who comes first.
    let params = PaperParams { threshold: 0, edge_spacings: 1.0, ..PaperParams::default() };
    let mut running = Running::new(scene, &pose, params);
    let mut sent = 0;
    for x in [1.1, 1.3, 2.0, 0.7] {
        place_cube(&mut pose, x);
        sent += running.step(&pose, None).1.cells;
        let afresh = running.afresh(&pose);
        assert_eq!(running.paper.overflow(), Overflow::default());
        assert_eq!(contents(&running.paper.memory), contents(&afresh.memory));
    }
    assert!(sent > 20, "{sent} cells");
    assert!(running.step(&pose, None).0.is_empty(), "the clock stands still");
    assert_eq!(running.paper.unplaced(), 0);
}

#[test]
fn what_is_out_of_view_waits_until_it_comes_into_view() {
    let (scene, mut pose) = stage();
    let mut running = Running::new(scene, &pose, PaperParams::default());
    let look_at =
        |target| extended_view(&PosedCamera::look_at(Vec3::new(2.0, 1.0, 6.0), target, 0.8), 1.0, 20.0);
    place_cube(&mut pose, 2.5);
    let away = look_at(Vec3::new(2.0, 1.0, 9.0));
    let (changes, counts) = running.step(&pose, Some(&away));
    assert!(changes.is_empty() && counts.updated == 0 && counts.out_of_view > 20, "{counts:?}");
    let towards = look_at(Vec3::new(2.0, 0.0, 2.0));
    let (changes, seen) = running.step(&pose, Some(&towards));
    assert!(!changes.is_empty());
    assert_eq!((seen.updated, seen.out_of_view), (counts.out_of_view, 0));
    assert!(running.step(&pose, None).0.is_empty());
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (scene, mut pose) = stage();
            let mut running = Running::new(scene, &pose, PaperParams::default());
            place_cube(&mut pose, 1.8);
            let changes = running.step(&pose, None).0;
            (changes, running.paper.table().cells().to_vec(), running.paper.table().buckets().to_vec())
        })
    };
    assert!(run(1) == run(3));
}

#[test]
fn settings_out_of_range_are_refused() {
    let default = PaperParams::default();
    assert!(default.check().is_ok());
    for bad in [
        PaperParams { position_steps: 0.4, ..default },
        PaperParams { position_steps: f32::NAN, ..default },
        PaperParams { normal_degrees: -1.0, ..default },
        PaperParams { edge_spacings: 0.0, ..default },
    ] {
        let error = bad.check().unwrap_err().to_string();
        assert!(error.contains("must be"), "{error}");
    }
}
