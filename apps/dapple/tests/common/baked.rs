//! Reads GLB files as they are written: their JSON, and numbers of accessors.

use std::path::Path;

use serde_json::Value;

/// A GLB file.
pub(crate) struct Glb {
    /// The JSON as it is written.
    pub(crate) text: String,
    pub(crate) json: Value,
    pub(crate) bin: Vec<u8>,
}

impl Glb {
    pub(crate) fn read(path: &Path) -> Glb {
        Glb::parse(&std::fs::read(path).unwrap())
    }

    pub(crate) fn parse(bytes: &[u8]) -> Glb {
        let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&bytes[..4], u32_at(4), u32_at(8)), (&b"glTF"[..], 2, bytes.len()), "header");
        let json_end = 20 + u32_at(12);
        assert_eq!((&bytes[16..20], json_end % 4), (&b"JSON"[..], 0));
        let text = String::from_utf8(bytes[20..json_end].to_vec()).unwrap();
        let bin = match bytes.get(json_end + 8..) {
            Some(rest) => rest[..u32_at(json_end)].to_vec(),
            None => Vec::new(),
        };
        Glb { json: serde_json::from_str(&text).unwrap(), text, bin }
    }

    /// A whole number of the JSON.
    pub(crate) fn whole(&self, pointer: &str) -> usize {
        self.json.pointer(pointer).and_then(Value::as_u64).unwrap_or_else(|| panic!("no {pointer}")) as usize
    }

    pub(crate) fn count(&self, list: &str) -> usize {
        self.json[list].as_array().map_or(0, Vec::len)
    }

    /// The bytes of a buffer view.
    pub(crate) fn view(&self, index: usize) -> &[u8] {
        let view = &self.json["bufferViews"][index];
        assert_eq!(view["buffer"], 0);
        let first = view["byteOffset"].as_u64().unwrap_or(0) as usize;
        &self.bin[first..first + view["byteLength"].as_u64().unwrap() as usize]
    }

    /// All numbers of an accessor, element by element; normalised integers as fractions.
    pub(crate) fn accessor(&self, index: usize) -> Vec<Vec<f64>> {
        let accessor = &self.json["accessors"][index];
        let width = match accessor["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            other => panic!("{other}"),
        };
        let code = accessor["componentType"].as_u64().unwrap();
        let size = match code {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            _ => 4,
        };
        let normalized = accessor["normalized"].as_bool().unwrap_or(false);
        let count = accessor["count"].as_u64().unwrap() as usize;
        let view = accessor["bufferView"].as_u64().unwrap() as usize;
        let bytes = &self.view(view)[accessor["byteOffset"].as_u64().unwrap_or(0) as usize..];
        let stride = self.json["bufferViews"][view]["byteStride"].as_u64().unwrap_or(size * width) as usize;
        let number = |at: usize| -> f64 {
            let b = |i: usize| bytes[at + i];
            let (value, largest) = match code {
                5121 => (f64::from(b(0)), 255.0),
                5123 => (f64::from(u16::from_le_bytes([b(0), b(1)])), 65535.0),
                5125 => (f64::from(u32::from_le_bytes([b(0), b(1), b(2), b(3)])), 1.0),
                5126 => (f64::from(f32::from_le_bytes([b(0), b(1), b(2), b(3)])), 1.0),
                other => panic!("{other}"),
            };
            if normalized { value / largest } else { value }
        };
        (0..count)
            .map(|i| (0..width).map(|c| number(i * stride + c as usize * size as usize)).collect())
            .collect()
    }

    /// What an attribute gives at the corners of all triangles of a primitive, triangle by triangle.
    pub(crate) fn at_corners(&self, mesh: usize, primitive: usize, attribute: &str) -> Vec<Vec<f64>> {
        let at = format!("/meshes/{mesh}/primitives/{primitive}");
        let values = self.accessor(self.whole(&format!("{at}/{attribute}")));
        match self.json.pointer(&format!("{at}/indices")) {
            Some(indices) => self
                .accessor(indices.as_u64().unwrap() as usize)
                .iter()
                .map(|index| values[index[0] as usize].clone())
                .collect(),
            None => values,
        }
    }
}
