//! The paper's entry in 286 bits ([Stadlbauer2023] sec. 3.3).

use std::f32::consts::FRAC_PI_2;

use glam::Vec3;

use super::super::bounding::{BoundingCone, BoundingEntry};
use super::super::entry::ConeEntry;
use super::bits::{BitReader, BitWriter};
use super::floats::{energy_from_bits, energy_to_bits, half_from_bits, half_to_bits};
use crate::points::orthonormal_basis;

/// Bits of an entry: 3 × (2 × 16 direction + 6 angle + 3 × 18 energy) + 8 + 2.
pub const PAPER_BITS: usize = CONES * CONE_BITS + 8 + 2;

const CONES: usize = 3;
const CONE_BITS: usize = 2 * 16 + 6 + 3 * 18;
/// Steps of the opening angle from 0 to π/2.
const ANGLE_STEPS: f32 = 63.0;

/// An entry of up to three cones in 286 bits (of 288). Directions are polar angles about the surface's normal, from it and around it, as 16-bit
/// floats: within 0.0015. Opening angles have 63 steps to π/2: within 0.72°, larger ones are π/2. Energies are as
/// [`energy_to_bits`] says. C is in 8 bits. How many samples were taken is not in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PackedPaper(pub [u8; 36]);

impl Default for PackedPaper {
    fn default() -> Self {
        PackedPaper([0; 36])
    }
}

impl PackedPaper {
    /// Packs an entry of a place with a unit normal. `None` if it has more than three cones.
    pub fn pack(entry: &BoundingEntry, normal: Vec3) -> Option<PackedPaper> {
        if entry.cones().len() > CONES {
            return None;
        }
        let (tangent, bitangent) = orthonormal_basis(normal);
        let mut bytes = [0; 36];
        let mut writer = BitWriter::new(&mut bytes);
        for i in 0..CONES {
            let cone = entry.cones().get(i).copied().unwrap_or_default();
            let [x, y, z] = [tangent, bitangent, normal].map(|axis| cone.direction.dot(axis));
            let [from, around] = [libm::atan2f((x * x + y * y).sqrt(), z), libm::atan2f(y, x)];
            writer.put(half_to_bits(from), 16);
            writer.put(half_to_bits(around), 16);
            writer.put((cone.angle.clamp(0.0, FRAC_PI_2) / FRAC_PI_2 * ANGLE_STEPS).round() as u32, 6);
            for channel in cone.energy.to_array() {
                writer.put(energy_to_bits(channel), 18);
            }
        }
        writer.put(u32::from(entry.samples().min(255)), 8);
        writer.put(entry.cones().len() as u32, 2);
        Some(PackedPaper(bytes))
    }

    /// The entry, for the same normal. Any bits give one.
    pub fn unpack(&self, normal: Vec3) -> BoundingEntry {
        let (tangent, bitangent) = orthonormal_basis(normal);
        let mut reader = BitReader::new(&self.0);
        let cones: [BoundingCone; CONES] = std::array::from_fn(|_| {
            let [from, around] = [0; 2].map(|_| half_from_bits(reader.take(16)));
            let across = tangent * libm::cosf(around) + bitangent * libm::sinf(around);
            let direction = across * libm::sinf(from) + normal * libm::cosf(from);
            let angle = reader.take(6) as f32 / ANGLE_STEPS * FRAC_PI_2;
            let energy = Vec3::from_array([0; 3].map(|_| energy_from_bits(reader.take(18))));
            BoundingCone { direction, angle, energy }
        });
        let samples = reader.take(8) as u16;
        let count = reader.take(2) as usize;
        BoundingEntry::from_parts(&cones[..count.min(CONES)], samples, 0)
    }
}

/// The byte boundary is in the midst of C.
const SAMPLES_AT: usize = CONES * CONE_BITS;

impl ConeEntry for PackedPaper {
    fn confidence(&self) -> u16 {
        let word = u16::from_le_bytes([self.0[SAMPLES_AT / 8], self.0[SAMPLES_AT / 8 + 1]]);
        word >> (SAMPLES_AT % 8) & 0xff
    }

    fn cut_confidence(&mut self, most: u16) {
        let samples = self.confidence().min(most);
        let at = SAMPLES_AT / 8;
        let word = u16::from_le_bytes([self.0[at], self.0[at + 1]]);
        let shift = SAMPLES_AT % 8;
        let word = word & !(0xff << shift) | samples << shift;
        [self.0[at], self.0[at + 1]] = word.to_le_bytes();
    }
}
