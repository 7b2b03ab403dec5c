//! What has come off the wire: light as one, or in parts.

use dapple_store::charts::Cuts;
use dapple_store::light_visibility::LightChange;
use dapple_store::points::PointStore;
use dapple_stream::{Applied, Limits, Parts, ReceiveError, Subscriber};

/// The light of one stream, or of several that are parts of it: whichever came last.
pub(super) struct Received {
    scene_hash: [u8; 32],
    limits: Limits,
    whole: Subscriber,
    parts: Option<Parts>,
    /// Parts of another host may follow, with other points or other instances in each.
    is_outdated: bool,
}

impl Received {
    /// Nothing yet; frames of another scene are refused.
    pub(super) fn new(scene_hash: [u8; 32], limits: Limits) -> Received {
        Received {
            scene_hash,
            limits,
            whole: Subscriber::new(Some(scene_hash), limits),
            parts: None,
            is_outdated: false,
        }
    }

    /// Takes a frame of a part, or of light that comes as one.
    pub(super) fn receive(&mut self, part: Option<u8>, frame: &[u8]) -> Result<Applied, ReceiveError> {
        let Some(part) = part else {
            let applied = self.whole.receive(frame)?;
            self.parts = None;
            return Ok(applied);
        };
        let mut new = None;
        let parts = match &mut self.parts {
            Some(parts) => parts,
            // What came as one stays until there is something in its place.
            None => new.insert(Parts::new(Some(self.scene_hash), self.limits)),
        };
        let applied = match parts.receive(part.into(), frame) {
            Err(ReceiveError::Misfit(_)) if std::mem::take(&mut self.is_outdated) => {
                *parts = Parts::new(Some(self.scene_hash), self.limits);
                parts.receive(part.into(), frame)?
            }
            applied => applied?,
        };
        if new.is_some() {
            self.parts = new;
            self.whole.forget();
        }
        Ok(applied)
    }

    pub(super) fn outdate(&mut self) {
        self.whole.outdate();
        if let Some(parts) = &mut self.parts {
            parts.outdate();
            self.is_outdated = true;
        }
    }

    pub(super) fn store(&self) -> Option<&PointStore> {
        self.parts.as_ref().map_or_else(|| self.whole.store(), Parts::store)
    }

    pub(super) fn cuts(&self) -> Option<&Cuts> {
        self.parts.as_ref().map_or_else(|| self.whole.cuts(), |parts| Some(parts.cuts()))
    }

    /// Values of lights that the last frame changed at points that stayed.
    pub(super) fn light_changes(&self) -> &[LightChange] {
        self.parts.as_ref().map_or_else(|| self.whole.light_changes(), Parts::light_changes)
    }

    /// Group and epoch of light that came as one.
    pub(super) fn held(&self) -> Option<(u64, u64)> {
        self.whole.group().zip(self.whole.epoch())
    }

    /// Bytes held beside what is seen from outside.
    pub(super) fn bytes(&self) -> usize {
        self.whole.bytes() + self.parts.as_ref().map_or(0, Parts::bytes)
    }
}
