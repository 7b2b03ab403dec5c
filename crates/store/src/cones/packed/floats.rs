//! Floating-point numbers of 18 and 16 bits.

/// How positive numbers are coded: exponent above mantissa, subnormal numbers at the lower end, largest code for what is too large.
struct Format {
    mantissa_bits: u32,
    bias: i32,
    most: u32,
}

/// 6 bits of exponent, 12 of mantissa, no sign, no infinity.
const ENERGY: Format = Format { mantissa_bits: 12, bias: 31, most: (1 << 18) - 1 };

/// IEEE 754 binary16 without its sign.
const HALF: Format = Format { mantissa_bits: 10, bias: 15, most: 0x7bff };

impl Format {
    fn pack(&self, x: f32) -> u32 {
        if x.is_nan() || x <= 0.0 {
            return 0;
        }
        let exponent = (x.to_bits() >> 23) as i32 - 127;
        if exponent < 1 - self.bias {
            // A multiple of the least number; rounds up into the least normal one where that is nearest.
            let steps = x * power_of_two(self.bias - 1 + self.mantissa_bits as i32);
            return steps.round_ties_even() as u32;
        }
        if exponent > 63 {
            return self.most;
        }
        let dropped = 23 - self.mantissa_bits;
        let bits = ((exponent + self.bias) as u64) << 23 | u64::from(x.to_bits() & 0x007f_ffff);
        let even = bits >> dropped & 1;
        let rounded = (bits + (1 << (dropped - 1)) - 1 + even) >> dropped;
        rounded.min(u64::from(self.most)) as u32
    }

    fn unpack(&self, code: u32) -> f32 {
        let code = code.min(self.most);
        let (exponent, mantissa) = (code >> self.mantissa_bits, code & ((1 << self.mantissa_bits) - 1));
        if exponent == 0 {
            return mantissa as f32 * power_of_two(1 - self.bias - self.mantissa_bits as i32);
        }
        let exponent = (exponent as i32 - self.bias + 127) as u32;
        f32::from_bits(exponent << 23 | mantissa << (23 - self.mantissa_bits))
    }
}

/// 2 to a power of −126 … 127.
fn power_of_two(power: i32) -> f32 {
    f32::from_bits(((127 + power) as u32) << 23)
}

/// A channel of energy in 18 bits: 6 of exponent, 12 of mantissa, because slow accumulation needs relative steps. Within 2⁻¹³ of the number from
/// 2⁻³⁰ to 2³³, within 2⁻⁴³ below; what is larger becomes the largest, 8.59e9, and what is negative or no number 0.
pub fn energy_to_bits(energy: f32) -> u32 {
    ENERGY.pack(energy)
}

/// From [`energy_to_bits`]. Any 18 bits are a finite number ≥ 0; higher bits make it the largest.
pub fn energy_from_bits(bits: u32) -> f32 {
    ENERGY.unpack(bits)
}

/// A number in 16 bits; 65504 and its negative at most.
pub(super) fn half_to_bits(x: f32) -> u32 {
    let sign = u32::from(x < 0.0) << 15;
    sign | HALF.pack(x.abs())
}

/// From [`half_to_bits`]. Patterns of infinities and of no number are 0.
pub(super) fn half_from_bits(bits: u32) -> f32 {
    let code = bits & 0x7fff;
    if code > HALF.most {
        return 0.0;
    }
    let size = HALF.unpack(code);
    if bits >> 15 & 1 == 1 { -size } else { size }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn all_patterns_survive_and_ascend() {
        let mut before = -1.0;
        for code in 0..1 << 18 {
            let x = energy_from_bits(code);
            assert!(x > before && x.is_finite() && energy_to_bits(x) == code, "{code}");
            before = x;
        }
        for code in 0..=0x7bffu32 {
            for code in [code, code | 0x8000] {
                let x = half_from_bits(code);
                assert!(half_to_bits(x) == code || x == 0.0, "{code}");
            }
        }
        assert_eq!([0x7c00, 0x7fff, 0xfc00, 0xffff].map(half_from_bits), [0.0; 4]);
    }

    #[test]
    fn known_halves() {
        for (x, bits) in
            [(1.0, 0x3c00), (-2.0, 0xc000), (65504.0, 0x7bff), (0.1, 0x2e66), (6e-8, 1), (1e9, 0x7bff)]
        {
            assert_eq!(half_to_bits(x), bits, "{x}");
        }
        assert!((half_from_bits(half_to_bits(3.1)) - 3.1).abs() <= 0.000_98);
    }

    proptest! {
        #[test]
        fn energies_are_within_their_bound(bits: u32) {
            let x = f32::from_bits(bits);
            let back = f64::from(energy_from_bits(energy_to_bits(x)));
            let (x, most) = (f64::from(x), f64::from(energy_from_bits(u32::MAX)));
            if x.is_nan() || x <= 0.0 {
                prop_assert_eq!(back, 0.0);
            } else if x >= most {
                prop_assert_eq!(back, most);
            } else {
                let bound = (x / 8192.0).max(libm::exp2(-43.0));
                prop_assert!((back - x).abs() <= bound, "{} for {}", back, x);
            }
        }
    }
}
