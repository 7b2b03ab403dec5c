//! Several tracks read at once, into one queue of messages.

use std::future::Future;
use std::pin::Pin;

use futures_channel::mpsc;
use futures_util::future::{Either, select};
use futures_util::{SinkExt, StreamExt};

use crate::{LinkError, Message};

/// Messages that wait to be taken: what is not taken keeps its track waiting.
const WAITING: usize = 4;

#[cfg(not(target_family = "wasm"))]
pub(crate) type Reading = Pin<Box<dyn Future<Output = Result<(), LinkError>> + Send>>;
#[cfg(target_family = "wasm")]
pub(crate) type Reading = Pin<Box<dyn Future<Output = Result<(), LinkError>>>>;

/// Where readers put what they read.
#[derive(Clone)]
pub(crate) struct Messages(mpsc::Sender<Message>);

impl Messages {
    /// Waits until there is room.
    pub(crate) async fn put(&mut self, message: Message) -> Result<(), LinkError> {
        self.0.send(message).await.map_err(|_| LinkError::Ended("nobody listens".to_owned()))
    }
}

/// Reads as long as it is asked for messages.
pub(crate) struct Pump {
    reading: Option<Reading>,
    messages: mpsc::Receiver<Message>,
    ended: Result<(), LinkError>,
}

impl Pump {
    pub(crate) fn new(read: impl FnOnce(Messages) -> Reading) -> Pump {
        let (sender, messages) = mpsc::channel(WAITING);
        Pump { reading: Some(read(Messages(sender))), messages, ended: Ok(()) }
    }

    /// The next message; `None` once reading has come to its end in order. Nothing is lost if this is not waited for.
    pub(crate) async fn next(&mut self) -> Result<Option<Message>, LinkError> {
        if let Some(reading) = &mut self.reading {
            match select(self.messages.next(), reading).await {
                Either::Left((message, _)) => return Ok(message),
                Either::Right((ended, _)) => (self.ended, self.reading) = (ended, None),
            }
        }
        // What was read before the end still counts.
        match self.messages.next().await {
            Some(message) => Ok(Some(message)),
            None => std::mem::replace(&mut self.ended, Ok(())).map(|()| None),
        }
    }
}
