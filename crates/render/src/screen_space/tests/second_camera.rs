//! The second camera on the card: as the twin's, more occlusion than of one, and pictures of several cameras in one submission.

use super::*;
use crate::sdao::SideView;
use crate::ssao::SsaoParams;

/// What the second camera sees, of a method that has one: the twin's picture, with the map that the card has drawn.
pub(super) fn side_view(stage: &Stage, view: &ScreenView, bench: &Bench) -> Option<SideView> {
    let side = view.method.second_camera(view.half_resolution)?;
    let ScreenMethod::Stochastic(_, StochasticParams { map, .. }) = view.method else { return None };
    let camera = view.guard.camera(&view.camera, view.size.1);
    let size = view.guard.size([view.size.0, view.size.1]);
    let drawn = SideView::draw(&stage.scene, &stage.pose, &camera, size, &side, &map).unwrap();
    let map = bench.map_of(view, 1).unwrap();
    assert_eq!([map.columns(), map.rows()], side.size(size));
    Some(drawn.with_map(map))
}

/// All kinds that can have a second camera, with what their defaults leave out: several drawings, the first surfaces among the others, coarser pictures.
pub(super) fn methods() -> Vec<ScreenMethod> {
    let usual = StochasticParams { second: Some(SideParams::default()), ..StochasticParams::default() };
    let near = SideParams { aside_m: 0.7, covers_from_m: 2.0, coarseness: 2 };
    let coarse = SideParams { aside_m: 3.0, covers_from_m: 1.5, coarseness: 3 };
    let all = [
        usual,
        StochasticParams { map: MapParams::with_samples(16), second: Some(near), ..usual },
        StochasticParams {
            map: MapParams::paper(8),
            looks: Looks::WhereFirstIsFar,
            compensation: 2.0,
            second: Some(coarse),
        },
    ];
    let kinds = [Layered::Ssao(SsaoParams::default()), Layered::Hbao(HbaoParams::hbao_plus())];
    let with = |params| kinds.map(|layered| ScreenMethod::Stochastic(layered, params));
    all.into_iter().flat_map(with).collect()
}

#[test]
fn card_and_twin_agree_over_two_cameras_and_find_more_than_over_one() {
    let stage = still_life();
    let Some(mut bench) = Bench::new(&stage) else { return };
    for camera in cameras() {
        for (size, guard, half_resolution) in cases() {
            for method in methods() {
                let view = ScreenView { camera, size, method, guard, half_resolution };
                let two = check_agreement(&stage, &mut bench, &view);
                let method = method.with_second_camera(None);
                let one = bench.run(&ScreenView { method, ..view });
                // Two steps of a value's sixteen bits.
                assert!(two.iter().zip(&one).all(|(two, one)| *two <= one[0] + 0.001), "{method:?}");
                let more = two.iter().zip(&one).filter(|(two, one)| **two < one[0] - 0.02).count();
                assert!(more * 100 > two.len(), "{method:?}: {more}");
            }
        }
    }
}

#[test]
fn one_submission_holds_pictures_of_several_cameras() {
    let stage = still_life();
    let Some(mut bench) = Bench::new(&stage) else { return };
    let [perspective, parallel] = cameras();
    let elsewhere =
        PosedCamera { projection: perspective.projection, ..look(Vec3::new(-2.0, 1.5, 2.0), Vec3::Y) };
    let method = methods()[1];
    let view = |camera, size| ScreenView {
        camera,
        size,
        method,
        guard: GuardBand::of_height(0.1, 48).unwrap(),
        half_resolution: false,
    };
    let views = [
        view(perspective, (64, 48)),
        view(elsewhere, (64, 48)),
        view(parallel, (64, 48)),
        view(elsewhere, (31, 48)),
    ];
    let apart: Vec<_> = views.iter().map(|view| bench.run(view)).collect();
    assert!(apart[..3].iter().enumerate().all(|(i, one)| !apart[..i].contains(one)));
    let Bench { gpu, pose, scene, forward, passes } = &mut bench;
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let mut pictures = Vec::new();
    for view in &views {
        passes.draw(gpu, &mut encoder, forward, scene, pose, view).unwrap();
        let drawn = passes.picture().unwrap();
        let copy = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: drawn.size(),
            mip_level_count: 1,
            sample_count: 1,
            dimension: drawn.dimension(),
            format: drawn.format(),
            usage: wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        encoder.copy_texture_to_texture(drawn.as_image_copy(), copy.as_image_copy(), copy.size());
        pictures.push(copy);
    }
    gpu.queue.submit([encoder.finish()]);
    for (i, (picture, apart)) in pictures.iter().zip(&apart).enumerate() {
        assert_eq!(bench.read(picture), *apart, "{i}");
    }
}

#[test]
fn second_cameras_that_cannot_be_are_refused() {
    let side = SideParams::default();
    let with = |second| StochasticParams { second: Some(second), ..StochasticParams::default() };
    let hbao = ScreenMethod::Stochastic(Layered::Hbao(HbaoParams::hbao()), with(side));
    assert!(hbao.check().unwrap_err().to_string().contains("mean"));
    let nowhere = with(SideParams { aside_m: 0.0, ..side });
    let nowhere = ScreenMethod::Stochastic(Layered::Hbao(HbaoParams::hbao_plus()), nowhere);
    assert!(nowhere.check().unwrap_err().to_string().contains("aside_m"));
    for kind in ScreenKind::ALL {
        let method = kind.method().with_second_camera(Some(side));
        assert_eq!(method.second_camera(false).is_some(), kind.takes_second_camera(), "{kind:?}");
        assert!(method.check().is_ok(), "{kind:?}");
    }
    let stage = still_life();
    let Some(mut bench) = Bench::new(&stage) else { return };
    let projection = Projection::Perspective { yfov: 3.12, near: 0.1 };
    let camera = PosedCamera { projection, ..cameras()[0] };
    let method = ScreenKind::SdHbaoPlus.method().with_second_camera(Some(side));
    let view =
        ScreenView { camera, size: (16, 12), method, guard: GuardBand::default(), half_resolution: false };
    let Bench { gpu, pose, scene, forward, passes } = &mut bench;
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let error = passes.draw(gpu, &mut encoder, forward, scene, pose, &view).unwrap_err();
    assert!(error.to_string().contains("too wide"), "{error}");
    assert!(passes.picture().is_none());
}
