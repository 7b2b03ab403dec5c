//! `dapple render`: one picture.

use anyhow::{Result, bail};
use dapple_client::{Client, Drawn, PictureParams, Reconstruction, draw};
use dapple_render::compose::{
    ErrorKind, NormalSpace, PointsView, ResolvedPlane, draw_points, resolve_plane, view_error,
};
use dapple_render::compose::{view_normals, view_visibility};
use dapple_render::image::{LinearImage, Rgb8Image, ToneMap};
use dapple_render::psao::{Hat, Kernel};
use dapple_render::shade::{Gathering, Openings, ShadeParams, shade_gathered};
use dapple_scene::PosedCamera;
use dapple_scene::glam::Vec3;
use dapple_server::{Progress, Server, ServerConfig};
use dapple_stream::Limits;
use dapple_trace::Tracer;
use dapple_trace::psao::generate::GenerateParams;
use dapple_trace::psao::update::UpdateParams;
use dapple_trace::rtao::{RtaoParams, trace_visibility_with_progress};

use crate::args::{RenderArgs, RenderMethod, View};
use crate::direct_light;
use crate::direct_light::picture::{DirectLight, Lighting, read_environment};
use crate::exr_file::{write_gray, write_rgb};
use crate::light::{adaptive, publish};
use crate::picture::{open_directions, sites, write_png};
use crate::progress::Bar;
use crate::screen_space::Sight;
use crate::source::{self, Loaded};

/// Renders what the arguments ask for and writes it.
pub(crate) fn run(args: &RenderArgs) -> Result<()> {
    check(args)?;
    let loaded = source::load(&args.scene, None)?;
    let scene = &loaded.scene;
    let camera = source::find_camera(scene, args.camera.as_deref(), args.time)?;
    let params = PictureParams {
        width: args.size.width,
        height: args.size.height,
        supersample: args.supersample,
        shade: shade_params(args),
    };
    let environment = args.direct.environment.as_deref().map(read_environment).transpose()?;
    let wheel = Bar::spinner("drawing");
    let mut drawn = draw(scene, &camera, args.time, &params)?;
    drop(wheel);
    if let Some(DirectLight(technique)) = args.direct.direct_light {
        let lighting = Lighting {
            technique,
            steps: args.direct.light_steps,
            cones_mib: args.direct.light_memory,
            environment: environment.as_ref(),
        };
        direct_light::picture::add(&lighting, scene, &camera, args.time, &mut drawn)?;
    }
    let (path, width, height) = (&args.output, drawn.gbuffer.width, drawn.gbuffer.height);
    match numbers(args, &loaded, &drawn, &camera)? {
        Some(Numbers::Rgb(pixels)) => write_rgb(path, width, height, &pixels)?,
        Some(Numbers::Gray(values)) => write_gray(path, width, height, &values)?,
        None => write_png(path, width, height, &picture(args, &loaded, &drawn, &camera)?.pixels)?,
    }
    say!("wrote {}", path.display());
    Ok(())
}

/// How the picture is shaded: with lights that have an area, no sun is made up.
fn shade_params(args: &RenderArgs) -> ShadeParams {
    ShadeParams { sun_without_lights: args.direct.direct_light.is_none(), ..ShadeParams::default() }
}

/// What an EXR holds.
enum Numbers {
    Rgb(Vec<Vec3>),
    Gray(Vec<f32>),
}

fn is_exr(args: &RenderArgs) -> bool {
    args.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"))
}

/// The picture as 8-bit colours.
fn picture(args: &RenderArgs, loaded: &Loaded, drawn: &Drawn, camera: &PosedCamera) -> Result<Rgb8Image> {
    Ok(match args.view {
        View::Normal => view_normals(&drawn.gbuffer, &loaded.scene, &drawn.pose, NormalSpace::World),
        View::Points => points_view(args, loaded, drawn, camera)?,
        View::Beauty => radiance(args, loaded, drawn, camera)?.to_rgb8(&ToneMap::default()),
        View::Visibility => {
            let visibility = visibility(args, args.method, loaded, drawn, camera)?;
            view_visibility(&drawn.gbuffer, &visibility.unwrap_or_else(|| open(drawn)))?
        }
        View::Error => {
            let [truth, test] = truth_and_test(args, loaded, drawn, camera)?;
            view_error(&truth.values, &test.values, &truth.coverage, ErrorKind::Signed)?
        }
    })
}

/// The numbers behind the picture, if those are asked for: radiance, visibility (1 where there is nothing), normals in the
/// world (0 where there is nothing), or how much visibility is too high.
fn numbers(
    args: &RenderArgs,
    loaded: &Loaded,
    drawn: &Drawn,
    camera: &PosedCamera,
) -> Result<Option<Numbers>> {
    if !is_exr(args) {
        return Ok(None);
    }
    Ok(Some(match args.view {
        View::Beauty => Numbers::Rgb(radiance(args, loaded, drawn, camera)?.pixels),
        View::Visibility => {
            let visibility =
                visibility(args, args.method, loaded, drawn, camera)?.unwrap_or_else(|| open(drawn));
            Numbers::Gray(resolve_plane(&drawn.gbuffer, &visibility, 1.0)?.values.values)
        }
        View::Normal => {
            let normals = drawn.gbuffer.map_surfaces(&loaded.scene, &drawn.pose, |_, surface| {
                surface.map_or(Vec3::ZERO, |s| s.normal_shading_world)
            });
            let scale = 1.0 / (args.supersample * args.supersample) as f32;
            let sum = |samples: &mut dyn Iterator<Item = usize>| {
                samples.fold(Vec3::ZERO, |sum, i| sum + normals[i])
            };
            Numbers::Rgb(drawn.gbuffer.map_pixels(|samples| sum(samples) * scale))
        }
        View::Error => {
            let [truth, test] = truth_and_test(args, loaded, drawn, camera)?;
            let pairs = test.values.values.iter().zip(&truth.values.values);
            Numbers::Gray(pairs.map(|(test, truth)| test - truth).collect())
        }
        // Refused by `check`.
        View::Points => return Ok(None),
    }))
}

/// Visibility by rays at every pixel, and by the method.
fn truth_and_test(
    args: &RenderArgs,
    loaded: &Loaded,
    drawn: &Drawn,
    camera: &PosedCamera,
) -> Result<[ResolvedPlane; 2]> {
    let truth = visibility(args, RenderMethod::Rtao, loaded, drawn, camera)?.unwrap_or_else(|| open(drawn));
    let test = visibility(args, args.method, loaded, drawn, camera)?.unwrap_or_else(|| open(drawn));
    Ok([resolve_plane(&drawn.gbuffer, &truth, 1.0)?, resolve_plane(&drawn.gbuffer, &test, 1.0)?])
}

fn check(args: &RenderArgs) -> Result<()> {
    if !(1..=65536).contains(&args.rays) {
        bail!("--rays is {}, must be 1 to 65536", args.rays);
    }
    let extension = args.output.extension().unwrap_or_default();
    if !extension.eq_ignore_ascii_case("png") && !is_exr(args) && !extension.is_empty() {
        bail!("{} would hold a picture: name it .png or .exr", args.output.display());
    }
    if args.view == View::Points && is_exr(args) {
        bail!("--view points is a picture of discs: write it to a .png");
    }
    let takes_bent = match args.method {
        RenderMethod::Psao | RenderMethod::Rtao => true,
        RenderMethod::Screen(method) => method.can_bend(),
        RenderMethod::PsaoHat | RenderMethod::None => false,
    };
    if args.visibility.bent_normals && !takes_bent {
        bail!(
            "--bent-normals changes pictures of --method psao, rtao, hbao, hbao-plus and these two with hidden surfaces (as sd-hbao-plus) alone: \
             choose one of them, or leave it out"
        );
    }
    if !(1..=10_000).contains(&args.direct.light_steps) {
        bail!("--light-steps is {}, must be 1 to 10000", args.direct.light_steps);
    }
    if !(1..=1 << 20).contains(&args.direct.light_memory) {
        bail!("--light-memory is {}, must be 1 to 1048576 MiB", args.direct.light_memory);
    }
    if !args.time.is_finite() {
        bail!("--time must be a finite number of seconds");
    }
    if args.view == View::Error && args.method == RenderMethod::Rtao {
        bail!(
            "--view error compares a method with rtao: choose --method psao, psao-hat, a screen-space one (as ssao) or none"
        );
    }
    Ok(())
}

fn open(drawn: &Drawn) -> Vec<f32> {
    vec![1.0; drawn.gbuffer.samples().len()]
}

/// The picture before tone mapping. With bent normals ambient light is gathered from where it comes: from about those of the points, or, by
/// rays and by horizons, from the directions that they find open.
fn radiance(args: &RenderArgs, loaded: &Loaded, drawn: &Drawn, camera: &PosedCamera) -> Result<LinearImage> {
    let bent = args.visibility.bent_normals;
    match args.method {
        RenderMethod::Psao if bent => {
            let (_, client) = light(args, loaded)?;
            let visibility = client.visibility(drawn, &Reconstruction::Atlas);
            let ambient = client.ambient(drawn, camera, &ShadeParams::default(), &visibility);
            Ok(drawn.compose_with(ambient.as_deref(), Some(&visibility))?)
        }
        RenderMethod::Rtao if bent => {
            let visibility = traced(args, loaded, drawn)?;
            let (indices, sites) = sites(&loaded.scene, drawn);
            let tracer = Tracer::new(&loaded.scene, &drawn.pose);
            let open_world = open_directions(drawn, &tracer, (&indices, &sites), &rtao(args, loaded)?);
            let ambient = gathered(loaded, drawn, camera, &visibility, &open_world);
            Ok(drawn.compose_with(Some(&ambient), Some(&visibility))?)
        }
        RenderMethod::Screen(method) if bent => {
            let (sight, effort) = (sight(args, loaded, drawn, camera)?, args.effort.effort());
            let Some((open, open_world)) = method.bent(&sight, effort)? else {
                bail!("{} has no bent normals", method.name())
            };
            // How much light comes is what it is without bent normals; they say from where.
            let ambient = gathered(loaded, drawn, camera, &open, &open_world);
            let visibility = method.estimate(&sight, effort)?.visibility;
            Ok(drawn.compose_with(Some(&ambient), Some(&visibility))?)
        }
        method => Ok(drawn.compose(visibility(args, method, loaded, drawn, camera)?.as_deref())?),
    }
}

/// Ambient light of samples from where they are open, as if all of it came.
fn gathered(
    loaded: &Loaded,
    drawn: &Drawn,
    camera: &PosedCamera,
    visibility: &[f32],
    open_world: &[Vec3],
) -> Vec<Vec3> {
    let gathering = Gathering { visibility, openings: Openings::Traced(open_world) };
    let shade = ShadeParams::default();
    shade_gathered(&loaded.scene, &drawn.pose, camera, &drawn.gbuffer, &shade, gathering)
}

/// One visibility a sample; `None` for no occlusion.
fn visibility(
    args: &RenderArgs,
    method: RenderMethod,
    loaded: &Loaded,
    drawn: &Drawn,
    camera: &PosedCamera,
) -> Result<Option<Vec<f32>>> {
    let reconstruction = match method {
        RenderMethod::None => return Ok(None),
        RenderMethod::Rtao => return Ok(Some(traced(args, loaded, drawn)?)),
        RenderMethod::PsaoHat => Kernel::Hat(Hat::default()).into(),
        RenderMethod::Screen(method) => {
            let sight = sight(args, loaded, drawn, camera)?;
            return Ok(Some(method.estimate(&sight, args.effort.effort())?.visibility));
        }
        RenderMethod::Psao => Reconstruction::Atlas,
    };
    let (_, client) = light(args, loaded)?;
    Ok(Some(client.visibility(drawn, &reconstruction)))
}

/// The rays of a sample.
fn rtao(args: &RenderArgs, loaded: &Loaded) -> Result<RtaoParams> {
    let (radius_m, _) = source::resolve_radius(&loaded.scene, &args.visibility)?;
    let rays = args.rays.div_ceil(args.supersample * args.supersample);
    Ok(RtaoParams { rays, radius_m, seed: u64::from(args.visibility.seed) })
}

fn traced(args: &RenderArgs, loaded: &Loaded, drawn: &Drawn) -> Result<Vec<f32>> {
    let tracer = Tracer::new(&loaded.scene, &drawn.pose);
    let (indices, sites) = sites(&loaded.scene, drawn);
    let params = rtao(args, loaded)?;
    let mut traced = vec![1.0; sites.len()];
    let bar = Bar::new("rays", sites.len() as u64);
    trace_visibility_with_progress(&tracer, &sites, &params, &mut traced, &|done| bar.set(done));
    let mut visibility = open(drawn);
    for (index, value) in indices.into_iter().zip(traced) {
        visibility[index] = value;
    }
    Ok(visibility)
}

/// What screen-space methods look at.
fn sight<'a>(
    args: &RenderArgs,
    loaded: &'a Loaded,
    drawn: &'a Drawn,
    camera: &'a PosedCamera,
) -> Result<Sight<'a>> {
    let (radius_m, _) = source::resolve_radius(&loaded.scene, &args.visibility)?;
    let (scene, pose, gbuffer) = (&*loaded.scene, &drawn.pose, &drawn.gbuffer);
    Ok(Sight { scene, pose, camera, gbuffer, radius_m, seed: args.visibility.seed })
}

/// A server brought to the picture's time, and a client that has joined it.
fn light(args: &RenderArgs, loaded: &Loaded) -> Result<(Server, Client)> {
    let scene = &loaded.scene;
    let (radius_m, density_factor) = source::resolve_radius(scene, &args.visibility)?;
    let config = ServerConfig {
        generate: GenerateParams {
            points_per_m2: args.points * density_factor,
            seed: args.visibility.seed,
            adaptive: adaptive(&args.visibility)?,
            radius_m,
            ..GenerateParams::default()
        },
        update: UpdateParams {
            rays: args.visibility.point_rays,
            radius_m,
            bent_normals: args.visibility.bent_normals,
            ..UpdateParams::default()
        },
        publish: publish(args.visibility.threshold),
        ..ServerConfig::default()
    };
    let bar = Bar::new("points", 1000);
    let mut server = Server::new(scene.clone(), &config, &|progress| match progress {
        Progress::Laying(done, of) => bar.set((done * 400 / of.max(1)) as u64),
        Progress::Tracing(done, of) => bar.set((400 + done * 500 / of.max(1)) as u64),
        Progress::Cutting(done, of) => bar.set((900 + done * 100 / of.max(1)) as u64),
    })?;
    server.step(args.time)?;
    let mut client = Client::new(scene.clone(), Limits::default());
    if let Some(frame) = server.join()? {
        client.receive(&frame.bytes)?;
    }
    Ok((server, client))
}

fn points_view(args: &RenderArgs, loaded: &Loaded, drawn: &Drawn, camera: &PosedCamera) -> Result<Rgb8Image> {
    if !matches!(args.method, RenderMethod::Psao | RenderMethod::PsaoHat) {
        bail!("--view points shows the points of --method psao or psao-hat");
    }
    let (server, _) = light(args, loaded)?;
    let placed = server.positions_world(&drawn.pose).into_iter().zip(server.store().visibility());
    let (positions, values): (Vec<_>, Vec<f32>) =
        placed.filter_map(|(position, &value)| Some((position?, f32::from(value) / 255.0))).unzip();
    let picture = drawn.compose(None)?.to_rgb8(&ToneMap::default());
    Ok(draw_points(&picture, &drawn.gbuffer, camera, &positions, &values, &PointsView::default())?)
}
