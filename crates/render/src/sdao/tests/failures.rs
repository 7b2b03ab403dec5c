//! Which failures of a single layer a stochastic depth map mends, and by how much.

use super::hidden::{METHODS, estimate};
use super::*;
use crate::testing::check_golden;
use crate::testing::failures::{self, Means};

#[test]
fn hidden_things_are_mended_and_nothing_else() {
    let truth = failures::truth();
    for (name, method) in METHODS {
        let single = failures::seen_by(&|shot| method(shot.screen, &Lookup::default()));
        let known = failures::seen_by(&estimate(method, 4));
        check_golden("sdao", &format!("failures-sd-{name}"), &failures::strip(&[&truth, &single, &known]));
        let (truth, single, known): (Means, Means, Means) = (truth.means, single.means, known.means);
        println!("truth {truth:.3?}\n{name} {single:.3?}\nsd-{name} {known:.3?}");
        // What the beam hides stays known: of the change nothing is left.
        let left = (known.after - known.before) / (single.after - single.before);
        println!("of the pop-in {left:.3} is left");
        assert!(single.after - single.before > 0.1 && left.abs() < 0.02, "{single:?}, {known:?}");
        // Neither a halo by what is in front, nor a thickness that is not known, nor the picture's edge is a matter of hidden surfaces.
        for (before, after) in [
            (single.halo, known.halo),
            (single.thin, known.thin),
            (single.off_screen, known.off_screen),
            (single.guarded, known.guarded),
        ] {
            assert!((before - after).abs() < 0.002, "{single:?}, {known:?}");
        }
        assert!(known.halo > 0.99 && truth.thin - known.thin > 0.01 && known.off_screen > 0.985, "{known:?}");
    }
}
