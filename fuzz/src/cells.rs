//! Any bytes into a subscriber of the paper's cells: as a frame, as a payload, and as a body that is well wrapped.

use std::sync::{Arc, LazyLock};

use dapple_render::gbuffer::LocalSurface;
use dapple_render::psao::paper::reconstruct;
use dapple_render::psao::{Hat, Kernel};
use dapple_scene::glam::Vec3;
use dapple_store::cells::{
    BucketEntry, CellData, CellTable, HashBucket, InstanceGrid, PackedPoint, TableLayout, VirtualGrid,
};
use dapple_stream::FrameKind;
use dapple_stream::cells::{CellCodec, CellLimits, CellPublisher, CellSubscriber};
use dapple_stream::codec::seal;

/// Small, so that what a few bytes claim stays fast to make.
const LIMITS: CellLimits = CellLimits { max_frame_bytes: 1 << 16, max_buckets: 1 << 8, max_grids: 64 };

/// The table that seeds and target have in common: two instances, some cells.
pub(crate) fn sample() -> CellTable {
    let grid = |instance, count| InstanceGrid {
        instance,
        grid: VirtualGrid { dims: [3, 2, 4], count, ..VirtualGrid::default() },
    };
    let layout = TableLayout::new(0.1, 0.2, vec![grid(0, 3), grid(5, 2)]).expect("a sound layout");
    let mut table = CellTable::new(Arc::new(layout));
    for (cell, bucket) in [0, 1, 3, 4].into_iter().enumerate() {
        let cell = cell as u32;
        let mut entries = HashBucket::default();
        entries.0[0] = BucketEntry { key: 3 * cell, cell: cell + 1 };
        *table.bucket_mut(bucket) = entries;
        let mut points = CellData::default();
        for (i, point) in points.0.iter_mut().enumerate().take(2 + cell as usize) {
            *point = PackedPoint(1 << 31 | (i as u32) << 20 | 0x7700 | (40 * cell));
        }
        *table.cell_mut(cell) = points;
    }
    table
}

/// A subscriber that holds the sample at epoch 0.
static HOLDING: LazyLock<CellSubscriber> = LazyLock::new(|| {
    let mut subscriber = CellSubscriber::new(None, LIMITS);
    let frame = CellPublisher::new([0; 32], CellCodec::Zstd, 0.0).join(&sample()).expect("memory suffices");
    subscriber.receive(&frame.bytes).expect("a sound frame");
    subscriber
});

/// Receives `data` as it is, and its bytes after the first as the payload (below 128) or as the uncompressed body of a snapshot or
/// (odd) delta for epoch 1. Nothing may panic, an error changes nothing, and what was taken can be looked up and sent on.
pub fn decode_cells(data: &[u8]) {
    receive(data);
    if let Some((&kind, rest)) = data.split_first() {
        let frame_kind = if kind % 2 == 1 { FrameKind::Delta } else { FrameKind::Snapshot };
        let payload = if kind < 128 { rest.to_vec() } else { wrap(rest) };
        receive(&seal(frame_kind, 0, 1, &payload));
    }
}

/// A payload with this body, at time 0, as one run of LZ4 literals.
fn wrap(body: &[u8]) -> Vec<u8> {
    let mut payload = [&b"CELL"[..], &[2], &[0; 8]].concat();
    let mut length = body.len();
    while length >= 128 {
        payload.push(length as u8 | 128);
        length >>= 7;
    }
    payload.push(length as u8);
    payload.push((body.len().min(15) as u8) << 4);
    if let Some(mut more) = body.len().checked_sub(15) {
        while more >= 255 {
            payload.push(255);
            more -= 255;
        }
        payload.push(more as u8);
    }
    [&payload, body].concat()
}

fn receive(frame: &[u8]) {
    for start in [&CellSubscriber::new(None, LIMITS), &*HOLDING] {
        let mut subscriber = start.clone();
        match subscriber.receive(frame) {
            Err(_) => {
                let same = match (start.table(), subscriber.table()) {
                    (Some(before), Some(after)) => before.holds_same(after),
                    (before, after) => before.is_none() && after.is_none(),
                };
                assert!(same && start.epoch() == subscriber.epoch() && start.time_s() == subscriber.time_s());
            }
            Ok(_) => {
                let table = subscriber.table().expect("it was applied");
                look_up(table);
                let again =
                    CellPublisher::new([0; 32], CellCodec::Lz4, 0.0).join(table).expect("memory suffices");
                let mut next = CellSubscriber::new(None, CellLimits { max_frame_bytes: 1 << 22, ..LIMITS });
                next.receive(&again.bytes).expect("what is held can be sent");
                assert!(next.table().expect("it was applied").holds_same(table));
            }
        }
    }
}

fn look_up(table: &CellTable) {
    let edge_m = table.layout().edge_m();
    let fragments: Vec<_> = table
        .layout()
        .grids()
        .iter()
        .take(4)
        .flat_map(|placed| {
            let at = |cells: f32| LocalSurface {
                instance: placed.instance,
                position_local: placed.grid.origin + Vec3::splat(cells * edge_m),
                normal_local: Vec3::Y,
            };
            [-0.6, 0.3, 1.2].map(|cells| Some(at(cells)))
        })
        .collect();
    for kernel in [Kernel::Hat(Hat::default()), Kernel::default()] {
        for visibility in reconstruct(table, &kernel, &fragments) {
            assert!((0.0..=1.0).contains(&visibility), "{visibility}");
        }
    }
}
