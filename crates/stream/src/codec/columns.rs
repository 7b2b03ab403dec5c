//! Points and cuts ⇄ choices, one after the other. Written once for both ends: a writer hands in what comes next, a reader
//! gets it.

use dapple_store::charts::SiteCut;
use dapple_store::points::{PackedNormal, morton_code, morton_decode};

use super::entropy::{Chance, Coder};
use super::plane::{Plane, reference};
use super::varint::MAX_VARINT_BYTES;
use super::{unzigzag, zigzag};

/// Where a point lies, and its normal.
pub(crate) type Place = ([u32; 3], PackedNormal);

/// Why what was read is no place or cut.
pub(crate) type Reason = (&'static str, &'static str);

/// The points of a layout, set by set.
pub(crate) struct PointColumns {
    local_bits: u32,
    normals: [Following; 2],
    gaps: Following,
    across: Alone,
    /// Of the point before, in its set.
    normal: [u8; 2],
    cell: u64,
}

impl PointColumns {
    pub(crate) fn new(local_bits: u32) -> PointColumns {
        PointColumns {
            local_bits,
            normals: [Following::new(), Following::new()],
            gaps: Following::new(),
            across: Alone::new(),
            normal: [0; 2],
            cell: 0,
        }
    }

    pub(crate) fn begin_set(&mut self) {
        (self.normal, self.cell) = ([0; 2], 0);
    }

    /// Codes one point, which comes after `before` in its set.
    pub(crate) fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        before: (&[[u32; 3]], &[PackedNormal]),
        point: Option<Place>,
    ) -> Result<Place, Reason> {
        let local_bits = self.local_bits;
        let local_mask = (1u32 << local_bits) - 1;
        let (position, normal) = point.unwrap_or_default();
        for axis in 0..2 {
            let step = zigzag(normal.0[axis].wrapping_sub(self.normal[axis]));
            let step = self.normals[axis].code(coder, step);
            self.normal[axis] = self.normal[axis].wrapping_add(unzigzag(step));
        }
        let cell = morton_code(position) >> (3 * local_bits);
        let gaps = &mut self.gaps;
        let gap = code_varint(coder, cell.wrapping_sub(self.cell), |coder, byte| gaps.code(coder, byte));
        let cell = gap.ok_or(("cell gaps", "are no numbers in their shortest form"))?.checked_add(self.cell);
        self.cell = cell
            .filter(|&cell| cell < 1 << (63 - 3 * local_bits))
            .ok_or(("cell gaps", "leave the 21-bit grid"))?;
        let normal = PackedNormal(self.normal);
        let plane = Plane::new(normal);
        let mut read = morton_decode(self.cell << (3 * local_bits));
        for axis in plane.along {
            read[axis] |= coder.plain(position[axis] & local_mask, local_bits);
        }
        let along = plane.along.map(|axis| read[axis]);
        let predicted = plane.predict(reference(before.0, before.1, normal), along);
        let across = position[plane.across].wrapping_sub(predicted) & local_mask;
        let across = self.across.code(coder, across as u8, local_bits);
        read[plane.across] |= predicted.wrapping_add(u32::from(across)) & local_mask;
        Ok((read, normal))
    }
}

/// The cuts of a layout, set by set.
pub(crate) struct CutColumns {
    gaps: Alone,
    masks: [Alone; 2],
    /// The site after the cut before, in its set.
    next: u64,
}

impl CutColumns {
    pub(crate) fn new() -> CutColumns {
        CutColumns { gaps: Alone::new(), masks: [Alone::new(), Alone::new()], next: 0 }
    }

    pub(crate) fn begin_set(&mut self) {
        self.next = 0;
    }

    /// Codes one cut.
    pub(crate) fn code<C: Coder>(&mut self, coder: &mut C, cut: SiteCut) -> Result<SiteCut, Reason> {
        let gaps = &mut self.gaps;
        let gap = u64::from(cut.site).wrapping_sub(self.next);
        let gap = code_varint(coder, gap, |coder, byte| gaps.code(coder, byte, 8));
        let site =
            gap.ok_or(("cut gaps", "are no numbers in their shortest form"))?.saturating_add(self.next);
        let site = u32::try_from(site).map_err(|_| ("cut gaps", "name a site that does not exist"))?;
        self.next = u64::from(site) + 1;
        let [low, high] = cut.mask.to_le_bytes();
        let mask = [(low, 0), (high, 1)].map(|(byte, at)| self.masks[at].code(coder, byte, 8));
        Ok(SiteCut { site, mask: u16::from_le_bytes(mask) })
    }
}

/// The chances of the bits of a byte, by the bits before them.
type Byte = [Chance; 256];

/// Bytes of one kind, each foretold from the one before it.
struct Following {
    chances: Box<[Byte]>,
    last: u8,
}

/// Bytes of one kind, each by itself.
struct Alone(Byte);

/// Codes the low `bits` bits of a byte, the highest first.
fn code_byte<C: Coder>(coder: &mut C, chances: &mut Byte, byte: u8, bits: u32) -> u8 {
    let mut node = 1;
    for at in (0..bits).rev() {
        node = node << 1 | usize::from(coder.bit(&mut chances[node], byte >> at & 1 == 1));
    }
    (node - (1 << bits)) as u8
}

impl Following {
    fn new() -> Following {
        Following { chances: vec![[Chance::EVEN; 256]; 256].into(), last: 0 }
    }

    fn code<C: Coder>(&mut self, coder: &mut C, byte: u8) -> u8 {
        self.last = code_byte(coder, &mut self.chances[usize::from(self.last)], byte, 8);
        self.last
    }
}

impl Alone {
    fn new() -> Alone {
        Alone([Chance::EVEN; 256])
    }

    /// Codes the low `bits` bits of `byte`, at most 8.
    fn code<C: Coder>(&mut self, coder: &mut C, byte: u8, bits: u32) -> u8 {
        code_byte(coder, &mut self.0, byte, bits)
    }
}

/// Codes a varint byte by byte; a reader gets what is none in its shortest form, or exceeds 63 bits, as `None`.
fn code_varint<C: Coder>(coder: &mut C, number: u64, mut code: impl FnMut(&mut C, u8) -> u8) -> Option<u64> {
    let (mut left, mut read) = (number, 0);
    for at in 0..MAX_VARINT_BYTES - 1 {
        let byte = code(coder, (left & 0x7f) as u8 | u8::from(left > 0x7f) << 7);
        left >>= 7;
        read |= u64::from(byte & 0x7f) << (7 * at);
        if byte < 0x80 {
            return (byte > 0 || at == 0).then_some(read);
        }
    }
    None
}
