//! dapple-metrics
