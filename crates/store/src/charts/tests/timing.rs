use super::super::*;
use super::shapes;
#[test]
fn timing() {
    for (name, shape) in [
        ("ball", shapes::ball(1.0, 160)),
        ("torus", shapes::torus(1.0, 0.3, 500)),
        ("floor", shapes::floor(10.0, 220)),
    ] {
        for texel_m in [0.05, 0.02] {
            let params = ChartParams { texel_m, ..ChartParams::for_spacing(1.0, false) };
            let b = std::time::Instant::now();
            let s = super::super::surface::Surface::new(&shape.0, &shape.1);
            let t0 = b.elapsed();
            let b = std::time::Instant::now();
            let g = super::super::grow::grow_all(
                &s,
                super::super::grow::GrowParams { texel: texel_m.into(), least_cosine: 0.7, max_side: 1024 },
            );
            let t1 = b.elapsed();
            let b = std::time::Instant::now();
            let f: Vec<_> = g.iter().map(|g| super::super::flatten::flatten(&s, &g.0, 1024).size).collect();
            let t2 = b.elapsed();
            let b = std::time::Instant::now();
            super::super::pack::pack(&f, 1024);
            let t3 = b.elapsed();
            let b = std::time::Instant::now();
            let set = ChartSet::new(&shape.0, &shape.1, &params).unwrap();
            let t4 = b.elapsed();
            let b = std::time::Instant::now();
            let n = set.sites(&shape.0, &shape.1).len();
            eprintln!(
                "TIME {name} {texel_m} tris {} charts {} texels {} sites {n}: surface {t0:?} grow {t1:?} flat {t2:?} pack {t3:?} all {t4:?} sites {:?}",
                shape.1.len(),
                set.chart_count(),
                set.texel_count(),
                b.elapsed()
            );
        }
    }
}
