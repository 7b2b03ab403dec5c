//! A layout and the visibility of its points, with or without their bent normals, and how much of each light they see.

use std::sync::Arc;

use super::{BentChange, BentNormal, BentPlanes, PointLayout};
use crate::light_visibility::{LightChange, LightVisibility, LightVisibilityError};

/// What one end holds at one epoch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointStore {
    pub(super) layout: Arc<PointLayout>,
    pub(super) visibility: Vec<u8>,
    pub(super) bent: Option<Box<BentPlanes>>,
    pub(super) lights: Option<Box<LightVisibility>>,
}

/// A point's new visibility.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// Index of the point in the store.
    pub point: u32,
    /// New visibility, 255 = open.
    pub visibility: u8,
}

/// Why values or changes do not fit the layout.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// The number of values is not the number of points.
    #[error("store: {values} values for {points} points")]
    WrongCount {
        /// Values given.
        values: usize,
        /// Points of the layout.
        points: usize,
    },
    /// A change names a point that does not exist.
    #[error("store: change of point {point}, there are only {points}")]
    NoSuchPoint {
        /// The index.
        point: u32,
        /// Points of the layout.
        points: usize,
    },
    /// A change of bent normals of a store that has none.
    #[error("store: change of bent normals, but there are none")]
    NoBentNormals,
    /// A change of lights' visibility of a store that has none.
    #[error("store: change of lights' visibility, but there is none")]
    NoLights,
    /// Lights' visibility does not fit.
    #[error(transparent)]
    Lights(#[from] LightVisibilityError),
}

impl PointStore {
    /// A store with the given values, one a point.
    pub fn new(layout: Arc<PointLayout>, visibility: Vec<u8>) -> Result<PointStore, StoreError> {
        if visibility.len() != layout.len() {
            return Err(StoreError::WrongCount { values: visibility.len(), points: layout.len() });
        }
        Ok(PointStore { layout, visibility, bent: None, lights: None })
    }

    /// The same with bent normals, two bytes a point in as many lists.
    pub fn with_bent(self, bent: BentPlanes) -> Result<PointStore, StoreError> {
        let points = self.layout.len();
        if let Some(plane) = bent.iter().find(|plane| plane.len() != points) {
            return Err(StoreError::WrongCount { values: plane.len(), points });
        }
        Ok(PointStore { bent: Some(Box::new(bent)), ..self })
    }

    /// The same with how much of each light the points see; at least one light.
    ///
    /// # Errors
    /// It is of another number of points, or of no light.
    pub fn with_lights(self, lights: LightVisibility) -> Result<PointStore, StoreError> {
        let points = self.layout.len();
        if lights.points() != points || lights.lights() == 0 {
            let (values, lights) = (lights.values().len(), lights.lights());
            return Err(LightVisibilityError::WrongCount { values, points, lights }.into());
        }
        Ok(PointStore { lights: Some(Box::new(lights)), ..self })
    }

    /// Where the points lie.
    pub fn layout(&self) -> &Arc<PointLayout> {
        &self.layout
    }

    /// Visibility of each point, 255 = open.
    pub fn visibility(&self) -> &[u8] {
        &self.visibility
    }

    /// Bent normals, if it has any: the first and the second byte of each point.
    pub fn bent(&self) -> Option<&BentPlanes> {
        self.bent.as_deref()
    }

    /// A point's bent normal; `None` where there are none, or no such point.
    pub fn bent_of(&self, point: usize) -> Option<BentNormal> {
        let [first, second] = self.bent()?;
        Some(BentNormal([*first.get(point)?, *second.get(point)?]))
    }

    /// How much of each light the points see, if that is held.
    pub fn lights(&self) -> Option<&LightVisibility> {
        self.lights.as_deref()
    }

    /// Of how many lights that is; 0 where it is not held.
    pub fn light_count(&self) -> u32 {
        self.lights().map_or(0, LightVisibility::lights)
    }

    /// Bytes held beside the layout, which is shared.
    pub fn value_bytes(&self) -> usize {
        let bent: usize = self.bent().map_or(0, |planes| planes.iter().map(Vec::len).sum());
        self.visibility.len() + bent + self.lights().map_or(0, LightVisibility::bytes)
    }

    /// Applies changes; all or, if one is out of range, none.
    pub fn apply(&mut self, changes: &[Change]) -> Result<(), StoreError> {
        let points = self.visibility.len();
        if let Some(bad) = changes.iter().find(|c| c.point as usize >= points) {
            return Err(StoreError::NoSuchPoint { point: bad.point, points });
        }
        for change in changes {
            self.visibility[change.point as usize] = change.visibility;
        }
        Ok(())
    }

    /// Applies changes of bent normals, of which only what is new counts; all or, if one does not fit, none.
    pub fn apply_bent(&mut self, changes: &[BentChange]) -> Result<(), StoreError> {
        if changes.is_empty() {
            return Ok(());
        }
        let points = self.visibility.len();
        if let Some(bad) = changes.iter().find(|c| c.point as usize >= points) {
            return Err(StoreError::NoSuchPoint { point: bad.point, points });
        }
        let [first, second] = self.bent.as_deref_mut().ok_or(StoreError::NoBentNormals)?;
        for change in changes {
            [first[change.point as usize], second[change.point as usize]] = change.new.0;
        }
        Ok(())
    }

    /// Applies changes of lights' visibility, of which only what is new counts; all or, if one does not fit, none.
    pub fn apply_lights(&mut self, changes: &[LightChange]) -> Result<(), StoreError> {
        if changes.is_empty() {
            return Ok(());
        }
        Ok(self.lights.as_deref_mut().ok_or(StoreError::NoLights)?.apply(changes)?)
    }
}
