//! Bodies of fuzz targets as plain functions: each takes any bytes and panics where a promise is broken.
//!
//! Ordinary tests replay the corpus and mutate it (`tests/replay.rs`); cargo-fuzz runs the same functions
//! (`README.md`).

mod camera_path;
mod cells;
pub mod corpus;
mod environment;
mod frame;
mod input;
mod live;
mod recording;
mod scene;
mod session;
mod soup;
mod weights;

pub use camera_path::read_camera_path;
pub use cells::decode_cells;
pub use environment::read_environment;
pub use frame::decode_frame;
pub use input::Random;
pub use live::live_session;
pub use recording::read_recording;
pub use scene::load_scene;
pub use session::session_ops;
pub use soup::triangle_soup;
pub use weights::read_weights;

/// A target: its name, which is that of its folder in `corpus/`, and its body.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 10] = [
    ("decode_frame", decode_frame),
    ("decode_cells", decode_cells),
    ("session_ops", session_ops),
    ("live_session", live_session),
    ("read_recording", read_recording),
    ("load_scene", load_scene),
    ("read_camera_path", read_camera_path),
    ("triangle_soup", triangle_soup),
    ("read_weights", read_weights),
    ("read_environment", read_environment),
];
