//! Light cones on surfaces: what arrives at a place from area lights, in a few cones ([Stadlbauer2023]).
//!
//! An *entry* is what one place holds: [`MomentEntry`] is ours, [`BoundingEntry`] the paper's. The [`ConeCache`]
//! keeps entries on surfaces, in texels of the rest-space charts, for all viewers together. Rays are not its business: it
//! says what is wanted and where, and takes samples.

mod bounding;
mod cache;
mod charting;
mod entry;
mod key;
mod lights;
mod moment;
mod packed;
#[cfg(test)]
mod test_lights;

pub use bounding::{
    BoundingCone, BoundingEntry, BoundingParams, Cycle, MOST_BOUNDING_CONES, Probe, reduction,
};
pub use cache::{
    CacheCounts, CacheParams, ConeCache, EntryId, EntrySite, LookUp, PixelPlace, QueuedBlock, QueuedTexel,
    Reader, Reads, Requests, TexelPlace, Touch, UpdateQueue, View,
};
pub use charting::{ChartPlace, Charting};
pub use entry::{ConeEntry, ConeError, ConeSample, GRAZING_COSINE, MOST_ENERGY, luminance};
pub use key::{
    BACK, BLOCK_SIDE, BLOCK_TEXELS, BlockKey, COARSEST_LEVEL, FINEST_LEVEL, SLABS, TexelKey, level_of,
};
pub use lights::LightSet;
pub use moment::{HiddenSample, MOST_MOMENT_CONES, MomentCone, MomentEntry, MomentParams, ReAim};
pub use packed::{PAPER_BITS, PackedMoment, PackedPaper, energy_from_bits, energy_to_bits};
