//! What all may know of a host before they take anything else.

use serde::{Deserialize, Serialize};

use crate::LinkError;

/// Longest text of it, bytes.
pub(crate) const MAX_ABOUT_BYTES: usize = 16 << 10;

/// Most streams.
const MAX_STREAMS: usize = 8;

/// The one frame of the track `about`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct About {
    /// Version of the conversation.
    pub protocol: u32,
    /// Version of the frames of light.
    pub wire: u8,
    /// The scene's hash, 64 hexadecimal digits.
    pub scene: String,
    /// Streams of the same light, from the richest to the leanest: stream K is in `light/K` and `snapshot/K`.
    pub streams: Vec<Stream>,
    /// Parts that the richest can be had in: part K is in `part/K` and `part-snapshot/K`. 0 where it comes as one.
    #[serde(skip_serializing_if = "is_zero", default)]
    pub parts: usize,
}

fn is_zero(number: &usize) -> bool {
    *number == 0
}

/// A stream of light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stream {
    /// Most bits in any second; absent without a budget.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub bits_per_s: Option<u64>,
}

impl About {
    /// Reads what a host says of itself.
    ///
    /// # Errors
    /// It is not understood, or offers no stream or too many.
    pub fn parse(text: &str) -> Result<About, LinkError> {
        let about: About = serde_json::from_str(text)
            .map_err(|error| LinkError::Refused(format!("what the host says of itself: {error}")))?;
        if about.streams.is_empty() || about.streams.len() > MAX_STREAMS {
            return Err(LinkError::Refused(format!("the host offers {} streams", about.streams.len())));
        }
        if about.parts > dapple_session::MAX_PARTS {
            return Err(LinkError::Refused(format!("the host offers {} parts", about.parts)));
        }
        Ok(about)
    }

    /// As it is said.
    pub fn to_text(&self) -> String {
        serde_json::to_string(self).expect("numbers and texts are JSON")
    }

    /// The number of the stream for a wish of most bits a second.
    pub fn stream_for(&self, bits_per_s: Option<u64>) -> usize {
        let budgets: Vec<Option<u64>> = self.streams.iter().map(|stream| stream.bits_per_s).collect();
        dapple_session::stream_within(&budgets, bits_per_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn about(streams: &[Option<u64>]) -> About {
        let streams = streams.iter().map(|bits_per_s| Stream { bits_per_s: *bits_per_s }).collect();
        About { protocol: 1, wire: 4, scene: "00".repeat(32), streams, parts: 0 }
    }

    #[test]
    fn what_is_said_is_understood() {
        let said = about(&[None, Some(2_000_000), Some(500_000)]);
        assert_eq!(About::parse(&said.to_text()).unwrap(), said);
        assert!(About::parse(&about(&[]).to_text()).is_err());
        assert!(About::parse(&about(&[None; 9]).to_text()).is_err());
        assert!(About::parse("{}").is_err());
        let in_parts = About { parts: 3, ..said.clone() };
        assert_eq!(About::parse(&in_parts.to_text()).unwrap(), in_parts);
        assert!(About::parse(&About { parts: 257, ..said }.to_text()).is_err());
    }

    #[test]
    fn a_wish_gets_the_richest_stream_within_it() {
        let said = about(&[None, Some(2_000_000), Some(500_000)]);
        let chosen = [None, Some(3_000_000), Some(1_000_000), Some(1)].map(|wish| said.stream_for(wish));
        assert_eq!(chosen, [0, 1, 2, 2]);
    }
}
