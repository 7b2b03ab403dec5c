//! Visibility at vertices: fitted to what is measured all over the triangles between them.

use std::collections::HashMap;

use dapple_scene::glam::Vec3;
use dapple_scene::{Mesh, MeshOrigin};

use super::accessor::{Attribute, Component, Elements};
use super::fit::{Fit, HIDDEN_WEIGHT};
use super::plan::{Copy, MeshPlan, Pool, place_in_triangle, triangles_of};
use super::surfaces::{Place, Surfaces};

/// Places measured on one triangle.
const LEAST_PLACES: u32 = 4;
const MOST_PLACES: f64 = 256.0;

/// Places of all triangles of one copy; beyond, large triangles get fewer.
const MOST_PLACES_OF_ALL: f64 = (1u64 << 25) as f64;

/// Places measured at a time.
const BATCH: usize = 1 << 16;

/// How densely triangles are measured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Density {
    pub(crate) per_m2: f64,
    /// Rays a place.
    pub(crate) rays: u32,
}

/// What was found at a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AtVertex {
    /// 1 open, 0 blocked.
    pub(crate) visibility: f32,
    /// Unit vector in the space of the mesh's normals, or zero.
    pub(crate) bent: Vec3,
}

/// Which vertices of a mesh are one: those at one place that face one way, whatever else tells them apart.
pub(crate) struct Welded {
    /// For each vertex of the mesh.
    pub(crate) of_vertex: Vec<u32>,
    pub(crate) count: usize,
}

impl Welded {
    pub(crate) fn new(mesh: &Mesh, plan: &MeshPlan) -> Welded {
        let mut known: HashMap<([u32; 3], [i16; 3]), u32> = HashMap::new();
        let mut of_vertex = vec![u32::MAX; mesh.positions.len()];
        for part in 0..mesh.parts.len() {
            let has_normals = plan.pools[plan.pool_of_part[part]].has_normals;
            for &v in mesh.triangles[triangles_of(mesh, part)].as_flattened() {
                let v = v as usize;
                // −0 is 0; normals that differ by rounding only are one.
                let position = mesh.positions[v].to_array().map(|x| (x + 0.0).to_bits());
                let normal = if has_normals { mesh.normals[v] } else { Vec3::ZERO };
                let normal = normal.to_array().map(|x| (x * 512.0).round() as i16);
                let next = known.len() as u32;
                of_vertex[v] = *known.entry((position, normal)).or_insert(next);
            }
        }
        Welded { of_vertex, count: known.len() }
    }
}

/// How many places will be measured on each triangle of a copy.
pub(crate) fn place_counts(surfaces: &Surfaces<'_>, copy: &Copy, density: Density) -> Vec<u32> {
    let instance = copy.members[0] as usize;
    let triangles = surfaces.mesh_of(instance).triangles.len();
    let wanted: Vec<f64> =
        (0..triangles).map(|t| (surfaces.area_m2(instance, t) * density.per_m2).min(MOST_PLACES)).collect();
    let all: f64 = wanted.iter().sum();
    let scale = (MOST_PLACES_OF_ALL / all.max(1.0)).min(1.0);
    wanted.iter().map(|wanted| ((wanted * scale).round() as u32).max(LEAST_PLACES)).collect()
}

/// Measures a copy and fits its vertices, welded as `welded` says. `done` is told how many places were measured.
pub(crate) fn bake_vertices(
    surfaces: &Surfaces<'_>,
    copy: &Copy,
    welded: &Welded,
    density: Density,
    done: &dyn Fn(usize),
) -> Vec<AtVertex> {
    if surfaces.measures_bent() {
        let values = fit(surfaces, copy, welded, density, done, |visibility, open| {
            [visibility, open.x, open.y, open.z]
        });
        let bent = |v: [f32; 4]| Vec3::new(v[1], v[2], v[3]).normalize_or_zero();
        return values.into_iter().map(|v| AtVertex { visibility: clamp(v[0]), bent: bent(v) }).collect();
    }
    let values = fit(surfaces, copy, welded, density, done, |visibility, _| [visibility]);
    values.into_iter().map(|[v]| AtVertex { visibility: clamp(v), bent: Vec3::ZERO }).collect()
}

/// The fit may overshoot beside steep changes.
fn clamp(visibility: f32) -> f32 {
    visibility.clamp(0.0, 1.0)
}

fn fit<const N: usize>(
    surfaces: &Surfaces<'_>,
    copy: &Copy,
    welded: &Welded,
    density: Density,
    done: &dyn Fn(usize),
    values_of: impl Fn(f32, Vec3) -> [f32; N],
) -> Vec<[f32; N]> {
    let instance = copy.members[0];
    let mesh = surfaces.mesh_of(instance as usize);
    let counts = place_counts(surfaces, copy, density);
    let mut fit = Fit::<N>::new(welded.count);
    let (mut places, mut areas): (Vec<Place>, Vec<f64>) = (Vec::new(), Vec::new());
    let measure = |fit: &mut Fit<N>, places: &mut Vec<Place>, areas: &mut Vec<f64>| {
        let measured = surfaces.measure_mean(&copy.members, places, density.rays);
        for ((place, area), m) in places.iter().zip(areas.iter()).zip(&measured) {
            let weight = if m.hidden { HIDDEN_WEIGHT } else { 1.0 };
            let values = values_of(m.visibility, m.open_mesh);
            fit.sample(place.triangle as usize, place.weights, values, weight * area);
        }
        done(places.len());
        places.clear();
        areas.clear();
    };
    for (t, (corners, &count)) in mesh.triangles.iter().zip(&counts).enumerate() {
        let area = surfaces.area_m2(instance as usize, t);
        let points = surfaces.corners_world(instance as usize, t).map(|p| p.as_dvec3());
        fit.triangle(corners.map(|v| welded.of_vertex[v as usize]), points);
        for index in 0..count {
            let weights = place_in_triangle(u64::from(t as u32), index);
            let key = u64::from(instance) << 32 | t as u64;
            places.push(Place { instance, triangle: t as u32, weights, key, turn: index });
            areas.push(area / f64::from(count));
        }
        if places.len() >= BATCH {
            measure(&mut fit, &mut places, &mut areas);
        }
    }
    measure(&mut fit, &mut places, &mut areas);
    fit.solve(values_of(1.0, Vec3::ZERO))
}

/// Brings values of welded vertices to the vertices that a pool will have.
pub(crate) fn spread<'a>(
    pool: &Pool,
    mesh: &Mesh,
    origin: &MeshOrigin,
    welded: &Welded,
    values: &'a [AtVertex],
) -> Vec<Option<&'a AtVertex>> {
    let mut of_element: HashMap<u32, &AtVertex> = HashMap::new();
    for part in pool.parts() {
        for &v in mesh.triangles[triangles_of(mesh, part)].as_flattened() {
            of_element.insert(origin.vertices[v as usize], &values[welded.of_vertex[v as usize] as usize]);
        }
    }
    let of = |element: u32| of_element.get(&element).copied();
    match &pool.sources {
        Some(sources) => sources.iter().map(|&element| of(element)).collect(),
        None => (0..pool.count as u32).map(of).collect(),
    }
}

/// One number a vertex.
pub(crate) fn scalar_attribute(name: &str, values: &[Option<&AtVertex>]) -> Attribute {
    let bytes = values.iter().flat_map(|v| v.map_or(1.0, |v| v.visibility).to_le_bytes()).collect();
    let (kind, component) = ("SCALAR", Component::F32);
    Attribute { name: name.to_owned(), kind, component, normalized: false, bytes }
}

/// Bent normals, unit vectors in the space of the mesh's normals.
pub(crate) fn bent_attribute(values: &[Option<&AtVertex>]) -> Attribute {
    let vector = |v: &Option<&AtVertex>| v.map_or(Vec3::ZERO, |v| v.bent).to_array();
    let bytes = values.iter().flat_map(vector).flat_map(f32::to_le_bytes).collect();
    let (name, kind, component) = ("_BENT_NORMAL".to_owned(), "VEC3", Component::F32);
    Attribute { name, kind, component, normalized: false, bytes }
}

/// Colours: what the file has (white otherwise) at `element_of` each vertex, multiplied by visibility; alpha stays. Floats stay
/// floats, all else becomes 16 bits.
pub(crate) fn color_attribute(
    values: &[Option<&AtVertex>],
    given: Option<&Elements<'_>>,
    element_of: &dyn Fn(usize) -> usize,
) -> Attribute {
    let is_float = given.is_some_and(|elements| elements.component() == Component::F32);
    let mut bytes = Vec::with_capacity(values.len() * if is_float { 16 } else { 8 });
    for (i, value) in values.iter().enumerate() {
        let visibility = value.map_or(1.0, |v| v.visibility);
        for channel in 0..4 {
            let before = match given {
                Some(elements) if channel < elements.width => elements.fraction(element_of(i), channel),
                _ => 1.0,
            };
            let after = if channel < 3 { before * visibility } else { before };
            if is_float {
                bytes.extend(after.to_le_bytes());
            } else {
                bytes.extend(((after * 65535.0).round().clamp(0.0, 65535.0) as u16).to_le_bytes());
            }
        }
    }
    let component = if is_float { Component::F32 } else { Component::U16 };
    Attribute { name: "COLOR_0".to_owned(), kind: "VEC4", component, normalized: !is_float, bytes }
}
