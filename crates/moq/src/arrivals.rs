//! The host's end: viewers that want to be heard.

use std::collections::BTreeSet;
use std::sync::Arc;

use dapple_session::MAX_FROM_VIEWER_BYTES;
use futures_channel::oneshot;
use futures_util::future::{Either, select};
use moq_net::{announce, broadcast, origin, track};

use crate::names::{LOOKS, TALK, is_viewer};
use crate::pump::{Messages, Pump};
use crate::texts::{Texts, read, subscription, text};
use crate::viewer::Words;
use crate::{LinkError, Message, Names};

/// Viewers as they come, wherever they are connected.
pub struct Arrivals {
    origin: origin::Producer,
    consumer: origin::Consumer,
    announced: announce::Consumer,
    names: Names,
    /// Who is announced, heard or not.
    here: BTreeSet<String>,
    /// Each that is heard holds one of these.
    places: Arc<()>,
    most: usize,
}

impl Arrivals {
    /// Of a host with these names; so many at a time, the others are not heard.
    ///
    /// # Errors
    /// The origin does not allow it.
    pub fn new(origin: &origin::Producer, names: &Names, most: usize) -> Result<Arrivals, LinkError> {
        let consumer = origin.consume().scope("", &names.rights("*")?.1)?;
        let announced = consumer.announced();
        let (origin, names) = (origin.clone(), names.clone());
        let (here, places) = (BTreeSet::new(), Arc::new(()));
        Ok(Arrivals { origin, consumer, announced, names, here, places, most })
    }

    /// The next viewer: where to say something to it, and what it says. `None` once the origin has ended.
    pub async fn next(&mut self) -> Option<(HostOut, HostIn)> {
        loop {
            let update = self.announced.next().await?;
            let path = update.prefix.as_str().to_owned();
            let name = path.rsplit('/').next().unwrap_or_default().to_owned();
            if !update.kind.is_active() {
                self.here.remove(&name);
                continue;
            }
            let is_one = is_viewer(&name) && path == self.names.from_viewer(&name);
            if !is_one || self.here.len() >= 4 * self.most || !self.here.insert(name.clone()) {
                continue;
            }
            if Arc::strong_count(&self.places) > self.most {
                tracing::debug!("more than {} want to be heard", self.most);
                continue;
            }
            match HostOut::new(&self.origin, &self.names.to_viewer(&name)) {
                Ok(out) => return Some((out, HostIn::new(self.consumer.clone(), path, self.places.clone()))),
                Err(error) => tracing::debug!("a viewer cannot be answered: {error}"),
            }
        }
    }
}

/// Says something to one viewer.
pub struct HostOut {
    broadcast: broadcast::Producer,
    words: Words,
}

impl HostOut {
    fn new(origin: &origin::Producer, path: &str) -> Result<HostOut, LinkError> {
        let broadcast = origin.create_broadcast(path)?;
        let words = Words::new(broadcast.create_track(TALK, None)?);
        broadcast.announce(origin::Route::default())?;
        Ok(HostOut { broadcast, words })
    }

    /// Sends a text. It waits here for who is slow, a bounded number of texts.
    ///
    /// # Errors
    /// The viewer is gone.
    pub fn send(&mut self, text: Arc<str>) -> Result<(), LinkError> {
        self.words.write(&text, false)
    }

    /// Says that this was the last. Whoever is to hear it must come for it before this is dropped.
    pub fn finish(&mut self) {
        self.words.finish();
    }
}

impl Drop for HostOut {
    fn drop(&mut self) {
        self.words.finish();
        self.broadcast.close();
    }
}

/// What one viewer says.
pub struct HostIn {
    pump: Pump,
    _place: Arc<()>,
}

impl HostIn {
    fn new(consumer: origin::Consumer, path: String, place: Arc<()>) -> HostIn {
        let pump = Pump::new(move |messages| {
            Box::pin(async move {
                let broadcast = consumer.request_broadcast(path.as_str()).await?;
                // A hello must be heard, whenever it was said.
                let talk = subscription().with_max_age(std::time::Duration::from_secs(10));
                let talk = broadcast.track(TALK)?.subscribe(talk).await?;
                let looks = broadcast.track(LOOKS)?.subscribe(subscription()).await?;
                let (heard, is_heard) = oneshot::channel();
                let (talk, looks) = (hear(talk, messages.clone(), heard), look(looks, messages, is_heard));
                match select(Box::pin(talk), Box::pin(looks)).await {
                    Either::Left((ended, _)) | Either::Right((ended, _)) => ended,
                }
            })
        });
        HostIn { pump, _place: place }
    }

    /// The next message; `None` once it has gone.
    ///
    /// # Errors
    /// It broke a rule, or its connection broke.
    pub async fn receive(&mut self) -> Result<Option<Message>, LinkError> {
        self.pump.next().await
    }
}

async fn hear(
    talk: track::Subscriber,
    mut messages: Messages,
    heard: oneshot::Sender<()>,
) -> Result<(), LinkError> {
    let mut texts = Texts::new(talk, MAX_FROM_VIEWER_BYTES);
    let mut heard = Some(heard);
    while let Some((text, _)) = texts.next().await? {
        messages.put(Message::Text(text)).await?;
        if let Some(heard) = heard.take() {
            let _ = heard.send(());
        }
    }
    Ok(())
}

/// One look a group, once the hello was heard: those that were overtaken need not come.
async fn look(
    mut looks: track::Subscriber,
    mut messages: Messages,
    is_heard: oneshot::Receiver<()>,
) -> Result<(), LinkError> {
    let _ = is_heard.await;
    while let Some(mut group) = looks.recv_group().await? {
        match read(&mut group, MAX_FROM_VIEWER_BYTES).await {
            Ok(Some(bytes)) => messages.put(Message::Text(text(bytes)?)).await?,
            Ok(None) | Err(LinkError::Ended(_)) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
