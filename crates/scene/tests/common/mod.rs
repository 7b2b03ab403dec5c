//! Access to the shared third-party test files, and small files made on the spot.
#![allow(dead_code, reason = "each test binary uses its own part")]

use std::path::{Path, PathBuf};

use dapple_scene::{Files, LoadError, NoFiles, Scene, load};

/// Reads files below one folder.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Files for Folder {
    fn read(&self, uri: &str, limit_bytes: u64) -> std::io::Result<Vec<u8>> {
        let path = self.0.join(uri);
        if std::fs::metadata(&path)?.len() > limit_bytes {
            return Err(std::io::Error::other("file too large"));
        }
        std::fs::read(path)
    }
}

/// The folder of shared test files, if it is there.
pub(crate) fn shared(sub: &str) -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared");
    let folder = PathBuf::from(std::env::var("DAPPLE_SHARED").unwrap_or(default.to_owned())).join(sub);
    if !folder.is_dir() {
        eprintln!("skipped: {} not found", folder.display());
        return None;
    }
    Some(folder)
}

pub(crate) fn load_path(path: &Path) -> Result<Scene, LoadError> {
    let bytes = std::fs::read(path).unwrap();
    let folder = path.parent().unwrap().to_owned();
    load(path.file_name().unwrap().to_str().unwrap(), &bytes, &Folder(folder))
}

/// Everything the documentation of [`Scene`] promises about its lists.
pub(crate) fn assert_consistent(scene: &Scene, at: &str) {
    for (i, node) in scene.nodes.iter().enumerate() {
        assert!(node.parent.is_none_or(|parent| (parent as usize) < i), "{at}: parents first");
        assert!(node.camera.is_none_or(|camera| (camera as usize) < scene.cameras.len()), "{at}");
        assert!(node.light.is_none_or(|light| (light as usize) < scene.lights.len()), "{at}");
    }
    for mesh in &scene.meshes {
        let n = mesh.positions.len();
        assert_eq!(mesh.normals.len(), n, "{at}");
        let full = |len: usize| assert!(len == 0 || len == n, "{at}: list of {len} for {n} vertices");
        full(mesh.tangents.len());
        mesh.uvs.iter().for_each(|uvs| full(uvs.len()));
        full(mesh.colors.len());
        for set in &mesh.influences {
            assert_eq!((set.joints.len(), set.weights.len()), (n, n), "{at}");
        }
        for v in 0..if mesh.influences.is_empty() { 0 } else { n } {
            let sum: f32 = mesh.influences.iter().flat_map(|set| set.weights[v]).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{at}: weights of vertex {v} sum to {sum}");
        }
        for target in &mesh.morph_targets {
            full(target.positions.len());
            full(target.normals.len());
        }
        assert_eq!(mesh.morph_weights.len(), mesh.morph_targets.len(), "{at}");
        assert!(mesh.positions.iter().all(|p| p.is_finite()), "{at}");
        assert!(mesh.normals.iter().all(|v| v.is_normalized()), "{at}");
        assert!(mesh.triangles.iter().flatten().all(|v| (*v as usize) < n), "{at}");
        let mut next = 0;
        for part in &mesh.parts {
            assert_eq!(part.first_triangle, next, "{at}");
            assert!((part.material as usize) < scene.materials.len(), "{at}");
            next += part.triangle_count;
        }
        assert_eq!(next as usize, mesh.triangles.len(), "{at}");
    }
    assert!(
        scene.instances.windows(2).all(|pair| pair[0].node < pair[1].node),
        "{at}: instances in node order"
    );
    for instance in &scene.instances {
        assert!(
            (instance.node as usize) < scene.nodes.len() && (instance.mesh as usize) < scene.meshes.len()
        );
        assert!(instance.skin.is_none_or(|skin| (skin as usize) < scene.skins.len()));
        assert!(instance.rest_from_mesh.is_finite(), "{at}");
    }
    for skin in &scene.skins {
        assert_eq!(skin.joints.len(), skin.inverse_bind_matrices.len(), "{at}");
        assert!(skin.joints.iter().all(|joint| (*joint as usize) < scene.nodes.len()), "{at}");
    }
    for material in &scene.materials {
        let textures = [
            material.base_color_texture,
            material.metallic_roughness_texture,
            material.normal_texture.map(|normal| normal.texture),
            material.occlusion_texture,
            material.emissive_texture,
        ];
        for texture in textures.into_iter().flatten() {
            assert!((texture.texture as usize) < scene.textures.len() && texture.uv_set < 2, "{at}");
        }
    }
    assert!(scene.textures.iter().all(|texture| (texture.image as usize) < scene.images.len()), "{at}");
    for image in &scene.images {
        assert_eq!(image.rgba8.len() as u64, u64::from(image.width) * u64::from(image.height), "{at}");
    }
    for channel in scene.animations.iter().flat_map(|animation| &animation.channels) {
        assert!((channel.node as usize) < scene.nodes.len() && !channel.times.is_empty(), "{at}");
        assert!(channel.times.windows(2).all(|pair| pair[0] < pair[1]), "{at}");
        assert_eq!(channel.values.len() % channel.times.len(), 0, "{at}");
    }
}

/// Everything a program does with a scene: none of it may panic, and all of it must be finite.
pub(crate) fn use_scene(scene: &Scene, at: &str) {
    assert_consistent(scene, at);
    scene.hash();
    let paths = scene.camera_paths();
    assert!(matches!(paths.last().unwrap().source, dapple_scene::CameraSource::Orbit(_)), "{at}");
    for time in [0.0, 0.3, 1.7, 1e9, -1.0] {
        let pose = scene.pose(time);
        assert!(pose.world_from_node.iter().all(|world| world.is_finite()), "{at} at {time}");
        for (i, instance) in scene.instances.iter().enumerate() {
            let positions = scene.vertex_positions(&pose, i);
            assert_eq!(positions.len(), scene.meshes[instance.mesh as usize].positions.len(), "{at}");
            assert!(positions.iter().all(|p| p.is_finite()), "{at} at {time}");
            if let Some(deformed) = &pose.instances[i].deformed {
                assert!(deformed.normals.iter().all(|n| n.is_normalized()), "{at} at {time}");
            }
        }
        for path in &paths {
            assert!(path.camera(scene, &pose).world_from_view.is_finite(), "{at}: {}", path.name);
        }
        assert!(pose.lights.iter().all(|light| light.direction_world.is_normalized()), "{at}");
    }
}

/// A GLB container around JSON and binary data.
pub(crate) fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
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

/// Builds the buffer, views and accessors of a small glTF file.
#[derive(Default)]
pub(crate) struct Builder {
    pub(crate) bin: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Builder {
    pub(crate) fn view(&mut self, bytes: &[u8], extra: &str) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let (offset, length) = (self.bin.len(), bytes.len());
        self.bin.extend(bytes);
        self.views.push(format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}{extra}}}"#));
        self.views.len() - 1
    }

    pub(crate) fn accessor(&mut self, json: String) -> usize {
        self.accessors.push(json);
        self.accessors.len() - 1
    }

    pub(crate) fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let view = self.view(&values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>(), "");
        let count = values.len() / width;
        self.accessor(format!(
            r#"{{"bufferView":{view},"componentType":5126,"count":{count},"type":"{kind}"}}"#
        ))
    }

    pub(crate) fn bytes(&mut self, kind: &str, values: &[u8]) -> usize {
        let view = self.view(values, "");
        let count = values.len() / if kind == "VEC4" { 4 } else { 1 };
        self.accessor(format!(
            r#"{{"bufferView":{view},"componentType":5121,"count":{count},"type":"{kind}"}}"#
        ))
    }

    /// The file, with further top-level properties (`"nodes":[…],…`).
    pub(crate) fn glb(&self, rest: &str) -> Vec<u8> {
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{}}}],"bufferViews":[{}],"accessors":[{}],{rest}}}"#,
            self.bin.len(),
            self.views.join(","),
            self.accessors.join(",")
        );
        glb(&json, &self.bin)
    }
}

pub(crate) fn load_bytes(bytes: &[u8]) -> Result<Scene, LoadError> {
    load("made.glb", bytes, &NoFiles)
}
