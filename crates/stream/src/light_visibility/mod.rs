//! Visibility of lights at points ⇄ bodies: a snapshot, and deltas that build on it. Pure, and blind to frames and order: these are
//! the session's.
//!
//! - takes: [`LightVisibility`] as it is traced, and by how much each value may be off before one sees it
//! - returns: bytes; and of any bytes the values that the sender counts on, or what is wrong with them
//!
//! `README.md` has the bits.

#[cfg(test)]
mod tests;
mod walk;

use std::sync::Arc;

#[cfg(feature = "publish")]
use dapple_store::light_visibility::LightVisibilityError;
use dapple_store::light_visibility::{LightChange, LightVisibility, MAX_LIGHTS, OPEN};
use dapple_store::points::PointLayout;

use crate::DecodeError;
use crate::codec::entropy::Reader as Choices;
#[cfg(feature = "publish")]
use crate::codec::entropy::Writer;
#[cfg(feature = "publish")]
use crate::codec::local_bits;
use crate::codec::varint::Reader;
#[cfg(feature = "publish")]
use crate::codec::varint::write_varint;
use crate::codec::{MAX_LOCAL_BITS, Near, code_values};

/// What a receiver is willing to take. It holds a byte a value, and 8 more for each that changes while a body is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LightLimits {
    /// Most lights. Default [`MAX_LIGHTS`].
    pub max_lights: u32,
    /// Most values, lights × points. Default 4 million; at most
    /// [`MAX_VALUES`](dapple_store::light_visibility::MAX_VALUES) has an effect.
    pub max_values: u32,
}

impl Default for LightLimits {
    fn default() -> LightLimits {
        LightLimits { max_lights: MAX_LIGHTS, max_values: 1 << 22 }
    }
}

/// The sending end: knows what the receivers hold.
#[cfg(feature = "publish")]
#[derive(Clone, Debug)]
pub struct LightPublisher {
    layout: Arc<PointLayout>,
    local_bits: u32,
    near: Near,
    sent: LightVisibility,
}

#[cfg(feature = "publish")]
impl LightPublisher {
    /// Begins with these values of the points of `layout`.
    ///
    /// # Errors
    /// They are of another number of points.
    pub fn new(
        layout: Arc<PointLayout>,
        values: LightVisibility,
    ) -> Result<LightPublisher, LightVisibilityError> {
        check_same(&values, layout.len(), values.lights())?;
        let local_bits = local_bits(&layout);
        Ok(LightPublisher { near: Near::new(&layout, local_bits), layout, local_bits, sent: values })
    }

    /// What receivers hold that have got everything.
    pub fn sent(&self) -> &LightVisibility {
        &self.sent
    }

    /// A body with which a receiver joins here.
    pub fn snapshot(&self) -> Vec<u8> {
        let mut out = Vec::new();
        write_varint(&mut out, u64::from(self.sent.lights()));
        out.push(self.local_bits as u8);
        if self.sent.values().is_empty() {
            return out;
        }
        let mut coder = Writer::new(out);
        for light in 0..self.sent.lights() {
            let values = self.sent.of_light(light);
            // A writer gets back what it wrote.
            let written = code_values(&mut coder, &self.layout, &self.near, |point| values[point]);
            debug_assert_eq!(written.as_deref(), Ok(values));
        }
        coder.finish()
    }

    /// A body that brings receivers from what they hold to `values`, but for what is off by no more than its tolerance (steps; none where the list
    /// ends): that waits. Empty if all can wait.
    ///
    /// # Errors
    /// The values are of other points or lights; nothing changes then.
    pub fn delta(
        &mut self,
        values: &LightVisibility,
        tolerances: &[u8],
    ) -> Result<Vec<u8>, LightVisibilityError> {
        check_same(values, self.sent.points(), self.sent.lights())?;
        let mut wanted = self.sent.values().to_vec();
        for (index, (held, new)) in wanted.iter_mut().zip(values.values()).enumerate() {
            if held.abs_diff(*new) > tolerances.get(index).copied().unwrap_or(0) {
                *held = *new;
            }
        }
        if wanted == self.sent.values() {
            return Ok(Vec::new());
        }
        let mut coder = Writer::new(Vec::new());
        let held = self.sent.values();
        let changes = walk::code_changes(&mut coder, (&self.layout, &mut self.near), held, Some(&wanted));
        self.sent.apply(&changes.unwrap_or_default())?;
        debug_assert_eq!(self.sent.values(), wanted);
        let mut body = coder.finish();
        if body.is_empty() {
            // No bytes say that nothing changed; a reader goes on with zeros anyway.
            body.push(0);
        }
        Ok(body)
    }
}

#[cfg(feature = "publish")]
fn check_same(values: &LightVisibility, points: usize, lights: u32) -> Result<(), LightVisibilityError> {
    let is_same = values.points() == points && values.lights() == lights;
    let values = values.values().len();
    if is_same { Ok(()) } else { Err(LightVisibilityError::WrongCount { values, points, lights }) }
}

/// The receiving end.
#[derive(Clone, Debug)]
pub struct LightSubscriber {
    layout: Arc<PointLayout>,
    near: Near,
    held: LightVisibility,
}

impl LightSubscriber {
    /// Joins with a snapshot of values at the points of `layout`.
    ///
    /// # Errors
    /// The bytes are no snapshot of that many points, or say more than the limits allow.
    pub fn join(
        layout: Arc<PointLayout>,
        body: &[u8],
        limits: &LightLimits,
    ) -> Result<LightSubscriber, DecodeError> {
        const PART: &str = "visibility of lights";
        let bad = |reason| DecodeError::Malformed { part: PART, reason };
        let mut reader = Reader::new(body);
        let lights = reader.varint("number of lights")?;
        let too_large =
            |what, value, limit: u32| DecodeError::TooLarge { what, value, limit: u64::from(limit) };
        if lights > u64::from(limits.max_lights) {
            return Err(too_large("lights", lights, limits.max_lights));
        }
        let count = lights.saturating_mul(layout.len() as u64);
        if count > u64::from(limits.max_values) {
            return Err(too_large("values of lights", count, limits.max_values));
        }
        // Also where there are no points.
        let lights = u32::try_from(lights).unwrap_or(u32::MAX);
        LightVisibility::open(&layout, lights).map_err(|_| bad("is of more lights or points than fit"))?;
        let local_bits = u32::from(reader.byte(PART)?);
        if local_bits > MAX_LOCAL_BITS {
            return Err(bad("has cells that no layout has"));
        }
        let near = Near::new(&layout, local_bits);
        let rest = reader.take(reader.len(), PART)?;
        let mut coder = Choices::new(rest);
        let mut values = Vec::with_capacity(count as usize);
        for _ in 0..lights {
            let plane = code_values(&mut coder, &layout, &near, |_| 0).map_err(bad)?;
            if plane.iter().any(|value| *value > OPEN) {
                return Err(bad("exceeds that of a light of which all is seen"));
            }
            values.extend(plane);
        }
        if !is_done(&coder, rest, layout.is_empty() || lights == 0) {
            return Err(bad("has more or fewer bytes than it needs"));
        }
        let held =
            LightVisibility::new(&layout, lights, values).map_err(|_| bad("does not fit the layout"))?;
        Ok(LightSubscriber { layout, near, held })
    }

    /// What is held.
    pub fn visibility(&self) -> &LightVisibility {
        &self.held
    }

    /// Takes a delta, and tells what changed, in order.
    ///
    /// # Errors
    /// The bytes are no delta of these values; nothing changes then.
    pub fn apply(&mut self, body: &[u8]) -> Result<Vec<LightChange>, DecodeError> {
        const PART: &str = "changes of lights' visibility";
        let bad = |reason| DecodeError::Malformed { part: PART, reason };
        if body.is_empty() {
            return Ok(Vec::new());
        }
        let mut coder = Choices::new(body);
        let held = self.held.values();
        let changes = walk::code_changes(&mut coder, (&self.layout, &mut self.near), held, None);
        let changes = changes.ok_or_else(|| bad("end early"))?;
        if !is_done(&coder, body, held.is_empty()) {
            return Err(bad("have more or fewer bytes than they need"));
        }
        self.held.apply(&changes).map_err(|_| bad("do not fit"))?;
        Ok(changes)
    }
}

/// Whether a coder has read just these bytes. Where there is nothing to read there may be none.
fn is_done(coder: &Choices<'_>, bytes: &[u8], is_nothing: bool) -> bool {
    if is_nothing { bytes.is_empty() } else { coder.is_complete() }
}
