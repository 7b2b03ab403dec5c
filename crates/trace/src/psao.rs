//! Points that carry visibility: where they lie ([Neff2023] sec. 3.1) what is traced again (sec. 3.3), and what stands between
//! a point and a texel that it would count at; and which instances have points at all. And beside it the scheme of the paper as it stands there.

pub mod cuts;
pub mod generate;
pub mod paper;
pub mod residency;
pub mod update;
