//! A layout and the visibility of its points.

use std::sync::Arc;

use super::PointLayout;

/// What one end holds at one epoch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointStore {
    layout: Arc<PointLayout>,
    visibility: Vec<u8>,
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
}

impl PointStore {
    /// A store with the given values, one a point.
    pub fn new(layout: Arc<PointLayout>, visibility: Vec<u8>) -> Result<PointStore, StoreError> {
        if visibility.len() != layout.len() {
            return Err(StoreError::WrongCount { values: visibility.len(), points: layout.len() });
        }
        Ok(PointStore { layout, visibility })
    }

    /// Where the points lie.
    pub fn layout(&self) -> &Arc<PointLayout> {
        &self.layout
    }

    /// Visibility of each point, 255 = open.
    pub fn visibility(&self) -> &[u8] {
        &self.visibility
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
}
