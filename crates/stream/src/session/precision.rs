//! How exact what is sent must be.

/// How exact deltas are, in 255ths of visibility. The first snapshot of a layout is exact; others hold what the deltas came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Precision {
    /// What subscribers hold is at most this far from what was published, always: a change that leaves a point within is not
    /// sent. Default 0: everything is sent exactly. At most 127; more is taken as that.
    pub tolerance: u8,
    /// What is sent is a multiple of this beside what is expected: larger is shorter, and less exact within the tolerance.
    /// 1 … 2 `tolerance` + 1, more is taken as that; 0 (default) is the smaller of 2 `tolerance` and 8, or the tolerance if
    /// that is more (`README.md` has the measurements).
    pub step: u8,
}

impl Precision {
    /// Tolerance and step within their ranges.
    pub(super) fn in_range(self) -> Precision {
        let tolerance = self.tolerance.min(127);
        let step = if self.step == 0 { tolerance.max((2 * tolerance).min(8)) } else { self.step };
        Precision { tolerance, step: step.clamp(1, 2 * tolerance + 1) }
    }
}
