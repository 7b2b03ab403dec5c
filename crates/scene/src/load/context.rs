//! What all parts of a load share: the file's name, its warnings, and the memory it may still use.

use std::cell::{Cell, RefCell};

use super::{Files, LoadError};
use crate::Warning;

/// Decoded geometry and animation may take this much for any file …
const GEOMETRY_BASE_BYTES: u64 = 64 << 20;
/// … and this much more for each byte that was read. Honest files need up to about ten.
const GEOMETRY_BYTES_PER_INPUT_BYTE: u64 = 64;
/// Decoded images of one scene.
pub(super) const IMAGE_LIMIT_BYTES: u64 = 256 << 20;
/// Longest file that is read through [`Files`].
pub(super) const EXTERNAL_FILE_LIMIT_BYTES: u64 = 2 << 30;
/// More warnings than this are only counted.
const MAX_WARNINGS: usize = 100;

/// Coordinates and animated values beyond this are refused: their squares would overflow.
const LARGEST_NUMBER: f32 = 1e15;

pub(super) struct Context<'a> {
    pub(super) file: &'a str,
    pub(super) files: &'a dyn Files,
    warnings: RefCell<Vec<Warning>>,
    unlisted_warnings: Cell<usize>,
    geometry_limit_bytes: Cell<u64>,
    geometry_used_bytes: Cell<u64>,
    image_left_bytes: Cell<u64>,
}

impl<'a> Context<'a> {
    pub(super) fn new(file: &'a str, input_bytes: usize, files: &'a dyn Files) -> Self {
        let context = Context {
            file,
            files,
            warnings: RefCell::default(),
            unlisted_warnings: Cell::new(0),
            geometry_limit_bytes: Cell::new(GEOMETRY_BASE_BYTES),
            geometry_used_bytes: Cell::new(0),
            image_left_bytes: Cell::new(IMAGE_LIMIT_BYTES),
        };
        context.count_input(input_bytes);
        context
    }

    /// Raises the memory limit for bytes that really exist.
    pub(super) fn count_input(&self, bytes: usize) {
        let more = (bytes as u64).saturating_mul(GEOMETRY_BYTES_PER_INPUT_BYTE);
        self.geometry_limit_bytes.set(self.geometry_limit_bytes.get().saturating_add(more));
    }

    /// Claims memory before it is allocated.
    pub(super) fn charge(&self, at: &str, elements: u64, bytes_per_element: u64) -> Result<(), LoadError> {
        let bytes = elements.saturating_mul(bytes_per_element);
        let used = self.geometry_used_bytes.get().saturating_add(bytes);
        let limit_bytes = self.geometry_limit_bytes.get();
        if used > limit_bytes {
            return Err(LoadError::TooLarge { file: self.file(), at: at.to_owned(), bytes, limit_bytes });
        }
        self.geometry_used_bytes.set(used);
        Ok(())
    }

    pub(super) fn image_left_bytes(&self) -> u64 {
        self.image_left_bytes.get()
    }

    pub(super) fn use_image_bytes(&self, bytes: u64) {
        self.image_left_bytes.set(self.image_left_bytes.get().saturating_sub(bytes));
    }

    pub(super) fn warn(&self, message: String) {
        let mut warnings = self.warnings.borrow_mut();
        if warnings.len() < MAX_WARNINGS {
            warnings.push(Warning { message });
        } else {
            self.unlisted_warnings.set(self.unlisted_warnings.get() + 1);
        }
    }

    pub(super) fn into_warnings(self) -> Vec<Warning> {
        let mut warnings = self.warnings.into_inner();
        let unlisted = self.unlisted_warnings.get();
        if unlisted > 0 {
            warnings.push(Warning { message: format!("and {unlisted} more warnings like these") });
        }
        warnings
    }

    pub(super) fn file(&self) -> String {
        self.file.to_owned()
    }

    pub(super) fn invalid(&self, at: impl Into<String>, problem: impl Into<String>) -> LoadError {
        LoadError::Invalid { file: self.file(), at: at.into(), problem: problem.into() }
    }

    pub(super) fn not_finite(&self, at: impl Into<String>) -> LoadError {
        LoadError::NotFinite { file: self.file(), at: at.into() }
    }

    pub(super) fn out_of_range(
        &self,
        at: impl Into<String>,
        what: &'static str,
        index: u64,
        count: usize,
    ) -> LoadError {
        LoadError::OutOfRange { file: self.file(), at: at.into(), what, index, count: count as u64 }
    }

    pub(super) fn truncated(&self, at: impl Into<String>, needs_bytes: u64, has_bytes: u64) -> LoadError {
        LoadError::Truncated { file: self.file(), at: at.into(), needs_bytes, has_bytes }
    }
}

/// Whether a number can be computed with: neither NaN nor too large.
pub(super) fn is_usable(x: f32) -> bool {
    x.abs() <= LARGEST_NUMBER
}
