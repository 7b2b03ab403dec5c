//! A live session over Media over QUIC (MoQ): light and the scene's state in tracks that relays fan out, and words of single viewers in broadcasts of their
//! own.
//!
//! ```text
//! NAME/all          about, state, light/K, snapshot/K      one publisher, any number of viewers through any number of relays
//! NAME/in/VIEWER    talk, looks                            a viewer who wants to be heard
//! NAME/out/VIEWER   talk                                   what is said to it alone
//! ```
//!
//! `docs/live.md` ("Over MoQ") is normative. What opens connections (QUIC, WebTransport) is not here: both ends are given the origin that their connection
//! serves.

mod about;
mod light;
mod names;
mod pump;
mod texts;
mod viewer;

#[cfg(feature = "host")]
mod arrivals;
#[cfg(feature = "host")]
mod broadcast;

pub use about::{About, Stream};
#[cfg(feature = "host")]
pub use arrivals::{Arrivals, HostIn, HostOut};
#[cfg(feature = "host")]
pub use broadcast::Broadcast;
pub use moq_net;
pub use names::{Names, check_name};
pub use viewer::{ViewerIn, ViewerOut, Wish, join};

/// A message that came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Message {
    /// As text.
    Text(String),
    /// As bytes.
    Bytes(bytes::Bytes),
}

/// Why a link has ended.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The connection, or what was published over it, is gone.
    #[error("the connection ended: {0}")]
    Ended(String),
    /// What came breaks a rule.
    #[error("{0}")]
    Refused(String),
}

impl From<moq_net::Error> for LinkError {
    fn from(error: moq_net::Error) -> Self {
        LinkError::Ended(error.to_string())
    }
}
