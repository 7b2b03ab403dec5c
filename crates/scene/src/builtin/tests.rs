use super::*;
#[test]
fn dump() {
    if let Ok(path) = std::env::var("DUMP") {
        let t = std::time::Instant::now();
        let d: f32 = std::env::var("DETAIL").unwrap().parse().unwrap();
        let g = glb("atrium", d).unwrap();
        eprintln!("{:?} {} bytes", t.elapsed(), g.len());
        std::fs::write(path, g).unwrap();
    }
}
