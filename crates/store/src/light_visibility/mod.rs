//! How much of each light is seen from each point: what both ends hold of area lights ahead of their cones.
//!
//! Rays that find it are `trace`'s, bytes are `stream`'s; `README.md` has what a value means and what it does not.

mod lean;

use crate::points::PointLayout;

pub use lean::{LEAN_STEPS, Lean, SeenLight, lean_frame};

/// The value of a light of which all is seen; 0 is one of which nothing is.
pub const OPEN: u8 = 31;

/// Most lights.
pub const MAX_LIGHTS: u32 = 1 << 12;

/// Most values, points × lights. Bounds what a decoder allocates.
pub const MAX_VALUES: usize = 1 << 24;

/// The visibility of lights at the points of a layout, 0 … [`OPEN`]; with or without where what is seen of a light lies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LightVisibility {
    points: usize,
    lights: u32,
    /// Light by light.
    values: Vec<u8>,
    /// As many. [`Lean::NONE`] where all or nothing is seen.
    leans: Option<Vec<Lean>>,
}

/// A value that is another now, or leans elsewhere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightChange {
    /// Which: light × points + point.
    pub index: u32,
    /// What it was.
    pub old: u8,
    /// What it is now, 0 … [`OPEN`].
    pub new: u8,
    /// Where what was seen lay; [`Lean::NONE`] where leans are not held.
    pub old_lean: Lean,
    /// Where what is seen lies now.
    pub new_lean: Lean,
}

/// Why values cannot be held.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LightVisibilityError {
    /// Too many.
    #[error(
        "visibility of {lights} lights at {points} points: at most {MAX_LIGHTS} lights and {MAX_VALUES} values fit; lay fewer points (--points, --max-points)"
    )]
    TooMany {
        /// Points of the layout.
        points: usize,
        /// Lights asked for.
        lights: u32,
    },
    /// A list of another length than there are values.
    #[error("visibility of lights: {values} values for {lights} lights at {points} points")]
    WrongCount {
        /// Values given.
        values: usize,
        /// Points of the layout.
        points: usize,
        /// Lights.
        lights: u32,
    },
    /// A value above [`OPEN`].
    #[error("visibility of lights: value {value} at {index}, the most is {OPEN}")]
    BadValue {
        /// Where.
        index: usize,
        /// What was there.
        value: u8,
    },
    /// Another number of leans than of values, one that is too far, or one of a value that has none.
    #[error(
        "visibility of lights: leans of {leans} values for {values}, the first that does not fit at {index}"
    )]
    BadLeans {
        /// Leans given.
        leans: usize,
        /// Values there are.
        values: usize,
        /// Where.
        index: usize,
    },
    /// A change of a value that is not there.
    #[error("visibility of lights: change of value {index}, there are only {values}")]
    NoSuchValue {
        /// The index.
        index: u32,
        /// How many there are.
        values: usize,
    },
}

impl LightVisibility {
    /// All open.
    ///
    /// # Errors
    /// There would be more than [`MAX_LIGHTS`] or [`MAX_VALUES`].
    pub fn open(layout: &PointLayout, lights: u32) -> Result<LightVisibility, LightVisibilityError> {
        let points = layout.len();
        let values = check_size(points, lights)?;
        Ok(LightVisibility { points, lights, values: vec![OPEN; values], leans: None })
    }

    /// Whether so many can be held.
    ///
    /// # Errors
    /// There would be more than [`MAX_LIGHTS`] or [`MAX_VALUES`].
    pub fn check(points: usize, lights: u32) -> Result<(), LightVisibilityError> {
        check_size(points, lights).map(drop)
    }

    /// With these values, light by light.
    ///
    /// # Errors
    /// As of [`LightVisibility::open`]; another number of values, or one above [`OPEN`].
    pub fn new(
        layout: &PointLayout,
        lights: u32,
        values: Vec<u8>,
    ) -> Result<LightVisibility, LightVisibilityError> {
        let points = layout.len();
        if check_size(points, lights)? != values.len() {
            return Err(LightVisibilityError::WrongCount { values: values.len(), points, lights });
        }
        if let Some(index) = values.iter().position(|&value| value > OPEN) {
            return Err(LightVisibilityError::BadValue { index, value: values[index] });
        }
        Ok(LightVisibility { points, lights, values, leans: None })
    }

    /// The same with where what is seen of each light lies, light by light.
    ///
    /// # Errors
    /// Another number of leans than of values; one beyond [`LEAN_STEPS`]; one other than [`Lean::NONE`] of a value of 0 or [`OPEN`].
    pub fn with_leans(self, leans: Vec<Lean>) -> Result<LightVisibility, LightVisibilityError> {
        let fits = |(value, lean): (&u8, &Lean)| *lean == lean.of_value(*value);
        let bad = self.values.iter().zip(&leans).position(|pair| !fits(pair));
        if bad.is_some() || leans.len() != self.values.len() {
            let index = bad.unwrap_or(leans.len().min(self.values.len()));
            return Err(LightVisibilityError::BadLeans {
                leans: leans.len(),
                values: self.values.len(),
                index,
            });
        }
        Ok(LightVisibility { leans: Some(leans), ..self })
    }

    /// Values and leans (as many, if any) that were put together from others, so that each is in range.
    pub(crate) fn carried(
        points: usize,
        lights: u32,
        values: Vec<u8>,
        leans: Option<Vec<Lean>>,
    ) -> LightVisibility {
        debug_assert_eq!(values.len(), points * lights as usize);
        debug_assert!(leans.as_ref().is_none_or(|leans| leans.len() == values.len()));
        LightVisibility { points, lights, values, leans }
    }

    /// Number of points of the layout.
    pub fn points(&self) -> usize {
        self.points
    }

    /// Number of lights.
    pub fn lights(&self) -> u32 {
        self.lights
    }

    /// All values, light by light.
    pub fn values(&self) -> &[u8] {
        &self.values
    }

    /// The values of one light at all points; none if there is no such light.
    pub fn of_light(&self, light: u32) -> &[u8] {
        let start = light as usize * self.points;
        self.values.get(start..start + self.points).unwrap_or(&[])
    }

    /// Whether it is held where what is seen of lights lies.
    pub fn has_leans(&self) -> bool {
        self.leans.is_some()
    }

    /// Where what is seen of lights lies, light by light; empty where that is not held.
    pub fn leans(&self) -> &[Lean] {
        self.leans.as_deref().unwrap_or(&[])
    }

    /// The same of one light at all points; empty where that is not held.
    pub fn leans_of_light(&self, light: u32) -> &[Lean] {
        let start = light as usize * self.points;
        self.leans().get(start..start + self.points).unwrap_or(&[])
    }

    /// Where what is seen lies, of the value of an index; [`Lean::NONE`] where that is not held.
    pub fn lean(&self, index: usize) -> Lean {
        self.leans().get(index).copied().unwrap_or_default()
    }

    /// The value of a light at a point, 0 … [`OPEN`]; `None` if there is none.
    pub fn get(&self, point: usize, light: u32) -> Option<u8> {
        self.of_light(light).get(point).copied()
    }

    /// Visible fraction of a light at a point, 0 … 1; `None` if there is none.
    pub fn fraction(&self, point: usize, light: u32) -> Option<f32> {
        self.get(point, light).map(|value| f32::from(value) / f32::from(OPEN))
    }

    /// Sets one value, at most [`OPEN`], and where what is seen lies if that is held, and tells whether anything was another; what has no place is left
    /// out.
    pub fn set(&mut self, index: usize, value: u8, lean: Lean) -> bool {
        let new = value.min(OPEN);
        let of_value = self.values.get_mut(index).is_some_and(|held| std::mem::replace(held, new) != new);
        let lean = lean.of_value(new);
        let held = self.leans.as_mut().and_then(|leans| leans.get_mut(index));
        let of_lean = held.is_some_and(|held| std::mem::replace(held, lean) != lean);
        of_value || of_lean
    }

    /// Sets changed values; all or, if one does not fit, none. A lean beyond [`LEAN_STEPS`] counts as one of the rim.
    ///
    /// # Errors
    /// An index that is not there, a value above [`OPEN`].
    pub fn apply(&mut self, changes: &[LightChange]) -> Result<(), LightVisibilityError> {
        let values = self.values.len();
        for change in changes {
            if change.index as usize >= values {
                return Err(LightVisibilityError::NoSuchValue { index: change.index, values });
            }
            if change.new > OPEN {
                return Err(LightVisibilityError::BadValue {
                    index: change.index as usize,
                    value: change.new,
                });
            }
        }
        for change in changes {
            self.set(change.index as usize, change.new, change.new_lean);
        }
        Ok(())
    }

    /// Bytes that values and leans take.
    pub fn bytes(&self) -> usize {
        self.values.len() + size_of_val(self.leans())
    }

    /// A hash of all that is held, the same on every machine: to compare ends (FNV-1a, 64 bits).
    pub fn hash(&self) -> u64 {
        let sizes = [self.points as u64, u64::from(self.lights)].map(u64::to_le_bytes);
        let leans = self.leans().iter().flat_map(|lean| lean.0.map(|step| step as u8));
        let bytes = sizes.iter().flatten().chain(&self.values).copied().chain(leans);
        bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        })
    }
}

/// A visible fraction as a value: the nearest step. What is no number counts as open.
pub fn quantized(fraction: f32) -> u8 {
    if fraction.is_nan() {
        return OPEN;
    }
    (fraction.clamp(0.0, 1.0) * f32::from(OPEN) + 0.5) as u8
}

fn check_size(points: usize, lights: u32) -> Result<usize, LightVisibilityError> {
    let values = points.checked_mul(lights as usize).filter(|v| *v <= MAX_VALUES && lights <= MAX_LIGHTS);
    values.ok_or(LightVisibilityError::TooMany { points, lights })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use super::*;
    use crate::points::{PackedNormal, PointSet};

    fn layout(points: u32) -> PointLayout {
        let set = PointSet {
            positions: (0..points).map(|i| [i, 0, 0]).collect(),
            normals: vec![PackedNormal([127, 254]); points as usize],
            ..PointSet::default()
        };
        // Along one axis, Morton order is that of the coordinate.
        PointLayout::new(0.5, 1.0, vec![set]).unwrap()
    }

    #[test]
    fn values_are_kept_by_light_and_bad_ones_are_refused() {
        let layout = layout(3);
        let mut held = LightVisibility::new(&layout, 2, vec![0, 1, 2, 29, 30, 31]).unwrap();
        assert_eq!(
            (held.get(1, 1), held.get(2, 0), held.get(3, 0), held.get(0, 2)),
            (Some(30), Some(2), None, None)
        );
        assert_eq!(held.fraction(2, 1), Some(1.0));
        let before = (held.clone(), held.hash());
        let change = |index, new| LightChange { index, new, ..LightChange::default() };
        let bad = [change(0, 9), change(6, 0)];
        assert_eq!(held.apply(&bad), Err(LightVisibilityError::NoSuchValue { index: 6, values: 6 }));
        assert_eq!(held.apply(&[change(1, 32)]), Err(LightVisibilityError::BadValue { index: 1, value: 32 }));
        assert_eq!((held.clone(), held.hash()), before);
        held.apply(&bad[..1]).unwrap();
        assert_eq!(held.values(), [9, 1, 2, 29, 30, 31]);
        assert_ne!(held.hash(), before.1);
        assert!(LightVisibility::new(&layout, 2, vec![0; 5]).is_err());
        assert!(LightVisibility::new(&layout, 1, vec![0, 32, 0]).is_err());
    }

    #[test]
    fn leans_are_of_what_is_half_seen() {
        let layout = layout(3);
        let values = LightVisibility::new(&layout, 1, vec![0, 9, OPEN]).unwrap();
        let [none, some] = [Lean::NONE, Lean([-4, 3])];
        assert!(!values.has_leans() && values.leans_of_light(0).is_empty() && values.lean(1) == none);
        let of = |leans: Vec<Lean>| values.clone().with_leans(leans);
        for bad in [vec![none; 2], vec![none; 4], vec![some, none, none], vec![none, Lean([0, 5]), none]] {
            assert!(matches!(of(bad), Err(LightVisibilityError::BadLeans { .. })));
        }
        let mut held = of(vec![none, some, none]).unwrap();
        assert_ne!(held.hash(), values.hash());
        assert_eq!((held.lean(1), held.lean(7), held.leans_of_light(1).len()), (some, none, 0));
        assert!(!held.set(1, 9, some) && held.set(1, 9, Lean([-4, 2])) && held.set(1, OPEN, some));
        assert_eq!(held.lean(1), none);
        held.apply(&[LightChange { index: 0, new: 5, new_lean: Lean([9, 1]), ..LightChange::default() }])
            .unwrap();
        assert_eq!(held.lean(0), Lean([4, 1]));
    }

    #[test]
    fn sizes_are_bounded() {
        assert!(LightVisibility::open(&layout(0), MAX_LIGHTS).is_ok());
        assert!(LightVisibility::open(&layout(0), MAX_LIGHTS + 1).is_err());
        assert!(LightVisibility::open(&layout(4097), MAX_LIGHTS).is_err());
        let two = LightVisibility::open(&layout(4), 3).unwrap();
        let other = LightVisibility::open(&layout(3), 4).unwrap();
        assert_ne!(two.hash(), other.hash(), "as many values, but of others");
    }

    #[test]
    fn fractions_are_rounded_to_the_nearest_step() {
        assert_eq!([0.0, 1.0, 0.5, 0.016, -3.0, 7.0, f32::NAN].map(quantized), [0, 31, 16, 0, 0, 31, 31]);
        for i in 0..=1000 {
            let fraction = i as f32 / 1000.0;
            assert!((f32::from(quantized(fraction)) - 31.0 * fraction).abs() <= 0.5001, "{fraction}");
        }
    }
}
