//! Messages that are bytes: frames of light, in pieces, each with the moment that it belongs to.

use crate::MessageError;

/// Most bytes of a frame in one message.
pub const CHUNK_BYTES: usize = 64 << 10;

/// Bytes of the fields before them: see [`LightHead`].
const FIELD_BYTES: usize = 4 * 8 + 2 * 4;

/// Longest message of light.
pub const MAX_LIGHT_MESSAGE_BYTES: usize = 2 + FIELD_BYTES + CHUNK_BYTES;

/// The first byte, of light that comes as one.
const WHOLE: u8 = b'L';

/// The first byte where the second is the number of a part.
const PART: u8 = b'P';

/// Says what a piece of light is. On the wire: the letter `L`, or `P` and the part's number, then the other fields in their order, little-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightHead {
    /// The part of the light that the frame is of; `None` where light comes as one.
    pub part: Option<u8>,
    /// The host's clock as the step began, microseconds: what it names is as old as that.
    pub stamp_us: u64,
    /// The host's clock when the step was done.
    pub made_us: u64,
    /// The scene's time in the step, microseconds.
    pub scene_us: u64,
    /// Version of the scene's state in the step.
    pub state: u64,
    /// Bytes of the frame; 0 for a step that changed nothing.
    pub total: u32,
    /// Where in the frame this piece begins.
    pub offset: u32,
}

impl LightHead {
    /// The messages that carry a frame, none of which is longer than [`MAX_LIGHT_MESSAGE_BYTES`]; one without bytes for no frame.
    pub fn messages(mut self, frame: &[u8]) -> Vec<std::sync::Arc<[u8]>> {
        self.total = frame.len() as u32;
        let pieces = frame.chunks(CHUNK_BYTES).chain(frame.is_empty().then_some(&[][..]));
        let mut offset = 0;
        pieces
            .map(|piece| {
                let mut bytes = Vec::with_capacity(2 + FIELD_BYTES + piece.len());
                match self.part {
                    None => bytes.push(WHOLE),
                    Some(part) => bytes.extend([PART, part]),
                }
                for field in [self.stamp_us, self.made_us, self.scene_us, self.state] {
                    bytes.extend(field.to_le_bytes());
                }
                bytes.extend(self.total.to_le_bytes());
                bytes.extend(u32::to_le_bytes(offset));
                bytes.extend(piece);
                offset += piece.len() as u32;
                bytes.into()
            })
            .collect()
    }

    /// Reads a message: the head, and the piece of the frame.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(message: &[u8]) -> Result<(LightHead, &[u8]), MessageError> {
        if message.len() > MAX_LIGHT_MESSAGE_BYTES {
            return Err(MessageError::TooLong { bytes: message.len(), limit: MAX_LIGHT_MESSAGE_BYTES });
        }
        let cut = MessageError::Light("a message is cut off");
        let (part, fields) = match *message {
            [WHOLE, ref fields @ ..] => (None, fields),
            [PART, part, ref fields @ ..] => (Some(part), fields),
            [] | [PART] => return Err(cut),
            _ => return Err(MessageError::Light("a message of bytes begins with neither L nor P")),
        };
        let (head, piece) = fields.split_at_checked(FIELD_BYTES).ok_or(cut)?;
        let long = |at: usize| u64::from_le_bytes(head[at..at + 8].try_into().expect("eight bytes"));
        let short = |at: usize| u32::from_le_bytes(head[at..at + 4].try_into().expect("four bytes"));
        let head = LightHead {
            part,
            stamp_us: long(0),
            made_us: long(8),
            scene_us: long(16),
            state: long(24),
            total: short(32),
            offset: short(36),
        };
        let end = u64::from(head.offset) + piece.len() as u64;
        let fits = end <= u64::from(head.total) && (piece.is_empty() == (head.total == 0));
        if !fits || head.made_us < head.stamp_us {
            return Err(MessageError::Light("a piece does not fit its frame"));
        }
        Ok((head, piece))
    }
}

/// Puts pieces together, in whatever order they come.
#[derive(Clone, Debug, Default)]
pub struct Assembly {
    /// Of the frame that is being put together; its offset is 0.
    head: LightHead,
    bytes: Vec<u8>,
    /// Which pieces have come, and how many bytes that is.
    has: Vec<bool>,
    came: usize,
}

/// What a piece came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Assembled {
    /// A whole frame (empty for none).
    Whole(LightHead, Vec<u8>),
    /// More is to come, or it has come before.
    Part,
    /// It cannot be part of a frame that is taken.
    Never,
}

impl Assembly {
    /// Takes the next piece of frames that have at most so many bytes.
    pub fn push(&mut self, head: LightHead, piece: &[u8], max_bytes: usize) -> Assembled {
        let (total, offset) = (head.total as usize, head.offset as usize);
        let fits = offset.is_multiple_of(CHUNK_BYTES) && piece.len() == CHUNK_BYTES.min(total - offset);
        if total > max_bytes || !fits {
            return Assembled::Never;
        }
        if total <= CHUNK_BYTES {
            // It is whole by itself, whatever else is on its way.
            return Assembled::Whole(head, piece.to_vec());
        }
        let frame = LightHead { offset: 0, ..head };
        if frame != self.head || self.bytes.is_empty() {
            if !self.bytes.is_empty() && frame.made_us < self.head.made_us {
                return Assembled::Part;
            }
            let pieces = total.div_ceil(CHUNK_BYTES);
            (self.head, self.bytes, self.has, self.came) = (frame, vec![0; total], vec![false; pieces], 0);
        }
        self.bytes[offset..offset + piece.len()].copy_from_slice(piece);
        if !std::mem::replace(&mut self.has[offset / CHUNK_BYTES], true) {
            self.came += piece.len();
        }
        if self.came < total {
            return Assembled::Part;
        }
        Assembled::Whole(self.head, std::mem::take(&mut self.bytes))
    }

    /// Bytes of an unfinished frame that have come, and all of it.
    pub fn progress(&self) -> (usize, usize) {
        if self.bytes.is_empty() { (0, 0) } else { (self.came, self.bytes.len()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_every_length_come_through() {
        let lengths = [0, 1, CHUNK_BYTES - 1, CHUNK_BYTES, CHUNK_BYTES + 1, 3 * CHUNK_BYTES];
        for (length, part) in lengths.into_iter().flat_map(|length| [(length, None), (length, Some(7))]) {
            let frame: Vec<u8> = (0..length).map(|i| (i * 7 % 251) as u8).collect();
            let head =
                LightHead { part, stamp_us: 5, made_us: 9, scene_us: 1 << 40, state: 3, total: 0, offset: 0 };
            let messages = head.messages(&frame);
            assert!(messages.iter().all(|message| message.len() <= MAX_LIGHT_MESSAGE_BYTES));
            let mut assembly = Assembly::default();
            for (index, message) in messages.iter().enumerate() {
                let (head, piece) = LightHead::parse(message).unwrap();
                let assembled = assembly.push(head, piece, 1 << 20);
                if index + 1 < messages.len() {
                    assert_eq!(assembled, Assembled::Part);
                    assert_eq!(assembly.progress(), ((index + 1) * CHUNK_BYTES, length));
                } else {
                    let Assembled::Whole(whole, bytes) = assembled else { panic!("{assembled:?}") };
                    assert_eq!((whole.part, whole.scene_us, whole.state), (part, 1 << 40, 3));
                    assert_eq!(bytes, frame);
                }
            }
        }
    }

    #[test]
    fn pieces_come_in_any_order() {
        let frame: Vec<u8> = (0..3 * CHUNK_BYTES - 5).map(|i| (i % 251) as u8).collect();
        let old = LightHead { made_us: 5, ..LightHead::default() }.messages(&frame);
        let new = LightHead { made_us: 6, ..LightHead::default() }.messages(&frame);
        let small = LightHead { made_us: 7, ..LightHead::default() }.messages(&[1, 2]);
        let mut assembly = Assembly::default();
        let mut push = |message: &[u8]| {
            let (head, piece) = LightHead::parse(message).unwrap();
            assembly.push(head, piece, 1 << 20)
        };
        assert_eq!(push(&old[2]), Assembled::Part);
        assert_eq!(push(&old[2]), Assembled::Part, "twice");
        assert_eq!(push(&new[1]), Assembled::Part, "the newer one counts");
        assert_eq!(push(&old[1]), Assembled::Part);
        assert!(matches!(push(&small[0]), Assembled::Whole(_, bytes) if bytes == [1, 2]));
        assert_eq!(push(&new[2]), Assembled::Part);
        assert!(matches!(push(&new[0]), Assembled::Whole(_, bytes) if bytes == frame));
        let (head, piece) = LightHead::parse(&old[0]).unwrap();
        assert_eq!(Assembly::default().push(head, piece, 1000), Assembled::Never, "larger than is taken");
        let shifted = LightHead { offset: 1, ..head };
        assert_eq!(Assembly::default().push(shifted, piece, 1 << 20), Assembled::Never);
    }

    #[test]
    fn broken_messages_are_refused() {
        let good = LightHead { made_us: 1, ..LightHead::default() }.messages(&[1, 2, 3]);
        let of_part = LightHead { made_us: 1, part: Some(9), ..LightHead::default() }.messages(&[1, 2, 3]);
        for good in [&good[0], &of_part[0]] {
            assert!(LightHead::parse(good).is_ok());
            for length in 0..good.len() {
                let cut = LightHead::parse(&good[..length]);
                assert!(cut.is_err() || length > 1 + FIELD_BYTES, "{length}");
            }
        }
        let mut other = good[0].to_vec();
        other[0] = b'M';
        assert!(LightHead::parse(&other).is_err());
        let longer = [&good[0][..], &[4]].concat();
        assert!(LightHead::parse(&longer).is_err());
        assert!(LightHead::parse(&vec![b'L'; MAX_LIGHT_MESSAGE_BYTES + 1]).is_err());
    }
}
