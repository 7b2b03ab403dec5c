//! Closed forms of direct light for every method, and what no light or material may break.

mod resampled;
mod reused;
mod stage;
mod traced;
