//! Scenes made by hand, and golden images, for this crate's tests.

pub(crate) mod failures;
pub(crate) mod screen;

use std::path::PathBuf;

use dapple_scene::{
    Aabb, AlphaMode, Filter, Image, Instance, Light, LightKind, Material, Mesh, Node, Part, Pose,
    PosedInstance, PosedLight, Scene, Texture, TextureRef, Wrap,
};
use glam::{Affine2, Affine3A, Mat3, Vec2, Vec3, Vec4};

use crate::image::Rgb8Image;

/// A scene that grows by instances, with its pose.
#[derive(Default)]
pub(crate) struct Stage {
    pub(crate) scene: Scene,
    pub(crate) pose: Pose,
}

impl Stage {
    /// A stage with one white, rough, non-metallic material.
    pub(crate) fn new() -> Stage {
        let mut stage = Stage::default();
        stage.add_material(matte(Vec3::ONE));
        stage
    }

    pub(crate) fn add_material(&mut self, material: Material) -> u32 {
        self.scene.materials.push(material);
        self.scene.materials.len() as u32 - 1
    }

    /// Adds a mesh (all of one material) and an instance of it; returns the instance's index.
    pub(crate) fn add(&mut self, mut mesh: Mesh, material: u32, world_from_mesh: Affine3A) -> u32 {
        let triangle_count = mesh.triangles.len() as u32;
        mesh.parts = vec![Part { first_triangle: 0, triangle_count, material }];
        self.scene.meshes.push(mesh);
        self.scene.nodes.push(Node::default());
        self.scene.instances.push(Instance {
            node: self.scene.nodes.len() as u32 - 1,
            mesh: self.scene.meshes.len() as u32 - 1,
            skin: None,
            casts: true,
            emitter: Default::default(),
            receives: true,
            rest_from_mesh: Mat3::from(world_from_mesh.matrix3),
            spare: false,
        });
        self.pose.instances.push(PosedInstance { world_from_mesh, deformed: None });
        self.scene.instances.len() as u32 - 1
    }

    pub(crate) fn add_light(&mut self, kind: LightKind, intensity: f32, position: Vec3, direction: Vec3) {
        self.scene.lights.push(Light { name: String::new(), color: Vec3::ONE, intensity, range: None, kind });
        self.pose.lights.push(PosedLight {
            light: self.scene.lights.len() as u32 - 1,
            position_world: position,
            direction_world: direction.normalize(),
            color: Vec3::ONE,
            intensity,
        });
    }

    /// Adds an image with a repeating texture on it.
    pub(crate) fn add_texture(&mut self, width: u32, filter: Filter, rgba8: Vec<[u8; 4]>) -> TextureRef {
        let height = rgba8.len() as u32 / width;
        self.scene.images.push(Image { name: String::new(), width, height, rgba8 });
        self.scene.textures.push(Texture {
            image: self.scene.images.len() as u32 - 1,
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            filter,
        });
        TextureRef {
            texture: self.scene.textures.len() as u32 - 1,
            uv_set: 0,
            image_from_uv: Affine2::IDENTITY,
        }
    }

    /// The box around everything.
    pub(crate) fn bounds(&self) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for (instance, posed) in self.scene.instances.iter().zip(&self.pose.instances) {
            let mesh = &self.scene.meshes[instance.mesh as usize];
            let box_mesh = Aabb::from_points(mesh.positions.iter().copied());
            bounds = bounds.union(box_mesh.transformed(&posed.world_from_mesh));
        }
        bounds
    }
}

pub(crate) fn matte(color: Vec3) -> Material {
    Material {
        base_color_factor: color.extend(1.0),
        metallic_factor: 0.0,
        alpha_mode: AlphaMode::Opaque,
        ..Material::default()
    }
}

/// A quad by its corners, counter-clockwise from the front, uv (0,1) (1,1) (1,0) (0,0).
pub(crate) fn quad(corners: [Vec3; 4]) -> Mesh {
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
    Mesh {
        positions: corners.to_vec(),
        normals: vec![normal; 4],
        uvs: [vec![Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::new(1.0, 0.0), Vec2::ZERO], vec![]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// A square on the ground, facing up.
pub(crate) fn ground(half: f32) -> Mesh {
    quad([
        Vec3::new(-half, 0.0, half),
        Vec3::new(half, 0.0, half),
        Vec3::new(half, 0.0, -half),
        Vec3::new(-half, 0.0, -half),
    ])
}

/// A closed sphere of radius 1 without duplicate vertices.
pub(crate) fn sphere(stacks: u32, slices: u32) -> Mesh {
    let mut positions = vec![Vec3::Y];
    for i in 1..stacks {
        let polar = std::f64::consts::PI * f64::from(i) / f64::from(stacks);
        for j in 0..slices {
            let azimuth = std::f64::consts::TAU * f64::from(j) / f64::from(slices);
            positions.push(Vec3::new(
                (libm::sin(polar) * libm::sin(azimuth)) as f32,
                libm::cos(polar) as f32,
                (libm::sin(polar) * libm::cos(azimuth)) as f32,
            ));
        }
    }
    positions.push(Vec3::NEG_Y);
    let last = positions.len() as u32 - 1;
    let ring = |i: u32, j: u32| 1 + (i - 1) * slices + j % slices;
    let mut triangles = Vec::new();
    for j in 0..slices {
        triangles.push([0, ring(1, j), ring(1, j + 1)]);
        triangles.push([ring(stacks - 1, j + 1), ring(stacks - 1, j), last]);
        for i in 1..stacks - 1 {
            triangles.push([ring(i, j), ring(i + 1, j), ring(i + 1, j + 1)]);
            triangles.push([ring(i, j), ring(i + 1, j + 1), ring(i, j + 1)]);
        }
    }
    let normals = positions.clone();
    Mesh { positions, normals, triangles, ..Mesh::default() }
}

/// A box from −1 to 1 with a quad for each face.
pub(crate) fn cube() -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for sign in [-1.0f32, 1.0] {
            let normal = Vec3::from_array(std::array::from_fn(|i| if i == axis { sign } else { 0.0 }));
            let right =
                Vec3::from_array(std::array::from_fn(|i| if i == (axis + 1) % 3 { 1.0 } else { 0.0 }));
            let up = normal.cross(right);
            let face =
                quad([normal - right - up, normal + right - up, normal + right + up, normal - right + up]);
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(face.positions);
            mesh.normals.extend(face.normals);
            mesh.uvs[0].extend(&face.uvs[0]);
            mesh.triangles.extend(face.triangles.iter().map(|t| t.map(|v| v + first)));
        }
    }
    mesh
}

/// A rotation about a slanted axis, by angle in radians, then a move.
pub(crate) fn turned(angle: f32, translation: Vec3) -> Affine3A {
    let rotation = glam::Quat::from_axis_angle(Vec3::new(0.3, 0.9, -0.2).normalize(), angle);
    Affine3A::from_rotation_translation(rotation, translation)
}

/// Runs `f` in a pool of so many threads.
pub(crate) fn with_threads<T: Send>(threads: usize, f: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(f)
}

/// Compares a picture with `src/<folder>/golden/<name>.png`, byte for byte. `DAPPLE_BLESS=1` writes it instead.
pub(crate) fn check_golden(folder: &str, name: &str, picture: &Rgb8Image) {
    let path: PathBuf =
        [env!("CARGO_MANIFEST_DIR"), "src", folder, "golden", &format!("{name}.png")].iter().collect();
    if std::env::var_os("DAPPLE_BLESS").is_some_and(|v| v == "1") {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        write_png(&path, picture);
        let size = std::fs::metadata(&path).unwrap().len();
        assert!(size <= 16 * 1024, "{} has {size} bytes, at most 16 KiB are allowed", path.display());
        return;
    }
    let golden = match ::image::open(&path) {
        Ok(golden) => golden.into_rgb8(),
        Err(e) => panic!("cannot read golden image {}: {e}; renew with DAPPLE_BLESS=1", path.display()),
    };
    assert_eq!(golden.dimensions(), (picture.width, picture.height), "size of golden {name}");
    let differing = golden.pixels().zip(&picture.pixels).filter(|(g, p)| g.0 != **p).count();
    assert_eq!(
        differing, 0,
        "{differing} pixels differ from golden {name}; renew with DAPPLE_BLESS=1 if meant"
    );
}

/// Writes a picture, for goldens and for looking at.
pub(crate) fn write_png(path: &std::path::Path, picture: &Rgb8Image) {
    use ::image::codecs::png::{CompressionType, FilterType, PngEncoder};
    use ::image::{ExtendedColorType, ImageEncoder};

    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive);
    // Of gray pictures one channel says all.
    let is_gray = picture.pixels.iter().all(|[r, g, b]| r == g && g == b);
    let (values, color): (Vec<u8>, _) = match is_gray {
        true => (picture.pixels.iter().map(|pixel| pixel[0]).collect(), ExtendedColorType::L8),
        false => (picture.pixels.iter().flatten().copied().collect(), ExtendedColorType::Rgb8),
    };
    encoder.write_image(&values, picture.width, picture.height, color).unwrap();
    std::fs::write(path, bytes).unwrap();
}

/// A checkerboard of `n × n` texels in two colours.
pub(crate) fn checkerboard(n: u32, a: [u8; 4], b: [u8; 4]) -> Vec<[u8; 4]> {
    (0..n * n).map(|i| if (i % n + i / n).is_multiple_of(2) { a } else { b }).collect()
}

/// White vertex colours would be invisible: a ramp from black to white along x.
pub(crate) fn color_ramp(mesh: &mut Mesh) {
    mesh.colors =
        mesh.positions.iter().map(|p| Vec3::splat(0.5 + 0.5 * p.x.clamp(-1.0, 1.0)).extend(1.0)).collect();
    debug_assert!(mesh.colors.iter().all(|c: &Vec4| c.is_finite()));
}
