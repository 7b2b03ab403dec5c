//! The order of frames: epochs, groups, joining, and what happens to a frame that comes late or twice.
//!
//! An *epoch* names a state of the publisher's store; a *group* is a snapshot and what builds on it: deltas, and changes of
//! which instances have points. Frames
//! of one group build on each other, groups do not: the newest wins.

#[cfg(feature = "publish")]
mod budget;
#[cfg(feature = "publish")]
mod lights;
mod parts;
#[cfg(feature = "publish")]
mod precision;
#[cfg(feature = "publish")]
mod publisher;
mod sets;
mod subscriber;
#[cfg(feature = "publish")]
mod within;

#[cfg(feature = "publish")]
pub use budget::Budget;
pub use parts::Parts;
#[cfg(feature = "publish")]
pub use precision::Precision;
#[cfg(feature = "publish")]
pub use publisher::{Frame, Publisher, PublisherConfig};
pub use subscriber::{Applied, IgnoreReason, ReceiveError, Subscriber};
#[cfg(feature = "publish")]
pub use within::Spending;
