//! Reading tracks: a message a frame, none longer than expected.

use std::time::Duration;

use bytes::Bytes;
use moq_net::group;
use moq_net::track::{self, Subscription};

use crate::LinkError;

/// How long a group may take to come once a newer one has begun.
const PATIENCE: Duration = Duration::from_secs(1);

/// How words and the state are asked for: they go before light where a link is full.
pub(crate) fn subscription() -> Subscription {
    light_subscription().with_priority(2)
}

/// How light is asked for.
pub(crate) fn light_subscription() -> Subscription {
    Subscription::default().with_max_age(PATIENCE).with_priority(1)
}

/// The next frame of a group, `None` at its end.
pub(crate) async fn read(group: &mut group::Consumer, max_bytes: usize) -> Result<Option<Bytes>, LinkError> {
    let Some(mut frame) = group.next_frame().await? else { return Ok(None) };
    if frame.size > max_bytes as u64 {
        return Err(LinkError::Refused(format!("a message of {} bytes, {max_bytes} are taken", frame.size)));
    }
    Ok(Some(frame.read_all().await?))
}

/// A frame as text.
pub(crate) fn text(bytes: Bytes) -> Result<String, LinkError> {
    String::from_utf8(bytes.into()).map_err(|_| LinkError::Refused("a text that is not UTF-8".to_owned()))
}

/// All texts of a track, group after group: where one is cut off, with the next.
pub(crate) struct Texts {
    track: track::Ordered,
    group: Option<group::Consumer>,
    max_bytes: usize,
}

impl Texts {
    pub(crate) fn new(track: track::Subscriber, max_bytes: usize) -> Texts {
        Texts { track: track.ordered(), group: None, max_bytes }
    }

    /// The next text, and whether it is the first of its group; `None` once the track has ended.
    pub(crate) async fn next(&mut self) -> Result<Option<(String, bool)>, LinkError> {
        loop {
            let is_first = self.group.is_none();
            if is_first {
                let Some(group) = self.track.next_group().await? else { return Ok(None) };
                self.group = Some(group);
            }
            let Some(group) = &mut self.group else { continue };
            match read(group, self.max_bytes).await {
                Ok(Some(bytes)) => return Ok(Some((text(bytes)?, is_first))),
                Ok(None) | Err(LinkError::Ended(_)) => self.group = None,
                Err(error) => return Err(error),
            }
        }
    }
}
