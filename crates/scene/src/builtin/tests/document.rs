//! What the tests of all built-in scenes read from their files.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use glam::{Mat4, Quat, Vec3};

use crate::builtin::path::Flight;
use crate::builtin::{glb, path};
use crate::{Aabb, ChannelTarget, Pose, Scene};

/// Length of every animation, seconds, and frames of every camera path.
const SECONDS: f32 = 15.0;
const FRAMES: u32 = 900;

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

/// Checks that every connected piece of a mesh, but of sheets, encloses a volume of its own: none is inside out within others.
pub(in crate::builtin) fn assert_pieces_outward(doc: &Doc, is_sheet: impl Fn(&str) -> bool) {
    for mesh in doc.gltf.meshes().filter(|mesh| !is_sheet(mesh.name().expect("named"))) {
        let name = mesh.name().expect("named");
        let (corners, _) = triangles(doc, &mesh);
        let mut ids: BTreeMap<[u32; 3], usize> = BTreeMap::new();
        let mut parent: Vec<usize> = Vec::new();
        fn root(parent: &mut [usize], mut i: usize) -> usize {
            while parent[i] != i {
                parent[i] = parent[parent[i]];
                i = parent[i];
            }
            i
        }
        let mut firsts = Vec::with_capacity(corners.len());
        for t in &corners {
            let [a, b, c] = t.map(|p| {
                let next = parent.len();
                let id = *ids.entry((p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(next);
                if id == next {
                    parent.push(next);
                }
                id
            });
            for v in [b, c] {
                let (p, q) = (root(&mut parent, a), root(&mut parent, v));
                parent[p.max(q)] = p.min(q);
            }
            firsts.push(a);
        }
        let mut volumes: BTreeMap<usize, (f64, Vec3)> = BTreeMap::new();
        for (t, &first) in corners.iter().zip(&firsts) {
            let piece = volumes.entry(root(&mut parent, first)).or_insert((0.0, t[0]));
            // About a corner of the piece, so that small ones far away keep their digits.
            let [a, b, c] = t.map(|p| (p - piece.1).as_dvec3());
            piece.0 += a.dot(b.cross(c)) / 6.0;
        }
        for (volume, at) in volumes.values() {
            assert!(*volume > 0.0, "{name}: the piece at {at} is inside out ({volume} m³)");
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

/// Checks a scene's only animation: as long as it should be, with its moving parts, and cameras with a key every frame.
pub(in crate::builtin) fn assert_motion(scene: &Scene, name: &str, moving: &[&str], paths: &[&str; 2]) {
    assert_eq!(scene.animations.len(), 1);
    let animation = &scene.animations[0];
    assert_eq!((animation.name.as_str(), animation.duration()), (name, SECONDS));
    let keys = |name: &str| -> Vec<usize> {
        let node = scene.nodes.iter().position(|n| n.name == name).expect(name) as u32;
        animation.channels.iter().filter(|c| c.node == node).map(|c| c.times.len()).collect()
    };
    for name in moving {
        assert!(keys(name).iter().all(|&count| count > 2) && !keys(name).is_empty(), "{name} does not move");
    }
    for name in paths {
        assert_eq!(keys(name), [FRAMES as usize + 1; 2], "{name}");
    }
    let animated: std::collections::BTreeSet<u32> = animation.channels.iter().map(|c| c.node).collect();
    assert_eq!(animated.len(), moving.len() + paths.len(), "something else moves");
    let found: Vec<String> = scene.camera_paths().into_iter().map(|path| path.name).collect();
    assert_eq!(found, [paths[0], paths[1], "orbit"]);
    // At most an eighth of a turn from key to key, so that what is between them is what is meant.
    for channel in animation.channels.iter().filter(|c| c.target == ChannelTarget::Rotation) {
        let keys: Vec<Quat> = channel.values.chunks_exact(4).map(Quat::from_slice).collect();
        let name = &scene.nodes[channel.node as usize].name;
        assert!(keys.windows(2).all(|pair| pair[0].dot(pair[1]) > 0.92), "{name} turns the long way");
    }
}

/// Checks that cameras on their flights stay `clearance_m` away from every triangle of a rigid scene, moving ones
/// included, and turn slowly.
pub(in crate::builtin) fn assert_cameras_keep_clear(
    scene: &Scene,
    flights: &[(&str, Flight)],
    clearance_m: f32,
) {
    let at = |i: usize, pose: &Pose| -> Vec<[Vec3; 3]> {
        let (mesh, world) =
            (&scene.meshes[scene.instances[i].mesh as usize], pose.instances[i].world_from_mesh);
        let place = |v: u32| world.transform_point3(mesh.positions[v as usize]);
        mesh.triangles.iter().map(|t| t.map(place)).collect()
    };
    let poses: Vec<Pose> = (0..=FRAMES).map(|k| scene.pose(f64::from(k) / 60.0)).collect();
    let place = |i: usize, pose: &Pose| pose.instances[i].world_from_mesh;
    let moves = |i: usize| poses.iter().any(|pose| place(i, pose) != place(i, &poses[0]));
    let (movers, still): (Vec<usize>, Vec<usize>) = (0..scene.instances.len()).partition(|&i| moves(i));
    let still: Vec<([Vec3; 3], Aabb)> =
        still.iter().flat_map(|&i| at(i, &poses[0])).map(|t| (t, Aabb::from_points(t))).collect();
    for (name, (eye, look)) in flights {
        let (positions, rotations) = path::fly(eye, look, FRAMES);
        assert_eq!(positions.len(), FRAMES as usize + 1);
        let mut nearest = (f32::INFINITY, 0);
        for (frame, &p) in positions.iter().enumerate() {
            let mut look_at = |t: &[Vec3; 3], b: &Aabb| {
                if b.distance_squared(p) < nearest.0 * nearest.0 {
                    let d = point_triangle_distance(p, *t);
                    if d < nearest.0 {
                        nearest = (d, frame);
                    }
                }
            };
            still.iter().for_each(|(t, b)| look_at(t, b));
            for &i in &movers {
                if scene.instance_bounds_world(&poses[frame], i).distance_squared(p) < 1.0 {
                    at(i, &poses[frame]).iter().for_each(|t| look_at(t, &Aabb::from_points(*t)));
                }
            }
        }
        let turns = rotations.windows(2).map(|q| 2.0 * (q[1] - q[0]).length());
        let (frame, turn) =
            turns.enumerate().fold((0, 0.0_f32), |most, next| if next.1 > most.1 { next } else { most });
        let degrees = turn.to_degrees() * 60.0;
        let speed = positions.windows(2).map(|w| w[0].distance(w[1])).sum::<f32>() / SECONDS;
        eprintln!(
            "{name}: {speed:.2} m/s, {:.2} m from things (frame {}), turns {degrees:.1}°/s (frame {frame})",
            nearest.0, nearest.1
        );
        let (distance, near_frame) = nearest;
        assert!(distance >= clearance_m, "{name}: frame {near_frame} is {distance} m from things");
        assert!(degrees < 90.0, "{name}: turns too fast in frame {frame}");
    }
}

/// An instance that emits: its node's name, its `extras.light`, its index, and whether it moves.
pub(in crate::builtin) struct Lamp {
    pub(in crate::builtin) name: String,
    pub(in crate::builtin) shape: Option<String>,
    pub(in crate::builtin) instance: usize,
    pub(in crate::builtin) moves: bool,
}

/// All instances whose materials emit, in order. Checks what is promised of their meshes: that all of it emits, that a sphere's vertices
/// lie on a sphere about their middle, and that discs and rectangles are flat, face −Z of the mesh, and are what they are called.
pub(in crate::builtin) fn lamps(doc: &Doc, scene: &Scene) -> Vec<Lamp> {
    let moves = scene.moving_instances();
    let mut lamps = Vec::new();
    for (i, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh as usize];
        let emits =
            |part: &crate::Part| scene.materials[part.material as usize].emissive_factor.max_element() > 0.0;
        if !mesh.parts.iter().any(emits) {
            continue;
        }
        let name = scene.nodes[instance.node as usize].name.clone();
        assert!(mesh.parts.iter().all(emits), "{name}: a part of a light does not emit");
        let node = doc.gltf.nodes().nth(instance.node as usize).expect("a node");
        let extras = node.extras().as_ref().map(|e| e.get().to_string()).unwrap_or_default();
        let extras: serde_json::Value = serde_json::from_str(&extras).unwrap_or_default();
        let shape = extras.get("light").and_then(|v| v.as_str()).map(str::to_string);
        let bounds = Aabb::from_points(mesh.positions.iter().copied());
        let size = bounds.max - bounds.min;
        let farthest = |middle: Vec3| mesh.positions.iter().map(|p| p.distance(middle)).fold(0.0, f32::max);
        match shape.as_deref() {
            Some("sphere") => {
                let (middle, radius) = (0.5 * (bounds.min + bounds.max), 0.5 * size.max_element());
                let on = |p: &Vec3| (p.distance(middle) - radius).abs() < 0.01 * radius;
                assert!(mesh.positions.iter().all(on), "{name} is no sphere");
            }
            Some("disc" | "rectangle") => {
                assert_eq!((bounds.min.z, bounds.max.z), (0.0, 0.0), "{name} is not flat");
                assert!(mesh.normals.iter().all(|&n| n == Vec3::NEG_Z), "{name} faces elsewhere");
                let area: f32 = mesh.triangles.iter().fold(0.0, |sum, t| {
                    let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
                    let cross = (b - a).cross(c - a);
                    assert!(cross.z < 0.0, "{name}: a triangle looks back");
                    sum - 0.5 * cross.z
                });
                let whole = match shape.as_deref() {
                    Some("disc") => std::f32::consts::PI * farthest(Vec3::ZERO) * farthest(Vec3::ZERO),
                    _ => size.x * size.y,
                };
                assert!((area / whole - 1.0).abs() < 0.02, "{name}: {area} m² of {whole}");
            }
            other => assert_eq!(other, None, "{name}"),
        }
        lamps.push(Lamp { name, shape, instance: i, moves: moves[i] });
    }
    lamps
}

/// Checks that movers, each a ball about its node of a radius, stay clear of each other and of what stands still, by margins in metres,
/// at `steps` moments; tells the least distances.
pub(in crate::builtin) fn assert_movers_keep_clear(
    scene: &Scene,
    balls: &[(&str, f32)],
    steps: u32,
    margin_m: f32,
) {
    let moves = scene.moving_instances();
    let start = scene.pose(0.0);
    let mut still: Vec<([Vec3; 3], Aabb)> = Vec::new();
    for (i, instance) in scene.instances.iter().enumerate().filter(|(i, _)| !moves[*i]) {
        let mesh = &scene.meshes[instance.mesh as usize];
        let world = start.instances[i].world_from_mesh;
        still.extend(mesh.triangles.iter().map(|t| {
            let t = t.map(|v| world.transform_point3(mesh.positions[v as usize]));
            (t, Aabb::from_points(t))
        }));
    }
    let find = |name: &str| {
        let node = scene.nodes.iter().position(|n| n.name == name).expect(name) as u32;
        scene.instances.iter().position(|i| i.node == node).expect(name)
    };
    let balls: Vec<(&str, usize, f32)> = balls.iter().map(|&(name, r)| (name, find(name), r)).collect();
    let (mut from_still, mut from_others) = (f32::INFINITY, f32::INFINITY);
    for step in 0..steps {
        let time = f64::from(SECONDS) * f64::from(step) / f64::from(steps);
        let pose = scene.pose(time);
        let at = |i: usize| Vec3::from(pose.instances[i].world_from_mesh.translation);
        for (k, &(name, i, radius)) in balls.iter().enumerate() {
            let p = at(i);
            for (t, b) in &still {
                let reach = from_still + radius;
                if b.distance_squared(p) < reach * reach {
                    from_still = from_still.min(point_triangle_distance(p, *t) - radius);
                    assert!(from_still > margin_m, "{name} meets {t:?} at {time:.2} s: {from_still} m");
                }
            }
            for &(other, j, r) in &balls[..k] {
                let gap = p.distance(at(j)) - radius - r;
                from_others = from_others.min(gap);
                assert!(gap > margin_m, "{name} meets {other} at {time:.2} s: {gap} m");
            }
        }
    }
    eprintln!("movers: {from_still:.2} m from what stands still, {from_others:.2} m from each other");
}
