//! Our entry in 19 bytes a cone and four more.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::super::entry::{ConeEntry, luminance};
use super::super::lights::{LIGHT_SET_BITS, LightSet};
use super::super::moment::{MomentCone, MomentEntry};
use super::bits::{BitReader, BitWriter};
use super::floats::{energy_from_bits, energy_to_bits};
use crate::octahedral::{flatten, unflatten};

/// Of a cone: 148 bits, rounded up.
const CONE_BYTES: usize = 19;

/// Steps of a component of a direction on either side of 0.
const DIRECTION_STEPS: f32 = 4095.0;
/// Steps of the square root of the opening angle.
const ANGLE_STEPS: f32 = 4095.0;
/// Steps of the square root of the mean cosine.
const COSINE_STEPS: f32 = 4095.0;

/// Steps of the part of a light that is seen; 0 is not known.
const SEEN_STEPS: f32 = 4095.0;

const SAMPLES_BITS: u32 = 12;
const COUNT_BITS: u32 = 3;
/// The rest of the header.
const TAKEN_BITS: u32 = 32 - SAMPLES_BITS - COUNT_BITS;

/// An entry of up to `CONES` cones in 4 + 19 · `CONES` bytes. A cone is an octahedral direction in 2 × 13 bits (within 6e-4 rad),
/// the square root of the opening angle a in 12 (a within √(π a) / 4095 and 1e-6, so narrow cones stay as they are),
/// the energy as 3 × [`energy_to_bits`], the lights in 32, the root of the mean cosine in 12 (within 2⁻¹²),
/// the part of its light that is seen in 12 (within 2⁻¹², but above 0), 0 where that is not known. Moment, fluence and, where that part is known, what is hidden follow from these. C is in 12 bits, samples taken
/// are modulo 2¹⁷.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PackedMoment<const CONES: usize> {
    header: [u8; 4],
    cones: [[u8; CONE_BYTES]; CONES],
}

impl<const CONES: usize> Default for PackedMoment<CONES> {
    fn default() -> Self {
        PackedMoment { header: [0; 4], cones: [[0; CONE_BYTES]; CONES] }
    }
}

impl<const CONES: usize> PackedMoment<CONES> {
    /// Packs an entry. `None` if it has more cones than there is room for.
    pub fn pack(entry: &MomentEntry) -> Option<PackedMoment<CONES>> {
        let count = entry.cones().len();
        if count > CONES {
            return None;
        }
        let samples = u32::from(entry.samples()).min((1 << SAMPLES_BITS) - 1);
        let header = samples
            | (count as u32) << SAMPLES_BITS
            | (entry.taken() & ((1 << TAKEN_BITS) - 1)) << (SAMPLES_BITS + COUNT_BITS);
        let mut packed = PackedMoment { header: header.to_le_bytes(), ..PackedMoment::default() };
        for (to, cone) in packed.cones.iter_mut().zip(entry.cones()) {
            *to = pack_cone(cone);
        }
        Some(packed)
    }

    /// The entry. Any bits give one.
    pub fn unpack(&self) -> MomentEntry {
        let header = u32::from_le_bytes(self.header);
        let count = (header >> SAMPLES_BITS & ((1 << COUNT_BITS) - 1)) as usize;
        let mut cones = [MomentCone::default(); CONES];
        for (to, bytes) in cones.iter_mut().zip(&self.cones) {
            *to = unpack_cone(bytes);
        }
        let cones = &mut cones[..count.min(CONES)];
        for i in 0..cones.len() {
            let lights = cones[i].lights;
            let of_light = cones.iter().filter(|cone| cone.lights == lights);
            let (all, seen) = of_light.fold((0.0, 0.0), |(e, s), c| (e + luminance(c.energy), s + c.seen));
            // Of several cones of a light, the first keeps what was hidden of it.
            if seen > 0.0 && cones[..i].iter().all(|cone| cone.lights != lights) {
                cones[i].hidden = (all / seen - all).max(0.0);
            }
        }
        MomentEntry::from_parts(cones, self.confidence(), header >> (SAMPLES_BITS + COUNT_BITS))
    }

    /// Header and cones.
    pub fn to_parts(&self) -> ([u8; 4], [[u8; CONE_BYTES]; CONES]) {
        (self.header, self.cones)
    }

    /// From [`PackedMoment::to_parts`]. Any bytes will do.
    pub fn from_parts(header: [u8; 4], cones: [[u8; CONE_BYTES]; CONES]) -> PackedMoment<CONES> {
        PackedMoment { header, cones }
    }
}

fn pack_cone(cone: &MomentCone) -> [u8; CONE_BYTES] {
    let mut bytes = [0; CONE_BYTES];
    let mut writer = BitWriter::new(&mut bytes);
    for component in flatten(cone.direction()).to_array() {
        writer.put(((component.clamp(-1.0, 1.0) + 1.0) * DIRECTION_STEPS).round() as u32, 13);
    }
    writer.put(((cone.angle() / PI).sqrt() * ANGLE_STEPS).round() as u32, 12);
    for channel in cone.energy.to_array() {
        writer.put(energy_to_bits(channel), 18);
    }
    writer.put(cone.lights.bits(), LIGHT_SET_BITS as usize);
    writer.put((cone.mean_cosine().sqrt() * COSINE_STEPS).round() as u32, 12);
    let seen = if cone.seen > 0.0 { (cone.seen * SEEN_STEPS).round().clamp(1.0, SEEN_STEPS) } else { 0.0 };
    writer.put(seen as u32, 12);
    bytes
}

fn unpack_cone(bytes: &[u8; CONE_BYTES]) -> MomentCone {
    let mut reader = BitReader::new(bytes);
    let place = [0; 2].map(|_| (reader.take(13) as f32 / DIRECTION_STEPS - 1.0).min(1.0));
    let root = reader.take(12) as f32 / ANGLE_STEPS;
    let energy = Vec3::from_array([0; 3].map(|_| energy_from_bits(reader.take(18))));
    let lights = LightSet::from_bits(reader.take(LIGHT_SET_BITS as usize));
    let cosine = reader.take(12) as f32 / COSINE_STEPS;
    let direction = unflatten(Vec2::from_array(place));
    let seen = reader.take(12) as f32 / SEEN_STEPS;
    let cone = MomentCone::from_cap(direction, libm::cosf(PI * root * root), energy, cosine * cosine, lights);
    MomentCone { seen, ..cone }
}

impl<const CONES: usize> ConeEntry for PackedMoment<CONES> {
    fn confidence(&self) -> u16 {
        (u32::from_le_bytes(self.header) & ((1 << SAMPLES_BITS) - 1)) as u16
    }

    fn cut_confidence(&mut self, most: u16) {
        let samples = u32::from(self.confidence().min(most));
        let header = u32::from_le_bytes(self.header) & !((1 << SAMPLES_BITS) - 1) | samples;
        self.header = header.to_le_bytes();
    }
}
