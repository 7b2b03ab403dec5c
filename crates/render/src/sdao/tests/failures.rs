//! Which failures of a single layer a stochastic depth map mends, and by how much.

use super::hidden::{METHODS, estimate};
use super::*;
use crate::testing::check_golden;
use crate::testing::failures::{self, Means};

/// Of a failure the part that is left, of the single layer's.
fn left(single: f32, found: f32, truth: f32) -> f32 {
    (found - truth) / (single - truth)
}

#[test]
fn hidden_things_are_mended_and_nothing_else() {
    let truth = failures::truth();
    for (name, method) in METHODS {
        let single = failures::seen_by(&|shot| method(shot.screen, &Lookup::default()));
        let known = failures::seen_by(&estimate(method, 4));
        check_golden("sdao", &format!("failures-sd-{name}"), &failures::strip(&[&truth, &single, &known]));
        let (truth, single, known): (Means, Means, Means) = (truth.means, single.means, known.means);
        println!("truth {truth:.3?}\n{name} {single:.3?}\nsd-{name} {known:.3?}");
        let left = left(single.after, known.after, known.before);
        println!("of the pop-in {left:.3} is left");
    }
}
