//! What comes of the light: as one stream, or those of its parts that are seen.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU32, Ordering};

use dapple_session::MAX_LIGHT_MESSAGE_BYTES;
use futures_channel::{mpsc, oneshot};
use futures_util::StreamExt;
use futures_util::future::{AbortHandle, Either, abortable, ready, select};
use futures_util::stream::FuturesUnordered;
use moq_net::{broadcast, group, track};

use crate::names::{light, part, part_snapshot, snapshot};
use crate::pump::Messages;
use crate::texts::{light_subscription, read as read_frame};
use crate::{LinkError, Message};

/// What a viewer says of the parts that it sees: all where it says nothing.
pub(crate) type Seen = mpsc::UnboundedReceiver<Option<Vec<u8>>>;

/// Reads the light from when the viewer was welcomed on: of a rung, or, where it comes in so many parts, of those that the viewer sees.
pub(crate) async fn read(
    shared: &broadcast::Consumer,
    rung: usize,
    parts: Option<(usize, Seen)>,
    lost: &AtomicU32,
    messages: Messages,
    is_welcome: oneshot::Receiver<()>,
) -> Result<(), LinkError> {
    // A welcome says what becomes of light that was held before.
    let Some((count, seen)) = parts else {
        return Light::read(shared, (light(rung), snapshot(rung)), lost, messages, is_welcome).await;
    };
    let _ = is_welcome.await;
    read_parts(shared, count, seen, lost, messages).await
}

async fn read_parts(
    shared: &broadcast::Consumer,
    count: usize,
    mut seen: Seen,
    lost: &AtomicU32,
    messages: Messages,
) -> Result<(), LinkError> {
    let mut reading = FuturesUnordered::new();
    let mut handles: BTreeMap<usize, AbortHandle> = BTreeMap::new();
    loop {
        let wanted = if reading.is_empty() {
            seen.next().await
        } else {
            match select(seen.next(), reading.next()).await {
                Either::Left((wanted, _)) => wanted,
                // One that was given up.
                Either::Right((Some(Err(_)) | None, _)) => continue,
                // The host ends, or the connection.
                Either::Right((Some(Ok(ended)), _)) => return ended,
            }
        };
        // The viewer is gone.
        let Some(wanted) = wanted else { return Ok(()) };
        let wanted: Vec<usize> = match wanted {
            Some(wanted) => wanted.into_iter().map(usize::from).filter(|number| *number < count).collect(),
            None => (0..count).collect(),
        };
        handles.retain(|number, handle| {
            let stays = wanted.contains(number);
            if !stays {
                tracing::debug!(number, "a part is out of sight");
                handle.abort();
            }
            stays
        });
        for number in wanted {
            handles.entry(number).or_insert_with(|| {
                tracing::debug!(number, "a part comes into sight");
                let tracks = (part(number), part_snapshot(number));
                let (of_part, handle) =
                    abortable(Light::read(shared, tracks, lost, messages.clone(), ready(())));
                reading.push(of_part);
                handle
            });
        }
    }
}

/// A stream of light, group after group.
struct Light<'a> {
    track: track::Consumer,
    snapshots: track::Consumer,
    messages: Messages,
    /// The group that was read last, if all of it was.
    last: Option<u64>,
    /// Breaks that the viewer told of, and those that were mended.
    lost: &'a AtomicU32,
    mended: u32,
}

impl Light<'_> {
    /// Reads until the stream ends, from when `is_welcome` on.
    async fn read(
        shared: &broadcast::Consumer,
        (light, snapshot): (String, String),
        lost: &AtomicU32,
        messages: Messages,
        is_welcome: impl Future,
    ) -> Result<(), LinkError> {
        let (track, snapshots) = (shared.track(&light)?, shared.track(&snapshot)?);
        let mut groups = track.subscribe(light_subscription()).await?.ordered();
        is_welcome.await;
        let mended = lost.load(Ordering::Relaxed);
        let mut light = Light { track, snapshots, messages, last: None, lost, mended };
        while let Some(mut group) = groups.next_group().await? {
            let sequence = group.sequence;
            let follows = light.last.is_some_and(|last| last + 1 == sequence) && !light.is_broken();
            light.last = None;
            if !follows && !light.snapshot(sequence).await? {
                // It is gone; the next group has one too.
                continue;
            }
            if light.group(&mut group, sequence).await? {
                light.last = Some(sequence);
            }
        }
        Ok(())
    }

    /// Whether the viewer has found that something does not fit since this was mended last.
    fn is_broken(&self) -> bool {
        self.lost.load(Ordering::Relaxed) != self.mended
    }

    /// What a group builds on; false if it cannot be had.
    async fn snapshot(&mut self, sequence: u64) -> Result<bool, LinkError> {
        self.mended = self.lost.load(Ordering::Relaxed);
        let Ok(mut group) = self.snapshots.fetch_group(sequence, None).await else { return Ok(false) };
        loop {
            match read_frame(&mut group, MAX_LIGHT_MESSAGE_BYTES).await {
                Ok(Some(bytes)) => self.messages.put(Message::Bytes(bytes)).await?,
                Ok(None) => return Ok(true),
                Err(LinkError::Ended(_)) => return Ok(false),
                Err(error) => return Err(error),
            }
        }
    }

    /// All of a group; false if it was cut off. When the viewer finds that something does not fit, it gets the group again from its snapshot on.
    async fn group(&mut self, group: &mut group::Consumer, sequence: u64) -> Result<bool, LinkError> {
        loop {
            if self.is_broken() {
                tracing::debug!(sequence, "light did not fit: once more from the group's snapshot");
                if !self.snapshot(sequence).await? {
                    return Ok(false);
                }
                let Ok(again) = self.track.fetch_group(sequence, None).await else { return Ok(false) };
                *group = again;
            }
            match read_frame(group, MAX_LIGHT_MESSAGE_BYTES).await {
                // The mark at its end.
                Ok(Some(bytes)) if bytes.is_empty() => return Ok(true),
                Ok(Some(bytes)) => self.messages.put(Message::Bytes(bytes)).await?,
                Ok(None) | Err(LinkError::Ended(_)) => return Ok(false),
                Err(error) => return Err(error),
            }
        }
    }
}
