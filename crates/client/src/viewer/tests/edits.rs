//! A scene that is edited while it is shown.

use dapple_scene::{Edit, Edits};

use super::*;

#[test]
fn edits_are_shown_with_their_light_and_can_be_picked() {
    let Some(gpu) = gpu_for_tests() else { return };
    let scene = atrium();
    let mut config = ServerConfig::default();
    config.generate.points_per_m2 = 20.0;
    config.update.rays = 16;
    // What is within the tolerance would be sent or not, and points be as before or nearly so.
    config.publish.precision.tolerance = 0;
    let mut server = Server::new(scene.clone(), &config, &|_| ()).expect("it is in range");
    let (mut client, mut viewer) = (Client::new(scene.clone(), Limits::default()), viewer(&gpu, &scene));
    let join = server.join().expect("it publishes").expect("as it starts");
    client.receive(&join.bytes).expect("it is sound");
    viewer.receive(&join.bytes, 0.0).expect("it is sound");
    work_to_the_end(&mut viewer, 1 << 20);
    let visibility = DrawOptions { view: DebugView::Visibility, fade_s: Some(0.0), ..DrawOptions::default() };
    let points = DrawOptions { view: DebugView::Points, ..visibility };
    let camera = camera(&scene, 0.0);
    let at = (0.5 * SIZE.0 as f32, 0.6 * SIZE.1 as f32);
    let mut edits = Edits::new(&scene);
    let picked = viewer.pick(&camera, SIZE, at, 0.0).expect("something is seen");
    let first = picture(&gpu, &mut viewer, 0.0, 1.0, &points);
    let store = server.store().clone();

    edits.apply(&scene, &Edit::Remove { instance: picked.instance }).expect("it is there");
    server.set_edits(edits.clone());
    client.set_edits(&edits);
    viewer.set_edits(&edits);
    assert_eq!(viewer.edits(), &edits);
    let frame = server.step(0.0).expect("it steps").frame.expect("what stood beside it changes");
    client.receive(&frame.bytes).expect("it is sound");
    viewer.receive(&frame.bytes, 1.0).expect("it is sound");
    work_to_the_end(&mut viewer, 1 << 20);
    let behind = viewer.pick(&camera, SIZE, at, 0.0);
    assert_ne!(behind.map(|behind| behind.instance), Some(picked.instance));
    let shown = picture(&gpu, &mut viewer, 0.0, 2.0, &visibility);
    let (mean, off) = compare(&shown, &twin(&client, &scene, 0.0));
    assert!(mean < 1.5 && off < 0.02, "{mean} codes, {off} off");
    assert!(picture(&gpu, &mut viewer, 0.0, 2.0, &points) != first);

    // Time stands still, and yet its points are back.
    viewer.set_edits(&Edits::new(&scene));
    server.set_edits(Edits::new(&scene));
    let frame = server.step(0.0).expect("it steps").frame.expect("it blocks light again");
    viewer.receive(&frame.bytes, 3.0).expect("it is sound");
    work_to_the_end(&mut viewer, 1 << 20);
    assert_eq!(viewer.pick(&camera, SIZE, at, 0.0), Some(picked));
    assert!(server.store() == viewer.store().expect("it has one"));
    assert!(server.store() == &store);
    let back = picture(&gpu, &mut viewer, 0.0, 4.0, &points);
    let different = back.iter().zip(&first).filter(|(a, b)| a != b).count();
    let most = back.iter().zip(&first).map(|(a, b)| a[0].abs_diff(b[0])).max();
    assert_eq!(different, 0, "as before: {most:?}");
}
