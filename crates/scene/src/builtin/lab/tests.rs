//! The laboratory as a file.
