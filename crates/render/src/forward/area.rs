//! Area lights on the card: how much of each is seen, four lights a texel, and the table of what they look like.

use dapple_gpu::{Gpu, wgpu};

use super::ForwardError;
use super::atlas::{AtlasBand, AtlasTexture};
use crate::area_lights::table::TABLE_WIDTH;
use crate::area_lights::{AreaLightTable, MAX_AREA_LIGHTS};
use crate::psao::atlas::{LIGHTS_A_TEXEL, PLANES_WITH_LEANS};
use crate::tables::{float_table, write_rows};

/// What `reflect.wgsl` reads.
#[derive(Debug)]
pub(super) struct AreaLightTextures {
    atlas: AtlasTexture<LIGHTS_A_TEXEL>,
    /// Planes of all groups of four lights in the atlas, and layers of each.
    planes: u32,
    has_leans: bool,
    layers: u32,
    /// One row a light; one texel until there are some.
    table: wgpu::Texture,
    table_view: wgpu::TextureView,
    /// What the table holds.
    rows: Vec<[f32; 4]>,
    lights: u32,
}

impl AreaLightTextures {
    pub(super) fn new(gpu: &Gpu) -> AreaLightTextures {
        let (table, table_view) = make_table(gpu, 1, 1);
        AreaLightTextures {
            atlas: AtlasTexture::new(gpu),
            planes: 0,
            has_leans: false,
            layers: 0,
            table,
            table_view,
            rows: Vec::new(),
            lights: 0,
        }
    }

    /// Writes the table where it changed; returns whether groups must be made anew.
    pub(super) fn set_table(&mut self, gpu: &Gpu, table: &AreaLightTable) -> bool {
        self.lights = if table.is_dark() { 0 } else { table.lights().len().min(MAX_AREA_LIGHTS) as u32 };
        if self.lights == 0 {
            return false;
        }
        let is_first = self.table.width() == 1;
        if is_first {
            (self.table, self.table_view) = make_table(gpu, TABLE_WIDTH as u32, MAX_AREA_LIGHTS as u32);
        }
        let rows = table.texels();
        let has_changed = |row: usize| {
            let range = row * TABLE_WIDTH..(row + 1) * TABLE_WIDTH;
            // As bits, or what is no number would change for ever.
            let bits = |texel: &[f32; 4]| texel.map(f32::to_bits);
            let before = self.rows.get(range.clone());
            before.is_none_or(|before| !before.iter().map(bits).eq(rows[range].iter().map(bits)))
        };
        let changed: Vec<usize> =
            (0..self.lights as usize).filter(|row| is_first || has_changed(*row)).collect();
        if let (Some(first), Some(last)) = (changed.first(), changed.last()) {
            let range = first * TABLE_WIDTH..(last + 1) * TABLE_WIDTH;
            write_rows(gpu, &self.table, *first as u32, &rows[range]);
        }
        self.rows = rows;
        is_first
    }

    /// Writes bands of the layers of all planes; returns whether groups must be made anew.
    pub(super) fn upload(
        &mut self,
        gpu: &Gpu,
        side: u32,
        planes: &[&[[u8; LIGHTS_A_TEXEL]]],
        has_leans: bool,
        bands: &[AtlasBand],
    ) -> Result<bool, ForwardError> {
        let area = side as usize * side as usize;
        let texels = planes.first().map_or(0, |plane| plane.len());
        if let Some(other) = planes.iter().find(|plane| plane.len() != texels) {
            return Err(ForwardError::AtlasLength { found: other.len(), expected: texels });
        }
        if area == 0 || !texels.is_multiple_of(area) {
            return Err(ForwardError::AtlasLength { found: texels, expected: area });
        }
        let layers = (texels / area) as u32;
        let all: Vec<&[[u8; LIGHTS_A_TEXEL]]> =
            planes.iter().flat_map(|plane| plane.chunks_exact(area)).collect();
        let of_plane = |plane: u32| {
            bands
                .iter()
                .filter(|band| band.layer < layers)
                .map(move |band| AtlasBand { layer: plane * layers + band.layer, ..*band })
        };
        // Another number of planes with as many layers in all would take one's layers for another's.
        let is_other = (self.planes, self.layers) != (planes.len() as u32, layers);
        let whole = |layer: u32| AtlasBand { layer, first_row: 0, end_row: side };
        let bands: Vec<AtlasBand> = match is_other {
            true => (0..all.len() as u32).map(whole).collect(),
            false => (0..planes.len() as u32).flat_map(of_plane).collect(),
        };
        let is_new = self.atlas.upload(gpu, side, &all, &bands)?;
        (self.planes, self.layers, self.has_leans) = (planes.len() as u32, layers, has_leans);
        Ok(is_new)
    }

    /// Whether any light is drawn.
    pub(super) fn is_lit(&self) -> bool {
        self.lights > 0
    }

    /// `area_lights` of `frame.wgsl`: lights, above them whether there are leans, and above that layers of a plane, 0 where the atlas has not all lights.
    pub(super) fn code(&self) -> u32 {
        let of_group = if self.has_leans { PLANES_WITH_LEANS } else { 1 };
        let has_all = self.planes as usize / of_group * LIGHTS_A_TEXEL >= self.lights as usize;
        let layers = if has_all { self.layers } else { 0 };
        self.lights | u32::from(self.has_leans) << 8 | layers << 16
    }

    pub(super) fn atlas_view(&self) -> &wgpu::TextureView {
        self.atlas.view()
    }

    pub(super) fn table_view(&self) -> &wgpu::TextureView {
        &self.table_view
    }

    /// Bytes on the card.
    pub(super) fn bytes(&self) -> u64 {
        let table = self.table.width() * self.table.height();
        self.atlas.bytes() + u64::from(table) * size_of::<[f32; 4]>() as u64
    }
}

fn make_table(gpu: &Gpu, width: u32, height: u32) -> (wgpu::Texture, wgpu::TextureView) {
    let texture = float_table(gpu, "area lights", width, height);
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    (texture, view)
}
