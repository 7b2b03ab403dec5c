//! dapple-render
pub mod psao;
