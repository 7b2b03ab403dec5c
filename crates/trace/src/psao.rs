//! Points that carry visibility: where they lie ([Neff2023] sec. 3.1) and what is traced again (sec. 3.3).

pub mod generate;
pub mod update;
