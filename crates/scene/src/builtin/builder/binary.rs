//! The document's buffer: views of it, and accessors of numbers in it.

use glam::Vec3;
use gltf_json as json;
use json::accessor::{ComponentType, GenericComponentType, Type};
use json::validation::Checked::Valid;
use json::validation::USize64;

use super::{GlbBuilder, id};

impl GlbBuilder {
    pub(super) fn time_accessor(&mut self, times: &[f32]) -> json::Index<json::Accessor> {
        // Channels sampled at the same times share the accessor.
        let key: Vec<u8> = times.iter().flat_map(|t| t.to_le_bytes()).collect();
        if let Some(&accessor) = self.time_accessors.get(&key) {
            return json::Index::new(accessor);
        }
        let accessor = self.push_floats(times, Type::Scalar, Bounds::Yes, None);
        self.time_accessors.insert(key, id(accessor));
        accessor
    }

    pub(super) fn push_view(
        &mut self,
        bytes: &[u8],
        target: Option<json::buffer::Target>,
    ) -> json::Index<json::buffer::View> {
        pad(&mut self.bin, 0);
        let byte_offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        self.root.push(json::buffer::View {
            buffer: json::Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64::from(byte_offset)),
            byte_stride: None,
            name: None,
            target: target.map(Valid),
            extensions: None,
            extras: None,
        })
    }

    pub(super) fn push_floats(
        &mut self,
        values: &[f32],
        type_: Type,
        bounds: Bounds,
        target: Option<json::buffer::Target>,
    ) -> json::Index<json::Accessor> {
        let width = type_.multiplicity();
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.push_view(&bytes, target);
        let bounds = matches!(bounds, Bounds::Yes).then(|| {
            let fold = |start: f32, pick: fn(f32, f32) -> f32| -> json::Value {
                (0..width)
                    .map(|c| values.iter().skip(c).step_by(width).copied().fold(start, pick))
                    .collect::<Vec<f32>>()
                    .into()
            };
            (fold(f32::INFINITY, f32::min), fold(f32::NEG_INFINITY, f32::max))
        });
        self.push_accessor(view, values.len() / width, ComponentType::F32, type_, bounds)
    }

    pub(super) fn push_accessor(
        &mut self,
        view: json::Index<json::buffer::View>,
        count: usize,
        component: ComponentType,
        type_: Type,
        bounds: Option<(json::Value, json::Value)>,
    ) -> json::Index<json::Accessor> {
        let (min, max) = bounds.unzip();
        self.root.push(json::Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(count),
            component_type: Valid(GenericComponentType(component)),
            type_: Valid(type_),
            min,
            max,
            name: None,
            normalized: false,
            sparse: None,
            extensions: None,
            extras: None,
        })
    }
}

/// Whether an accessor states its smallest and largest values.
#[derive(Clone, Copy)]
pub(super) enum Bounds {
    Yes,
    No,
}

pub(super) fn flat3(v: &[Vec3]) -> &[f32] {
    bytemuck::cast_slice(v)
}

pub(super) fn pad(bytes: &mut Vec<u8>, with: u8) {
    while !bytes.len().is_multiple_of(4) {
        bytes.push(with);
    }
}
