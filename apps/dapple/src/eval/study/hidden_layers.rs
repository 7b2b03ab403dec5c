//! Layers before a hidden occluder, which take its place in a map: \[Vermeer2021\] figure 8.

use anyhow::{Result, bail};
use dapple_render::gbuffer::rasterize;
use dapple_scene::glam::{Mat3, Vec3};
use dapple_scene::{Instance, Material, Mesh, Node, Part, PosedCamera, Scene};
use serde::Deserialize;

use super::{
    Errors, Findings, Study, StudyPlot, StudyTable, Subject, axis, column, line, row, size_of, stochastic,
};
use crate::eval::stage::Stage;
use crate::screen_space::{Effort, ScreenSpace};

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct HiddenLayers {
    /// Numbers of layers behind the first one of a grille.
    plates: Vec<u32>,
}

impl Default for HiddenLayers {
    fn default() -> Self {
        HiddenLayers { plates: vec![0, 5, 10] }
    }
}

const MAX_PLATES: u32 = 100;
/// Of the grille, in radii: how far ahead it stands, how wide its bars are and how far apart, and how far its layers are.
const AHEAD: f32 = 3.0;
const WIDE: f32 = 0.12;
const APART: f32 = 0.5;
const BETWEEN: f32 = 0.02;
/// Bars to each side of the middle one, as many as any lens needs.
const TO_EACH_SIDE: i32 = 24;
/// Pixels count where the single layer is so far off the limit.
const HIDDEN: f32 = 0.02;

/// Samples of the map, factor on what hidden surfaces block.
const WAYS: [(u32, f32); 5] = [(2, 1.0), (2, 2.0), (4, 1.0), (4, 2.0), (16, 1.0)];

fn way_name((samples, factor): (u32, f32)) -> String {
    if factor == 1.0 { format!("S = {samples}") } else { format!("S = {samples}, × {factor}") }
}

/// Adds a mesh in world space, seen from both sides.
pub(super) fn add_mesh(scene: &mut Scene, mut mesh: Mesh) {
    scene.materials.push(Material { double_sided: true, ..Material::default() });
    mesh.parts = vec![Part {
        first_triangle: 0,
        triangle_count: mesh.triangles.len() as u32,
        material: scene.materials.len() as u32 - 1,
    }];
    scene.meshes.push(mesh);
    scene.nodes.push(Node::default());
    scene.instances.push(Instance {
        node: scene.nodes.len() as u32 - 1,
        mesh: scene.meshes.len() as u32 - 1,
        skin: None,
        casts: true,
        emitter: Default::default(),
        receives: true,
        rest_from_mesh: Mat3::IDENTITY,
        spare: false,
    });
}

/// Adds a rectangle by its corners, counter-clockwise.
pub(super) fn add_rectangle(mesh: &mut Mesh, corners: [Vec3; 4]) {
    let first = mesh.positions.len() as u32;
    let normal = (corners[1] - corners[0]).cross(corners[3] - corners[0]).normalize_or_zero();
    mesh.positions.extend(corners);
    mesh.normals.extend([normal; 4]);
    mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
}

/// The scene with a grille of so many layers of bars before the camera.
fn with_grille(scene: &Scene, camera: &PosedCamera, radius_m: f32, layers: u32) -> Scene {
    let mut scene = scene.clone();
    let mut mesh = Mesh::default();
    let reach = APART * TO_EACH_SIDE as f32;
    for layer in 0..layers {
        for bar in -TO_EACH_SIDE..=TO_EACH_SIDE {
            let middle = APART * bar as f32;
            let corners = [[-WIDE, -reach], [WIDE, -reach], [WIDE, reach], [-WIDE, reach]];
            let corners = corners.map(|[x, y]| {
                let at = Vec3::new(middle + 0.5 * x, y, -AHEAD - BETWEEN * layer as f32);
                camera.world_from_view.transform_point3(at * radius_m)
            });
            add_rectangle(&mut mesh, corners);
        }
    }
    add_mesh(&mut scene, mesh);
    scene
}

impl Study for HiddenLayers {
    fn title(&self) -> &'static str {
        "Layers before what is hidden"
    }

    fn work(&self, stage: Option<&Stage<'_>>) -> f64 {
        let pictures = self.plates.len() as f64;
        stage
            .map_or(1e7, |stage| pictures * stage.frame_times_s.len() as f64 * stage.samples() as f64 * 300.0)
    }

    fn run(&self, subject: &Subject<'_>) -> Result<Findings> {
        if self.plates.is_empty() || self.plates.iter().any(|plates| *plates > MAX_PLATES) {
            bail!("plates must be numbers from 0 to {MAX_PLATES}, at least one");
        }
        let stage = subject.stage()?;
        let (methods, moments, size) = (subject.layered()?, subject.moments()?, size_of(stage));
        let effort = stage.settings.effort;
        // Of each method and number of plates: the single layer, and each way.
        let mut found = vec![vec![[Errors::default(); WAYS.len() + 1]; self.plates.len()]; methods.len()];
        for (number, moment) in moments.iter().enumerate() {
            for (n, plates) in self.plates.iter().enumerate() {
                let scene = with_grille(stage.scene(), &moment.camera, stage.radius_m, plates + 1);
                let grille = scene.instances.len() as u32 - 1;
                let pose = scene.pose(moment.pose.time);
                let gbuffer = rasterize(&scene, &pose, &moment.camera, size[0], size[1], 1)?;
                let sight = stage.sight(&scene, &pose, &moment.camera, &gbuffer);
                let run = |method: ScreenSpace, compensation: f32| {
                    anyhow::Ok(method.estimate(&sight, Effort { compensation, ..effort })?.visibility)
                };
                for (method, found) in methods.iter().zip(&mut found) {
                    let limit = run(ScreenSpace::Peeled(*method), 1.0)?;
                    let single = run(method.single(), 1.0)?;
                    let samples = gbuffer.samples().iter().zip(single.iter().zip(&limit));
                    let counted: Vec<bool> = samples
                        .map(|(sample, (single, limit))| {
                            sample.is_covered() && sample.instance != grille && single - limit > HIDDEN
                        })
                        .collect();
                    found[n][0].add_covered(&single, &limit, &counted);
                    for ((samples, factor), found) in WAYS.iter().zip(&mut found[n][1..]) {
                        let visibility = run(stochastic(*method, *samples, false), *factor)?;
                        found.add_covered(&visibility, &limit, &counted);
                    }
                }
                let done = number as f64 + (n + 1) as f64 / self.plates.len() as f64;
                (subject.progress)(done / moments.len() as f64);
            }
        }
        let rows = |method: usize, values: &dyn Fn(&[Errors]) -> Vec<f64>| {
            let found = self.plates.iter().zip(&found[method]);
            found.map(|(plates, found)| row(format!("{plates} more"), values(found))).collect()
        };
        let part = |found: &[Errors]| -> Vec<f64> {
            found[1..].iter().map(|errors| 100.0 * (1.0 - errors.bias() / found[0].bias())).collect()
        };
        let tables = (0..methods.len()).flat_map(|method| {
            let name = methods[method].name();
            let ways = |unit: &str, digits| WAYS.map(|way| column(&way_name(way), unit, digits));
            let bias = StudyTable {
                title: format!("{name}, bias to the limit"),
                columns: std::iter::once(column("no map", "", 4)).chain(ways("", 4)).collect(),
                rows: rows(method, &|found| found.iter().map(Errors::bias).collect()),
            };
            let found = StudyTable {
                title: format!("{name}, part of the hidden occlusion that is found"),
                columns: ways("%", 0).to_vec(),
                rows: rows(method, &part),
            };
            [bias, found]
        });
        let tables = tables.collect();
        let lines = methods.iter().zip(&found).flat_map(|(method, found)| {
            [2, 3, 4].map(|way: usize| {
                let points = self
                    .plates
                    .iter()
                    .zip(found)
                    .map(|(plates, found)| [f64::from(*plates), part(found)[way]]);
                let points: Vec<[f64; 2]> = points.filter(|[_, y]| y.is_finite()).collect();
                line(format!("{}, {}", method.name(), way_name(WAYS[way])), points)
            })
        });
        let plot = StudyPlot {
            title: "Hidden occlusion that is found, by the layers before it".to_owned(),
            x: axis("layers more", "", false),
            y: axis("found", "%", false),
            lines: lines.collect(),
        };
        let notes = vec![
            format!(
                "{} pictures of {} × {} pixels through a grille that stands {AHEAD} radii before the camera, bars {WIDE} radii wide and {APART} apart, of one layer and so many more, {BETWEEN} radii apart. Values are \
                 biases (positive is too light) to the method's own limit over all layers, over pixels beside the bars where a single layer is more than {HIDDEN} off.",
                moments.len(),
                size[0],
                size[1]
            ),
            "The paper's figure 8, pillars of Sponza with 5 and 10 layers more, is pictures without numbers."
                .to_owned(),
        ];
        Ok(Findings { notes, tables, plots: vec![plot] })
    }
}
