//! Small GLB files made in memory.

use std::fmt::Write;

/// A GLB container around JSON and binary data.
fn container(json: &str, bin: &[u8]) -> Vec<u8> {
    let pad = |bytes: &[u8], with: u8| {
        let mut padded = bytes.to_vec();
        padded.resize(bytes.len().next_multiple_of(4), with);
        padded
    };
    let chunks = [(b"JSON", pad(json.as_bytes(), b' ')), (b"BIN\0", pad(bin, 0))];
    let length: usize = 12 + chunks.iter().map(|(_, data)| 8 + data.len()).sum::<usize>();
    let mut file = b"glTF".to_vec();
    file.extend([2_u32, length as u32].iter().flat_map(|x| x.to_le_bytes()));
    for (kind, data) in chunks {
        file.extend((data.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(data);
    }
    file
}

/// The buffer of a file, its views and accessors, one of each a list.
#[derive(Default)]
pub(crate) struct Builder {
    bin: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Builder {
    pub(crate) fn list(
        &mut self,
        component_type: u32,
        kind: &str,
        count: usize,
        bytes: &[u8],
        extra: &str,
    ) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let (offset, length, view) = (self.bin.len(), bytes.len(), self.views.len());
        self.bin.extend(bytes);
        self.views.push(format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#));
        self.accessors.push(format!(
            r#"{{"bufferView":{view},"componentType":{component_type},"count":{count},"type":"{kind}"{extra}}}"#
        ));
        view
    }

    pub(crate) fn floats<const N: usize>(&mut self, kind: &str, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        // Positions and key times must state their range; others may.
        let range = |fold: fn(f32, f32) -> f32| {
            let of = |i: usize| values.iter().map(|v| v[i]).reduce(fold).unwrap_or(0.0).to_string();
            (0..N).map(of).collect::<Vec<_>>().join(",")
        };
        let extra = format!(r#","min":[{}],"max":[{}]"#, range(f32::min), range(f32::max));
        self.list(5126, kind, values.len(), &bytes, &extra)
    }

    pub(crate) fn indices(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.list(5123, "SCALAR", values.len(), &bytes, "")
    }

    /// The file, with further top-level properties (`"nodes":[…],…`).
    pub(crate) fn glb(&self, rest: &str) -> Vec<u8> {
        let (length, views, accessors) = (self.bin.len(), self.views.join(","), self.accessors.join(","));
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{length}}}],"bufferViews":[{views}],"accessors":[{accessors}],{rest}}}"#
        );
        container(&json, &self.bin)
    }
}

/// Two unit squares on the ground side by side, and a lid 0.15 m over the border
/// between them. `left` and `right` are glTF materials. The lid is plain white. A camera `above` sees both squares.
pub(crate) fn two_squares_under_a_lid(left: &str, right: &str) -> Vec<u8> {
    let mut builder = Builder::default();
    let mut meshes = String::new();
    let squares = [[-1.0, 0.0, -0.5, 1.0], [0.0, 0.0, -0.5, 1.0], [-0.15, 0.15, -0.5, 0.3]];
    for (material, [x, y, z, width]) in squares.into_iter().enumerate() {
        let corners = [[x, y, z], [x, y, z + 1.0], [x + width, y, z + 1.0], [x + width, y, z]];
        let positions = builder.floats("VEC3", &corners);
        let indices = builder.indices(&[0, 1, 2, 0, 2, 3]);
        let comma = if material > 0 { "," } else { "" };
        let _ = write!(
            meshes,
            r#"{comma}{{"primitives":[{{"attributes":{{"POSITION":{positions}}},"indices":{indices},"material":{material}}}]}}"#
        );
    }
    builder.glb(&format!(
        r#""extensionsUsed":["KHR_materials_unlit"],"scenes":[{{"nodes":[0,1,2,3]}}],"scene":0,
        "nodes":[{{"mesh":0}},{{"mesh":1}},{{"mesh":2}},
          {{"name":"above","camera":0,"translation":[0,1.2,1.6],"rotation":[-0.34202,0,0,0.939693]}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.9,"znear":0.01}}}}],
        "meshes":[{meshes}],"materials":[{left},{right},{{"doubleSided":true}}]"#
    ))
}

/// A sheet 2 m long (along x, from −1) and 1 m wide, facing up, that a skin of two joints folds at its middle: flat at
/// time 0, the right half upright (the wall of a corner) from 1 to 2 s. A camera `front` looks into the corner.
pub(crate) fn folding_sheet() -> Vec<u8> {
    const SEGMENTS: u16 = 20;
    let (mut positions, mut joints, mut weights, mut indices) = (vec![], vec![], vec![], vec![]);
    for i in 0..=SEGMENTS {
        let x = f32::from(i) / f32::from(SEGMENTS) * 2.0 - 1.0;
        for z in [0.5, -0.5] {
            positions.push([x, 0.0, z]);
            joints.extend([0u8, 1, 0, 0]);
            // The seam itself belongs to both: it does not move, so any weights place it right.
            let folded = if x > 0.0 { 1.0 } else { 0.0 };
            weights.push([1.0 - folded, folded, 0.0, 0.0]);
        }
        if i < SEGMENTS {
            let v = 2 * i;
            indices.extend([v, v + 2, v + 3, v, v + 3, v + 1]);
        }
    }
    let mut builder = Builder::default();
    let vertices = positions.len();
    let positions = builder.floats("VEC3", &positions);
    let joints = builder.list(5121, "VEC4", vertices, &joints, "");
    let weights = builder.floats("VEC4", &weights);
    let indices = builder.indices(&indices);
    let times = builder.floats("SCALAR", &[[0.0], [1.0], [2.0]]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let (flat, upright) = ([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, half, half]);
    let rotations = builder.floats("VEC4", &[flat, upright, upright]);
    builder.glb(&format!(
        r#""scenes":[{{"nodes":[0,1,3]}}],"scene":0,
        "nodes":[{{"mesh":0,"skin":0}},{{"children":[2]}},{{}},
          {{"name":"front","camera":0,"translation":[-0.9,1.1,1.5],"rotation":[-0.2418448,-0.2418448,-0.06,0.9375]}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":1.0,"znear":0.01}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions},"JOINTS_0":{joints},"WEIGHTS_0":{weights}}},
          "indices":{indices}}}]}}],"skins":[{{"joints":[1,2]}}],
        "animations":[{{"samplers":[{{"input":{times},"output":{rotations}}}],
          "channels":[{{"sampler":0,"target":{{"node":2,"path":"rotation"}}}}]}}]"#
    ))
}
