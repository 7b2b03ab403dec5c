//! Tests of charts.

mod atlas;
mod invariants;
mod property;
mod scenes;
mod shapes;
mod truth;
