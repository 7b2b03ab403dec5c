#![allow(warnings)]
#[path = "../benches/rays/scenes.rs"] mod scenes;
#[path = "../benches/rays/rays.rs"] mod rays;
#[path = "../benches/rays/clock.rs"] mod clock;
#[path = "../benches/rays/embree.rs"] mod embree;
use dapple_trace::{Tracer, Ray};
fn main() {
    let names = std::env::args().nth(1).unwrap_or("atrium,spheres,sponza,bunny".into());
    let points: usize = std::env::args().nth(2).map_or(1500, |x| x.parse().unwrap());
    let reps: usize = std::env::args().nth(3).map_or(7, |x| x.parse().unwrap());
    let only = std::env::var("ONLY").ok();
    let lib = embree::Embree::load(std::path::Path::new("/tmp/embreex/x/embreex.libs/libembree4-4aef3270.so.4")).unwrap();
    let device = embree::Device::new(&lib, 1).unwrap();
    for name in names.split(',') {
        let mesh = scenes::make(name).unwrap().unwrap();
        let (scene, pose) = mesh.scene();
        let (tracer, took) = clock::time_thread(|| Tracer::new(&scene, &pose));
        let batch = rays::Batch::new(&mesh, points);
        let geometry = embree::Geometry::new(&mesh.positions, &mesh.triangles).unwrap();
        let high = embree::Scene::new(&device, &geometry, embree::Quality::High, 0).unwrap();
        let medium = embree::Scene::new(&device, &geometry, embree::Quality::Medium, 0).unwrap();
        let mut lo = mesh.positions[0]; let mut hi = lo;
        for p in &mesh.positions { lo = lo.min(*p); hi = hi.max(*p); }
        let diagonal = (hi - lo).length();
        for (len, part) in [("short", 0.02), ("long", 0.25)] {
            let t_max = diagonal * part;
            let mut best = [f64::INFINITY; 6];
            let mut sum = [0u64; 6];
            for _ in 0..reps {
                for way in 0..6 {
                    if let Some(o) = &only { if !o.contains(char::from(b'0' + way as u8)) { continue; } }
                    sum[way] = 0;
                    let (_, t) = clock::time_thread(|| for p in 0..batch.len() {
                        let o = batch.origins[p];
                        sum[way] += u64::from(match way {
                            0 => tracer.occlusion(o, batch.directions(p), t_max)[0].count_ones(),
                            1 => batch.directions(p).iter().filter(|d| tracer.occluded(&Ray { origin_world: o, direction_world: **d, t_max })).count() as u32,
                            2 => high.occlusion::<1>(o, &batch.arranged[p], t_max, false).count_ones(),
                            3 => high.occlusion::<8>(o, &batch.arranged[p], t_max, false).count_ones(),
                            4 => medium.occlusion::<1>(o, &batch.arranged[p], t_max, false).count_ones(),
                            _ => medium.occlusion::<8>(o, &batch.arranged[p], t_max, false).count_ones(),
                        });
                    });
                    best[way] = best[way].min(t.cpu_s);
                }
            }
            let m = best.map(|s| (batch.len() * 64) as f64 / s / 1e6);
            let e = m[2].max(m[3]).max(m[4]).max(m[5]);
            println!("{name:8} {len:5} ours {:6.2} single {:6.2} | E1 {:6.2} {:6.2} E8 {:6.2} {:6.2} | ratio {:.2} single {:.2} | hits {:?} build {:.0} ms", m[0], m[1], m[2], m[4], m[3], m[5], m[0]/e, m[1]/m[2].max(m[4]), sum, took.cpu_s*1e3);
        }
    }
}
