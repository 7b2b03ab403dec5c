//! The table of lights as texels of floats, as `arrival.wgsl` reads it.

use dapple_scene::area_lights::LightForm;
use dapple_store::cones::LightSet;
use glam::Vec3;

use super::{AreaLightTable, Entry, MAX_PLACES, MAX_TRIANGLES};

/// Texels of a row: one row a light.
pub(crate) const TABLE_WIDTH: usize = FIRST_PLACE + 3 * MAX_PLACES;
/// The first texel of a row that is a corner, or of a triangle or place: three each.
const FIRST_PLACE: usize = 4;

// Forms; 0 is a light that does not shine.
const SPHERE: f32 = 1.0;
const DISC: f32 = 2.0;
const QUAD: f32 = 3.0;
const TRIANGLES: f32 = 4.0;
const PLACES: f32 = 5.0;
/// What a light's class counts beside them.
const FORMS: f32 = 8.0;

impl AreaLightTable {
    /// Row by row; as many rows as [`AreaLightTable::lights`].
    ///
    /// A row: centre and radius of a ball that holds the light; radiance, form and class ([`LightSet::class_of`]); normal, or number of parts and whether all shine alike, and
    /// whether both sides do; radius² of a disc as large as it looks ([`Entry::disc_m2`]); then corners, or of each triangle its corners with one colour of its radiance each, or of each place position and
    /// area, normal, radiance.
    pub(crate) fn texels(&self) -> Vec<[f32; 4]> {
        let mut texels = vec![[0.0; 4]; self.entries.len() * TABLE_WIDTH];
        let rows = texels.chunks_exact_mut(TABLE_WIDTH);
        for ((row, entry), light) in rows.zip(&self.entries).zip(&self.lights) {
            if let Some(entry) = entry {
                write(row, entry);
                row[1][3] += FORMS * LightSet::class_of(*light) as f32;
            }
        }
        texels
    }
}

fn write(row: &mut [[f32; 4]], entry: &Entry) {
    let Entry { figure, center, radius } = entry;
    let four = |v: Vec3, w: f32| [v.x, v.y, v.z, w];
    let two_sided = f32::from(u8::from(figure.two_sided));
    row[0] = four(*center, *radius);
    let (form, facing) = match &figure.form {
        LightForm::Sphere { .. } => (SPHERE, [0.0; 4]),
        LightForm::Disc { normal, .. } => (DISC, four(*normal, two_sided)),
        LightForm::Quad { corners, normal } => {
            for (texel, corner) in row[FIRST_PLACE..].iter_mut().zip(corners) {
                *texel = four(*corner, 0.0);
            }
            (QUAD, four(*normal, two_sided))
        }
        LightForm::Triangles(triangles) => {
            let count = triangles.len().min(MAX_TRIANGLES);
            for (texels, triangle) in row[FIRST_PLACE..].chunks_exact_mut(3).zip(triangles).take(count) {
                for (k, texel) in texels.iter_mut().enumerate() {
                    *texel = four(triangle.corners[k], triangle.radiance[k]);
                }
            }
            (TRIANGLES, [count as f32, 0.0, 0.0, two_sided])
        }
        LightForm::Places(places) => {
            let count = places.len().min(MAX_PLACES);
            for (texels, place) in row[FIRST_PLACE..].chunks_exact_mut(3).zip(places) {
                texels[0] = four(place.position_world, place.area_m2);
                texels[1] = four(place.normal_world, 0.0);
                texels[2] = four(place.radiance, 0.0);
            }
            let is_even = places.iter().all(|place| place.radiance == figure.radiance);
            (PLACES, [count as f32, f32::from(u8::from(is_even)), 0.0, two_sided])
        }
    };
    row[1] = four(figure.radiance, form);
    row[2] = facing;
    row[3][0] = entry.disc_m2();
}
