//! Bits a second, as people write them.

use std::str::FromStr;

/// Bits a second.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct BitRate(pub(crate) u64);

impl FromStr for BitRate {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let (number, unit) = match s.as_bytes().last() {
            Some(b'k' | b'K') => (&s[..s.len() - 1], 1e3),
            Some(b'm' | b'M') => (&s[..s.len() - 1], 1e6),
            _ => (s, 1.0),
        };
        match number.parse::<f64>().map(|number| number * unit) {
            // Less than a frame a second says nothing.
            Ok(bits) if (1000.0..=1e12).contains(&bits) => Ok(BitRate(bits.round() as u64)),
            _ => Err("write bits a second, 1k to 1000000M, as in 500k, 0.5M or 2M".into()),
        }
    }
}

impl std::fmt::Display for BitRate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 as f64 {
            bits if bits >= 1e6 => write!(f, "{}M", bits / 1e6),
            bits => write!(f, "{}k", bits / 1e3),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_read_as_they_are_written() {
        for (text, bits) in [("500k", 500_000), ("0.5M", 500_000), ("2M", 2_000_000), ("64000", 64_000)] {
            let rate: BitRate = text.parse().unwrap();
            assert_eq!(rate.0, bits, "{text}");
            assert_eq!(rate.to_string().parse(), Ok(rate));
        }
        for bad in ["", "M", "-1M", "0", "999", "nan", "1e20", "2G", "é"] {
            assert!(bad.parse::<BitRate>().is_err(), "{bad}");
        }
    }
}
