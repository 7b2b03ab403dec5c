//! What the tests of all built-in scenes read from their files.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use glam::{Mat4, Vec3};

use crate::builtin::glb;

/// A built-in scene as its file says it.
pub(in crate::builtin) struct Doc {
    pub(in crate::builtin) gltf: gltf::Gltf,
    pub(in crate::builtin) bin: Vec<u8>,
}

/// Parses a GLB.
pub(in crate::builtin) fn read(bytes: &[u8]) -> Doc {
    let mut gltf = gltf::Gltf::from_slice(bytes).expect("valid glTF");
    let bin = gltf.blob.take().expect("a binary chunk");
    Doc { gltf, bin }
}

/// What every built-in scene promises: the same bytes twice and on every machine (`hash`, of the scene at `detail`), triangles
/// within these ranges at full and at that detail, and a layout that no detail changes.
///
/// Renew the hash when the scene is changed on purpose (the failure message tells it); a change without that is a loss of
/// determinism or a changed dependency.
pub(in crate::builtin) fn assert_promises(
    name: &str,
    detail: f32,
    hash: &str,
    full: RangeInclusive<usize>,
    small: RangeInclusive<usize>,
) {
    let make = |detail: f32| glb(name, detail).expect("a built-in scene");
    let bytes = make(detail);
    assert!(make(detail) == bytes, "{name} differs from one time to the next");
    assert_eq!(blake3::hash(&bytes).to_hex().as_str(), hash, "{name}");

    let doc = read(&bytes);
    let counts = [triangle_count(&read(&make(1.0))), triangle_count(&doc)];
    eprintln!("{name}: {} triangles at detail 1, {} at detail {detail}", counts[0], counts[1]);
    assert!(full.contains(&counts[0]) && small.contains(&counts[1]), "{name}: {counts:?}");
    assert_eq!(layout(&doc), layout(&read(&make(0.2))), "{name}");
}

/// Triangles, each mesh counted as often as it is placed.
fn triangle_count(doc: &Doc) -> usize {
    let of_mesh = |m: gltf::Mesh<'_>| -> usize {
        m.primitives().map(|p| p.indices().expect("indexed").count() / 3).sum()
    };
    doc.gltf.nodes().filter_map(|n| n.mesh()).map(of_mesh).sum()
}

/// Corners of all triangles of a mesh, with its normals.
pub(in crate::builtin) fn triangles(doc: &Doc, mesh: &gltf::Mesh<'_>) -> (Vec<[Vec3; 3]>, Vec<Vec3>) {
    let (mut corners, mut normals) = (Vec::new(), Vec::new());
    for primitive in mesh.primitives() {
        let reader = primitive.reader(|_| Some(&doc.bin));
        let positions: Vec<Vec3> = reader.read_positions().expect("positions").map(Vec3::from).collect();
        let own: Vec<Vec3> = reader.read_normals().expect("normals").map(Vec3::from).collect();
        assert_eq!(own.len(), positions.len());
        assert_eq!(reader.read_tex_coords(0).expect("uvs").into_f32().count(), positions.len());
        normals.extend(own);
        let indices: Vec<u32> = reader.read_indices().expect("indices").into_u32().collect();
        corners.extend(indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|i| positions[i as usize])));
    }
    (corners, normals)
}

/// World corners of the triangles of root nodes, as far as their names say that they stand still.
pub(in crate::builtin) fn still_triangles(doc: &Doc, is_still: impl Fn(&str) -> bool) -> Vec<[Vec3; 3]> {
    let mut all = Vec::new();
    for node in doc.gltf.nodes() {
        let Some(mesh) = node.mesh() else { continue };
        if !node.name().is_some_and(&is_still) {
            continue;
        }
        let world = Mat4::from_cols_array_2d(&node.transform().matrix());
        let (corners, _) = triangles(doc, &mesh);
        all.extend(corners.iter().map(|t| t.map(|p| world.transform_point3(p))));
    }
    all
}

/// Distance of a point from a triangle.
pub(in crate::builtin) fn point_triangle_distance(p: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    let segment = |a: Vec3, b: Vec3| {
        let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        p.distance(a.lerp(b, t))
    };
    let n = (b - a).cross(c - a).normalize_or_zero();
    let inside = [(a, b), (b, c), (c, a)].iter().all(|&(q, r)| (r - q).cross(p - q).dot(n) >= 0.0);
    if inside { (p - a).dot(n).abs() } else { segment(a, b).min(segment(b, c)).min(segment(c, a)) }
}

/// Names and transforms of all nodes.
fn layout(doc: &Doc) -> Vec<(String, Mat4)> {
    let of = |n: gltf::Node<'_>| {
        (n.name().unwrap_or("").to_string(), Mat4::from_cols_array_2d(&n.transform().matrix()))
    };
    doc.gltf.nodes().map(of).collect()
}

/// Checks that every mesh but sheets has unit normals and encloses a volume, triangles outward.
pub(in crate::builtin) fn assert_closed(doc: &Doc, is_sheet: impl Fn(&str) -> bool) {
    for mesh in doc.gltf.meshes() {
        let name = mesh.name().expect("named");
        let (corners, normals) = triangles(doc, &mesh);
        for n in normals {
            assert!((n.length() - 1.0).abs() < 1e-4, "{name}: normal {n}");
        }
        // Adding zero makes −0 equal to 0 in the keys.
        let key = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
        let mut edges: BTreeMap<_, i32> = BTreeMap::new();
        let mut volume = 0.0_f64;
        for t in &corners {
            let [a, b, c] = *t;
            assert!((b - a).cross(c - a).length() > 0.0, "{name}: a triangle without area at {a}");
            volume += f64::from(a.dot(b.cross(c)));
            for (p, q) in [(a, b), (b, c), (c, a)] {
                let (p, q) = (key(p), key(q));
                *edges.entry((p.min(q), p.max(q))).or_default() += if p < q { 1 } else { -1 };
            }
        }
        if !is_sheet(name) {
            let open = edges.iter().filter(|(_, balance)| **balance != 0).count();
            assert_eq!(open, 0, "{name}: edges without their opposite");
            assert!(volume > 0.0, "{name}: inside out");
        }
    }
}

/// Checks that no vertex normal points to the back of its triangle.
pub(in crate::builtin) fn assert_normals_agree(doc: &Doc) {
    for mesh in doc.gltf.meshes() {
        for primitive in mesh.primitives() {
            let reader = primitive.reader(|_| Some(&doc.bin));
            let p: Vec<Vec3> = reader.read_positions().expect("positions").map(Vec3::from).collect();
            let n: Vec<Vec3> = reader.read_normals().expect("normals").map(Vec3::from).collect();
            let indices: Vec<u32> = reader.read_indices().expect("indices").into_u32().collect();
            for t in indices.chunks_exact(3) {
                let [a, b, c] = [t[0], t[1], t[2]].map(|i| i as usize);
                let face = (p[b] - p[a]).cross(p[c] - p[a]).normalize();
                let name = mesh.name();
                assert!(face.dot(n[a] + n[b] + n[c]) > 0.0, "{name:?}: a normal points inward at {}", p[a]);
            }
        }
    }
}
