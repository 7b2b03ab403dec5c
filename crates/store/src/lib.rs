//! The light that both ends hold: points in rest space with the visibility they carry.
//!
//! This crate is the contract between server and client. It knows nothing of bytes on a wire (that is
//! `stream`), of rays (`trace`) or of pixels (`render`).

pub mod cells;
pub mod charts;
pub mod cones;
pub mod light_visibility;
pub mod octahedral;
pub mod points;
