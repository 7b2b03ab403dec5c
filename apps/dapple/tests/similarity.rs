//! How near reconstruction from points comes to ray-traced truth.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::{atrium, config, join, server, small, truth, visibility_psnr_db};
use dapple_client::Reconstruction;
use dapple_render::psao::{Hat, Kernel};

#[test]
fn moving_least_squares_come_nearer_to_the_truth_than_the_papers_kernel() {
    let scene = atrium(0.05);
    let mut server = server(&scene, &config(64.0, 64));
    let mut client = join(&mut server);
    let time_s = 2.0;
    client.receive(&server.step(time_s).unwrap().frame.unwrap().bytes).unwrap();
    // The gallery looks along balusters and curtains, which so few points hardly resolve.
    for (path, least_db) in scene.camera_paths().iter().zip([24.5, 18.5]) {
        let camera = path.camera(&scene, &scene.pose(time_s));
        let drawn = client.draw(&camera, time_s, &small(160, 90)).unwrap();
        let truth = truth(&scene, &drawn, 128, 0.6);
        let methods = [Reconstruction::Atlas, Kernel::default().into(), Kernel::Hat(Hat::default()).into()];
        let [atlas, mls, hat] =
            methods.map(|m| visibility_psnr_db(&drawn, &truth, &client.visibility(&drawn, &m)));
        let open = visibility_psnr_db(&drawn, &truth, &vec![1.0; truth.len()]);
        let found = format!(
            "{}: atlas {atlas:.2} dB, least squares {mls:.2} dB, hat {hat:.2} dB, all open {open:.2} dB",
            path.name
        );
        eprintln!("{found}");
        assert!(mls >= least_db && mls >= hat + 2.0 && hat >= open + 4.0, "{found}");
        assert!(atlas >= mls - 0.1, "{found}");
    }
}
