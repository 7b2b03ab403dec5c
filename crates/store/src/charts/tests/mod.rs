//! Tests of charts.

mod invariants;
mod property;
mod shapes;
mod truth;
