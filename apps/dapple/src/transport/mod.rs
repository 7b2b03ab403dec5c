//! Links that carry the messages of a live session.

#[cfg(feature = "moq")]
pub(crate) mod moq;
pub(crate) mod ws;

use std::future::Future;
use std::sync::Arc;

/// A message on its way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Message {
    Text(String),
    Bytes(Vec<u8>),
}

/// Why a link has ended.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LinkError {
    /// The other end closed it, or it broke.
    #[error("the connection ended: {0}")]
    Ended(String),
    /// What came breaks a rule of the link, such as one about lengths.
    #[error("{0}")]
    Refused(String),
}

/// The end of a link that messages are put into.
pub(crate) trait Outbound: Send {
    /// Whether what is sent comes, once and in order, unless the link ends.
    const IS_RELIABLE: bool;

    /// Sends a message; waits while the link is full, so that nothing piles up here.
    fn send_text(&mut self, text: Arc<str>) -> impl Future<Output = Result<(), LinkError>> + Send;

    /// As `send_text`, of bytes.
    fn send_bytes(&mut self, bytes: Arc<[u8]>) -> impl Future<Output = Result<(), LinkError>> + Send;

    /// Says goodbye and sees that everything before is sent.
    fn close(&mut self) -> impl Future<Output = ()> + Send;
}

/// The end of a link that messages come out of.
pub(crate) trait Inbound: Send {
    /// The next message; `None` once the other end has closed the link in order.
    fn receive(&mut self) -> impl Future<Output = Result<Option<Message>, LinkError>> + Send;
}
