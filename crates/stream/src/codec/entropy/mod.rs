//! Entropy coding: choices with learned chances, and whole numbers made of such choices.

mod number;
mod range;

pub(crate) use number::Number;
#[cfg(feature = "publish")]
pub(crate) use range::Writer;
pub(crate) use range::{Chance, Coder, Reader};
