//! The host's end: what all viewers share, as tracks.

use std::sync::Arc;

use bytes::Bytes;
use dapple_session::host::{Arrival, Host, LightGroups, Piece, StateGroups};
use moq_net::{Timestamp, broadcast, group, origin, track};

use crate::names::{ABOUT, STATE, light, part, part_snapshot, snapshot};
use crate::{About, LinkError, Names, Stream};

/// For so long groups are kept that are not the newest: who has just begun to take one may end it.
const KEPT: std::time::Duration = std::time::Duration::from_secs(10);

/// What a host publishes; it ends when this is dropped.
pub struct Broadcast {
    broadcast: broadcast::Producer,
    state: (StateGroups, Groups),
    streams: Vec<Light>,
    about: track::Producer,
}

struct Light {
    groups: LightGroups,
    light: Groups,
    snapshots: track::Producer,
}

/// A track and the group that is being written.
struct Groups {
    track: track::Producer,
    next: u64,
    group: Option<group::Producer>,
    /// Whether a group's last frame is an empty one, which says that all of it was there.
    is_marked: bool,
}

/// Bytes that many share, without a copy for each.
struct Shared<T: ?Sized>(Arc<T>);

impl AsRef<[u8]> for Shared<[u8]> {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

impl AsRef<[u8]> for Shared<str> {
    fn as_ref(&self) -> &[u8] {
        self.0.as_bytes()
    }
}

impl Broadcast {
    /// Publishes a host. Groups count from `first_group`, which must be above those of any host that had this name before (milliseconds since 1970 are):
    /// relays take equal numbers for equal groups.
    ///
    /// # Errors
    /// The name is taken, or the origin has ended.
    pub fn new(
        origin: &origin::Producer,
        names: &Names,
        host: &Host,
        first_group: u64,
    ) -> Result<Broadcast, LinkError> {
        let about = About {
            protocol: dapple_session::PROTOCOL,
            wire: dapple_session::WIRE,
            scene: dapple_session::host::hex(&host.scene().hash().0),
            streams: host
                .config()
                .rungs
                .iter()
                .map(|bits_per_s| Stream { bits_per_s: *bits_per_s })
                .collect(),
            parts: host.config().parts.len(),
        };
        let broadcast = origin.create_broadcast(names.shared())?;
        let track = |name: &str| {
            let info = track::Info::default().with_max_age(KEPT);
            broadcast.create_track(name.to_owned(), info)
        };
        let about_track = track(ABOUT)?;
        let mut group = about_track.create_group(group::Info { sequence: first_group })?;
        group.write_frame(Timestamp::now(), about.to_text())?;
        group.finish()?;
        let state = Groups::new(track(STATE)?, first_group, false);
        let streams = (0..host.rungs())
            .map(|rung| {
                let (light, snapshots) = match rung.checked_sub(about.streams.len()) {
                    None => (light(rung), snapshot(rung)),
                    Some(number) => (part(number), part_snapshot(number)),
                };
                Ok(Light {
                    groups: LightGroups::new(rung),
                    light: Groups::new(track(&light)?, first_group, true),
                    snapshots: track(&snapshots)?,
                })
            })
            .collect::<Result<Vec<_>, LinkError>>()?;
        // Who hears of it finds all of it.
        broadcast.announce(origin::Route::default())?;
        Ok(Broadcast { broadcast, state: (StateGroups::default(), state), streams, about: about_track })
    }

    /// Writes what a step has brought; to be called after each. True once the host is being stopped and that has been said.
    ///
    /// # Errors
    /// The origin has ended.
    pub fn write(&mut self, host: &mut Host, arrival: &Arrival, now_us: u64) -> Result<bool, LinkError> {
        let (texts, groups) = &mut self.state;
        loop {
            match texts.next(host, arrival, now_us) {
                Piece::Begin(text) => {
                    groups.begin()?;
                    groups.write(Bytes::from_owner(Shared(text)))?;
                }
                Piece::More(text) => groups.write(Bytes::from_owner(Shared(text)))?,
                Piece::Wait => break,
                Piece::End(text) => {
                    groups.write(Bytes::from_owner(Shared(text)))?;
                    groups.end()?;
                    return Ok(true);
                }
            }
        }
        for (rung, stream) in self.streams.iter_mut().enumerate() {
            host.set_shared(rung, stream.light.track.is_used());
            stream.write(host, now_us)?;
        }
        Ok(false)
    }

    /// Whether somebody takes the state or light.
    pub fn is_taken(&self) -> bool {
        self.state.1.track.is_used() || self.streams.iter().any(|stream| stream.light.track.is_used())
    }
}

impl Drop for Broadcast {
    fn drop(&mut self) {
        // Whatever cannot be ended has ended already.
        let _ = self.about.finish();
        let _ = self.state.1.finish();
        for stream in &mut self.streams {
            let _ = stream.light.finish();
            let _ = stream.snapshots.finish();
        }
        self.broadcast.close();
    }
}

impl Light {
    fn write(&mut self, host: &mut Host, now_us: u64) -> Result<(), LinkError> {
        loop {
            match self.groups.next(host, now_us) {
                Piece::Begin(messages) => {
                    // The snapshot is there before anyone can ask for it.
                    let sequence = self.light.next;
                    let mut group = self.snapshots.create_group(group::Info { sequence })?;
                    for message in messages {
                        group.write_frame(Timestamp::now(), Bytes::from_owner(Shared(message)))?;
                    }
                    group.finish()?;
                    self.light.begin()?;
                }
                Piece::More(messages) => {
                    for message in messages {
                        self.light.write(Bytes::from_owner(Shared(message)))?;
                    }
                }
                Piece::Wait | Piece::End(_) => return Ok(()),
            }
        }
    }
}

impl Groups {
    fn new(track: track::Producer, first: u64, is_marked: bool) -> Groups {
        Groups { track, next: first, group: None, is_marked }
    }

    fn begin(&mut self) -> Result<(), LinkError> {
        self.end()?;
        self.group = Some(self.track.create_group(group::Info { sequence: self.next })?);
        self.next += 1;
        Ok(())
    }

    fn write(&mut self, bytes: Bytes) -> Result<(), LinkError> {
        if self.group.is_none() {
            self.begin()?;
        }
        let Some(group) = &mut self.group else { return Ok(()) };
        Ok(group.write_frame(Timestamp::now(), bytes)?)
    }

    fn finish(&mut self) -> Result<(), LinkError> {
        self.end()?;
        Ok(self.track.finish()?)
    }

    fn end(&mut self) -> Result<(), LinkError> {
        match self.group.take() {
            Some(mut group) => {
                if self.is_marked {
                    group.write_frame(Timestamp::now(), Bytes::new())?;
                }
                Ok(group.finish()?)
            }
            None => Ok(()),
        }
    }
}
