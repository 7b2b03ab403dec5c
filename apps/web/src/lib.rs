//! The client in a browser tab: what the page's JavaScript (`page/dapple.js`) drives.
//!
//! ```text
//! fetch, pointer, keys, frames of the display (JavaScript) ─► Core ─► clock and replay (which frame of the stream, when) ─► Viewer ─► canvas
//!        messages of a live session (JavaScript's socket) ◄─►      ─► guest (what is lit and changed, and when) ─┘
//! ```
//!
//! Requests, events and the clock are the page's; this side owns the canvas, and everything that is counted in points,
//! pixels and bytes. Only the parts that touch a browser are left out of builds for other targets.

#[cfg(target_arch = "wasm32")]
mod canvas;
#[cfg(target_arch = "wasm32")]
mod core;
#[cfg(target_arch = "wasm32")]
mod edit;
pub mod grab;
#[cfg(target_arch = "wasm32")]
mod live;
pub mod names;
#[cfg(target_arch = "wasm32")]
mod steer;

#[cfg(target_arch = "wasm32")]
pub use crate::core::Core;
