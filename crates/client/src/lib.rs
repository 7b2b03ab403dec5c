//! dapple-client
