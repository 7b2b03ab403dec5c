//! Tests of charts.

mod invariants;
mod property;
mod scenes;
mod shapes;
mod timing;
mod truth;
