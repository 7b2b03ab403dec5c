//! Changes of a store ⇄ frames of bytes, blind to transport: no sockets, clock or threads in here.
//!
//! A [`Publisher`] (feature `publish`) turns the states of a [`PointStore`](dapple_store::points::PointStore) into
//! [`Frame`]s; a [`Subscriber`] turns any bytes back into the same store, bit for bit, or names what is wrong
//! with them. The frames are specified in `docs/wire.md`; [`codec`] is the bits, [`session`] the order. Frames kept
//! in a file are a [`recording`]. Beside it stands what the paper sends, to be
//! compared with (`cells`, a feature).

#![cfg_attr(
    test,
    allow(clippy::unwrap_used, reason = "in a test, a failed unwrap is a failure like any other")
)]

#[cfg(feature = "cells")]
pub mod cells;
pub mod codec;
pub mod light_visibility;
pub mod recording;
pub mod session;

pub use codec::{DecodeError, FrameHeader, FrameKind, Limits, ValueChange};
pub use recording::{Recorder, Recording, RecordingError, RecordingHeader, Replay};
pub use session::{Applied, IgnoreReason, Parts, ReceiveError, Subscriber};
#[cfg(feature = "publish")]
pub use session::{Budget, Frame, Precision, Publisher, PublisherConfig, Spending};
