//! The card against the twins, on a real device where there is one.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod agreement;
mod area;
mod atlas;
mod harness;
mod motion;
mod shaders;
mod shadows;
mod views;
