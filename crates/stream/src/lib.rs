//! dapple-stream
