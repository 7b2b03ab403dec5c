//! `dapple view`: a scene and its light in a window, or as pictures without one.

mod feed;
mod fetch;
mod headless;
mod live;
mod overlay;
mod paint;
mod picture;
mod quality;
mod record_path;
mod remote;
mod retries;
mod screen;
mod session;
mod show;
mod steer;
mod window;

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Result, bail};
use dapple_client::viewer::{DrawOptions, Method, ScreenOptions};
use dapple_render::screen_space::ScreenKind;
use dapple_render::sdao::SideParams;

use crate::args::{LightArgs, ViewArgs, ViewMethod};
use crate::live::Address;
use crate::source;

use dapple_session::GuestConfig;
use feed::{Feed, Player};
use quality::Quality;
use remote::Remote;
use session::Outputs;
use show::{Opening, start_server};
use steer::Steering;

/// Updates a second where none are given.
const DEFAULT_HZ: f64 = 15.0;

/// The scene that a folder's viewer.json names, and where its live session is: over MoQ if that is asked for ([`Address::choose`]).
pub(crate) fn fetch_scene(url: &str, moq: Option<&str>) -> Result<(dapple_scene::Scene, Option<Address>)> {
    let fetched = fetch::fetch(url)?;
    Ok((fetched.scene, Address::choose(url, fetched.live, fetched.moq, moq)?))
}

/// Where the session of a folder's viewer.json is over MoQ.
#[cfg(feature = "moq")]
pub(crate) fn fetch_moq(url: &str) -> Result<Option<crate::page::MoqJson>> {
    Ok(fetch::fetch_json(url)?.moq)
}

/// Shows what the arguments name.
pub(crate) fn run(args: &ViewArgs) -> Result<()> {
    check(args)?;
    let opening = open(args)?;
    if args.headless {
        return headless::run(args, opening);
    }
    let screenshots = args.out.clone().unwrap_or_else(|| PathBuf::from("."));
    let outputs = Outputs { screenshots, camera_paths: args.record_path.clone() };
    window::run(opening, args.size, outputs, args.paused, args.time)
}

/// A token in an address, as pages take it.
fn token_of(url: &str) -> Option<String> {
    let query = url.split('#').next()?.split_once('?')?.1;
    query.split('&').find_map(|part| part.strip_prefix("token=")).map(str::to_owned)
}

fn check(args: &ViewArgs) -> Result<()> {
    if !(args.time.is_finite() && args.time >= 0.0) {
        bail!("--time is {}, must be 0 or more seconds", args.time);
    }
    if args.samples.is_some_and(|samples| samples != 1 && samples != 4) {
        bail!("--samples must be 1 or 4");
    }
    if args.split.is_some_and(|part| !(0.0..=1.0).contains(&part)) {
        bail!("--split must be 0 to 1, a part of the width");
    }
    if args.fade.is_some_and(|seconds| !(0.0..=10.0).contains(&seconds)) {
        bail!("--fade must be 0 to 10 seconds");
    }
    if args.fallback.screen_space().is_none() && args.fallback != ViewMethod(Method::None) {
        bail!("--fallback stands in for points: choose a screen-space method (as sao), or none");
    }
    if let Some(aside_m) = args.second_camera {
        if !(aside_m > 0.0 && aside_m.is_finite()) {
            bail!("--second-camera is {aside_m}, must be above 0 metres");
        }
        let shown = [args.method, args.other, args.fallback];
        if !shown.iter().filter_map(|method| method.screen_space()).any(ScreenKind::takes_second_camera) {
            let able: Vec<_> = ScreenKind::ALL.iter().filter(|kind| kind.takes_second_camera()).collect();
            let names: Vec<_> = able.iter().map(|kind| kind.name()).collect();
            bail!("--second-camera needs a map of what is hidden: choose --method {}", names.join(" or "));
        }
    }
    if let Some(file) = &args.record_path {
        if !source::is_path_file(&file.to_string_lossy()) {
            bail!("--record-path {} would hold a camera path: name it .json", file.display());
        }
        if file.exists() {
            bail!("--record-path {}: it exists; choose another name", file.display());
        }
    }
    Ok(())
}

/// Scene, light and camera of the arguments.
fn open(args: &ViewArgs) -> Result<Opening> {
    let quality = Quality::from_args(args);
    let light = LightArgs {
        // Of the preset's, only what is drawn: nothing is sent anywhere.
        preset: None,
        points: Some(quality.points_per_m2),
        hz: Some(args.hz.unwrap_or(DEFAULT_HZ)),
        area_lights: args.area_lights,
        visibility: args.visibility.clone(),
        step: args.step,
    };
    let mut radius_m = None;
    let (scene, title, feed) = match &args.url {
        Some(url) => {
            let fetched = fetch::fetch(url)?;
            let scene = Arc::new(fetched.scene);
            radius_m = fetched.radius_m;
            let live = Address::choose(url, fetched.live, fetched.moq, args.moq.as_deref())?;
            let feed = match (live, fetched.stream) {
                (Some(address), _) => {
                    let bits_per_s = args.step.budget.map(|rate| rate.0);
                    let seed = u64::from(std::process::id());
                    // A picture is taken once there is light, and all of that.
                    let in_parts = !args.headless && bits_per_s.is_none();
                    let address = if in_parts { address.in_parts() } else { address };
                    let config = GuestConfig {
                        token: args.token.clone().or_else(|| token_of(url)),
                        bits_per_s,
                        in_parts,
                        seed,
                        ..GuestConfig::default()
                    };
                    Feed::Remote(Remote::join(address, &scene, config)?)
                }
                (None, Some(pieces)) => Feed::Recorded(Player::incoming(pieces, &scene)),
                (None, None) => Feed::None,
            };
            (scene, fetched.title, feed)
        }
        None => {
            let loaded = source::load(&args.scene, None)?;
            let feed = match &args.stream {
                Some(file) => Feed::Recorded(Player::open(file, &loaded.scene)?),
                None => start_server(&loaded.scene, &light, 0)?,
            };
            (loaded.scene, loaded.title, feed)
        }
    };
    let steering = Steering::new(&scene, args.camera.as_deref(), args.time)?;
    let usual = DrawOptions::default();
    // Pictures in files show updates as they come.
    let fade_s = args.fade.or(if args.headless { Some(0.0) } else { usual.fade_s });
    // The error is that between two methods, side by side or not.
    let other = args.other.0;
    let split = match args.split {
        Some(part) => Some((part, other)),
        None if args.view == crate::args::ViewKind::Error => Some((0.0, other)),
        None => None,
    };
    let effort = args.effort.effort();
    let radius_m = match radius_m {
        Some(radius_m) => radius_m,
        None => source::resolve_radius(&scene, &args.visibility)?.0,
    };
    let options = DrawOptions {
        view: args.view.into(),
        method: args.method.0,
        split,
        fade_s,
        fallback: args.fallback.screen_space(),
        screen: ScreenOptions {
            radius_m,
            guard_band: effort.guard_band,
            preset: effort.preset,
            half_resolution: effort.half_resolution,
            second_camera: args.second_camera.map(|aside_m| SideParams { aside_m, ..SideParams::default() }),
        },
        ..usual
    };
    Ok(Opening { scene, title, feed, steering, options, quality, light })
}
