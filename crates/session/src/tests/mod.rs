//! Both ends of sessions over links that misbehave, on a clock that is only a number.

mod drill;
mod drills;
mod groups;
mod hostile;
mod link;
mod messages;
