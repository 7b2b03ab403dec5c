//! Tests of charts.

mod shapes;
mod truth;
