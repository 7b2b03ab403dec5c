//! dapple-server
