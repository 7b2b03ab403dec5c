//! dapple-render
