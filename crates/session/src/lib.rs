//! The conversation of a live session: one host, any number of viewers, over any link that carries messages. No sockets, threads or
//! clock in here: messages and the time (microseconds on the caller's own clock) are arguments.
//!
//! ```text
//!   host ── welcome, state and its changes, light ──────────► viewer
//!        ◄── hello, looks (superseding), events (numbered) ──
//! ```
//!
//! A [`Host`](host::Host) (feature `host`) is the only writer of the scene's state and decides for each viewer what it gets next, from what
//! all viewers share; a [`Guest`] is the viewer's end. Frames of light pass through as bytes, made and taken by `dapple-stream`.
//! `docs/live.md` specifies the messages.

#![cfg_attr(
    test,
    allow(clippy::unwrap_used, reason = "in a test, a failed unwrap is a failure like any other")
)]

mod clock;
pub mod guest;
#[cfg(feature = "host")]
pub mod host;
mod light;
mod message;
#[cfg(test)]
mod tests;
pub mod work;

pub use clock::SceneClock;
/// Version of the frames of light.
pub use dapple_stream::codec::VERSION as WIRE;
pub use guest::{Guest, GuestConfig, GuestError, News};
pub use light::{Assembled, Assembly, CHUNK_BYTES, LightHead, MAX_LIGHT_MESSAGE_BYTES};
pub use message::{
    Event, FromHost, FromViewer, Held, Hello, Look, LookCamera, MAX_FROM_HOST_BYTES, MAX_FROM_VIEWER_BYTES,
    MAX_PARTS, MessageError, PROTOCOL, Reason, Refusal, Role, Status, Terms, Welcome, stream_within,
};
