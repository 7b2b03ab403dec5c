//! The order of frames: epochs, groups, joining, and what happens to a frame that comes late or twice.
//!
//! An *epoch* names a state of the publisher's store; a *group* is a snapshot and the deltas on top of it. Frames
//! of one group build on each other, groups do not: the newest wins.

#[cfg(feature = "zstd")]
mod publisher;
mod subscriber;

#[cfg(feature = "zstd")]
pub use publisher::{Frame, Precision, PublishError, Publisher, PublisherConfig};
pub use subscriber::{Applied, IgnoreReason, ReceiveError, Subscriber};
