//! A layout and the visibility of its points, with or without their bent normals.

use std::sync::Arc;

use super::{BentChange, BentNormal, BentPlanes, PointLayout};

/// What one end holds at one epoch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointStore {
    pub(super) layout: Arc<PointLayout>,
    pub(super) visibility: Vec<u8>,
    pub(super) bent: Option<Box<BentPlanes>>,
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
}

impl PointStore {
    /// A store with the given values, one a point.
    pub fn new(layout: Arc<PointLayout>, visibility: Vec<u8>) -> Result<PointStore, StoreError> {
        if visibility.len() != layout.len() {
            return Err(StoreError::WrongCount { values: visibility.len(), points: layout.len() });
        }
        Ok(PointStore { layout, visibility, bent: None })
    }

    /// The same with bent normals, two bytes a point in as many lists.
    pub fn with_bent(self, bent: BentPlanes) -> Result<PointStore, StoreError> {
        let points = self.layout.len();
        if let Some(plane) = bent.iter().find(|plane| plane.len() != points) {
            return Err(StoreError::WrongCount { values: plane.len(), points });
        }
        Ok(PointStore { bent: Some(Box::new(bent)), ..self })
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

    /// Bytes held beside the layout, which is shared.
    pub fn value_bytes(&self) -> usize {
        self.visibility.len() + self.bent().map_or(0, |planes| planes.iter().map(Vec::len).sum())
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
}
