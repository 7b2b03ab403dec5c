//! The viewer's end: takes what all share, and says what it has to say.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use dapple_session::{FromHost, FromViewer, MAX_FROM_HOST_BYTES, PROTOCOL, Reason, Refusal, Terms, WIRE};
use futures_channel::{mpsc, oneshot};
use futures_util::future::{Either, select, try_join};
use moq_net::{Timestamp, broadcast, group, origin, track};

use crate::about::MAX_ABOUT_BYTES;
use crate::light::{self, Seen};
use crate::names::{ABOUT, LOOKS, STATE, TALK};
use crate::pump::{Messages, Pump};
use crate::texts::{Texts, subscription};
use crate::{About, LinkError, Message, Names};

/// Most messages of a group of words.
const MAX_WORDS: usize = 64;

/// What a viewer has, and what it wants.
#[derive(Clone, Debug, Default)]
pub struct Wish {
    /// The hash of the scene that it has loaded, 64 hexadecimal digits.
    pub scene: String,
    /// Most bits of light a second; `None`: as many as there are.
    pub bits_per_s: Option<u64>,
    /// Its name, 32 to 64 hexadecimal digits that nobody can guess.
    pub viewer: String,
    /// Whether it can take the light in parts, and its looks say which it needs. Parts have no budget: who wants one takes the light as one.
    pub parts: bool,
}

/// Finds a host and what it says of itself: `from` is what the connection brings, and what is written to `to` must go out by it. Waits until the host is
/// there.
///
/// # Errors
/// The connection has ended, or what is there is no host.
pub async fn join(
    from: &origin::Consumer,
    to: &origin::Producer,
    names: &Names,
    wish: &Wish,
) -> Result<(ViewerOut, ViewerIn), LinkError> {
    if !crate::names::is_viewer(&wish.viewer) {
        return Err(LinkError::Refused(format!("{:?} is no name of a viewer", wish.viewer)));
    }
    let shared = from.routed_broadcast(names.shared()).await?;
    let mut about = Texts::new(shared.track(ABOUT)?.subscribe(subscription()).await?, MAX_ABOUT_BYTES);
    let Some((text, _)) = about.next().await? else {
        return Err(LinkError::Ended("the host has ended".to_owned()));
    };
    let about = About::parse(&text)?;
    let (sees, seen) = mpsc::unbounded();
    let own = to.create_broadcast(names.from_viewer(&wish.viewer).as_str())?;
    let out = ViewerOut {
        talk: Words::new(own.create_track(TALK, None)?),
        looks: own.create_track(LOOKS, None)?,
        lost: Arc::default(),
        broadcast: own,
        sees,
    };
    out.broadcast.announce(origin::Route::default())?;
    let host = Terms { protocol: about.protocol, wire: about.wire, scene: &about.scene };
    let viewer = Terms { protocol: PROTOCOL, wire: WIRE, scene: &wish.scene };
    let rung = about.stream_for(wish.bits_per_s);
    let reading = Reader {
        from: from.clone(),
        to_viewer: names.to_viewer(&wish.viewer),
        // Said as the host would, to those too who do not ask it.
        refusal: viewer.refusal(host),
        rung,
        parts: (wish.parts && wish.bits_per_s.is_none() && about.parts > 0).then_some((about.parts, seen)),
        shared,
        lost: out.lost.clone(),
    };
    Ok((out, ViewerIn(Pump::new(|messages| Box::pin(reading.run(messages))))))
}

/// Says what a viewer has to say.
pub struct ViewerOut {
    talk: Words,
    looks: track::Producer,
    /// Breaks that it told of.
    lost: Arc<AtomicU32>,
    /// Parts of the light that it sees; all where it does not say.
    sees: mpsc::UnboundedSender<Option<Vec<u8>>>,
    /// It is gone with this.
    broadcast: broadcast::Producer,
}

impl ViewerOut {
    /// Says a text of a `dapple_session::Guest`.
    ///
    /// # Errors
    /// The connection has ended.
    pub fn send(&mut self, text: &str) -> Result<(), LinkError> {
        match FromViewer::parse(text) {
            Ok(FromViewer::Look(look)) => {
                self.lost.store(look.lost, Ordering::Relaxed);
                // Nobody listens where the light comes as one.
                let _ = self.sees.unbounded_send(look.parts);
                let mut group = self.looks.append_group()?;
                group.write_frame(Timestamp::now(), text.to_owned())?;
                Ok(group.finish()?)
            }
            Ok(FromViewer::Hello(_)) => self.talk.write(text, true),
            _ => self.talk.write(text, false),
        }
    }

    /// Ends it in order.
    pub fn close(&mut self) {
        self.talk.finish();
        // If it cannot be ended, it is gone already.
        let _ = self.looks.finish();
        self.broadcast.close();
    }
}

impl Drop for ViewerOut {
    fn drop(&mut self) {
        self.close();
    }
}

/// A track of words. Each group of a viewer's begins with its hello, so that whoever has missed one knows who speaks.
pub(crate) struct Words {
    track: track::Producer,
    group: Option<group::Producer>,
    first: Option<String>,
    written: usize,
}

impl Words {
    pub(crate) fn new(track: track::Producer) -> Words {
        Words { track, group: None, first: None, written: 0 }
    }

    pub(crate) fn write(&mut self, text: &str, is_first: bool) -> Result<(), LinkError> {
        if is_first {
            self.first = Some(text.to_owned());
        }
        if self.written >= MAX_WORDS {
            self.end();
        }
        let is_new = self.group.is_none();
        if is_new {
            (self.group, self.written) = (Some(self.track.append_group()?), 0);
        }
        let Some(group) = &mut self.group else { return Ok(()) };
        if let Some(first) = self.first.as_ref().filter(|_| is_new && !is_first) {
            group.write_frame(Timestamp::now(), first.clone())?;
        }
        self.written += 1;
        Ok(group.write_frame(Timestamp::now(), text.to_owned())?)
    }

    pub(crate) fn finish(&mut self) {
        self.end();
        let _ = self.track.finish();
    }

    fn end(&mut self) {
        if let Some(group) = self.group.take() {
            // If it cannot be ended, the track is gone already.
            let _ = group.finish();
        }
    }
}

/// What comes for a viewer.
pub struct ViewerIn(Pump);

impl ViewerIn {
    /// The next message for a `dapple_session::Guest`; `None` once the host has ended.
    ///
    /// # Errors
    /// The connection broke, or something came that breaks a rule.
    pub async fn receive(&mut self) -> Result<Option<Message>, LinkError> {
        self.0.next().await
    }
}

struct Reader {
    from: origin::Consumer,
    to_viewer: String,
    refusal: Option<Refusal>,
    rung: usize,
    /// How many parts the light comes in, if it does, and what the viewer sees of them.
    parts: Option<(usize, Seen)>,
    shared: broadcast::Consumer,
    lost: Arc<AtomicU32>,
}

impl Reader {
    async fn run(self, mut messages: Messages) -> Result<(), LinkError> {
        if let Some(refusal) = self.refusal {
            return messages.put(Message::Text(FromHost::Refused(refusal).to_text())).await;
        }
        let (for_light, light_may) = oneshot::channel();
        let (for_words, words_may) = oneshot::channel();
        let state = state(&self.shared, messages.clone(), [for_light, for_words]);
        let light = light::read(&self.shared, self.rung, self.parts, &self.lost, messages.clone(), light_may);
        let words = words(&self.from, &self.to_viewer, messages, words_may);
        let shared = Box::pin(try_join(state, light));
        match select(shared, Box::pin(words)).await {
            Either::Left((ended, _)) => ended.map(|_| ()),
            Either::Right((ended, _)) => ended,
        }
    }
}

/// The state, and before it a welcome for all: to look.
async fn state(
    shared: &broadcast::Consumer,
    mut messages: Messages,
    welcomed: [oneshot::Sender<()>; 2],
) -> Result<(), LinkError> {
    let mut texts = Texts::new(shared.track(STATE)?.subscribe(subscription()).await?, MAX_FROM_HOST_BYTES);
    let mut welcomed = Some(welcomed);
    while let Some((text, is_first)) = texts.next().await? {
        // Later groups begin with a welcome too, for those who come then.
        if is_first && welcomed.is_none() {
            continue;
        }
        messages.put(Message::Text(text)).await?;
        for waits in welcomed.take().into_iter().flatten() {
            let _ = waits.send(());
        }
    }
    Ok(())
}

/// What is said to this viewer alone, once it was welcomed as one of all.
async fn words(
    from: &origin::Consumer,
    path: &str,
    mut messages: Messages,
    is_welcome: oneshot::Receiver<()>,
) -> Result<(), LinkError> {
    let _ = is_welcome.await;
    let broadcast = from.routed_broadcast(path).await?;
    let talk = subscription().with_max_age(std::time::Duration::from_secs(10));
    let mut texts = Texts::new(broadcast.track(TALK)?.subscribe(talk).await?, MAX_FROM_HOST_BYTES);
    while let Some((text, _)) = texts.next().await? {
        if let Ok(FromHost::Refused(refusal)) = FromHost::parse(&text)
            && refusal.reason == Reason::Full
        {
            // There is no place among those who are heard: it looks on.
            tracing::info!("{}: looking on", refusal.message);
            return std::future::pending().await;
        }
        messages.put(Message::Text(text)).await?;
    }
    Err(LinkError::Ended("the host hears this viewer no more".to_owned()))
}
