//! Exactness and truth of the atlas.
