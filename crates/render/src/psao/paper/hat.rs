//! The literal look-up: 2×2×2 cells, [Neff2023] eq. 2 to 4.

use dapple_store::cells::CellTable;

use super::InGrid;
use crate::gbuffer::LocalSurface;
use crate::psao::Hat;

pub(super) fn visibility(table: &CellTable, hat: &Hat, fragment: &LocalSurface) -> f32 {
    let Some(place) = InGrid::new(table, fragment) else { return 1.0 };
    let radius_m = hat.radius * table.layout().spacing_m();
    let (mut sum, mut weights) = (0.0f32, 0.0f32);
    for cell in place.grid.nearest_cells(place.position) {
        for &point in table.points_of(place.grid, cell) {
            let to_point = place.to_point(cell, point);
            let alpha = hat.weight(to_point, point.normal(), fragment.normal_local, radius_m);
            sum += alpha * f32::from(point.visibility());
            weights += alpha;
        }
    }
    // [Neff2023] eq. 4: open where nothing has weight.
    if weights > 0.0 { sum / weights / 255.0 } else { 1.0 }
}
