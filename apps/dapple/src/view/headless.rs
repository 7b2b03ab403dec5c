//! Pictures along the camera path into files, without a window.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Result, bail};
use dapple_gpu::{Gpu, wgpu};

use super::live::Start;
use super::picture;
use super::show::{Opening, Show};
use crate::args::ViewArgs;
use crate::picture::write_png;
use crate::progress::Bar;

/// Writes the pictures that the arguments ask for.
pub(super) fn run(args: &ViewArgs, opening: Opening) -> Result<()> {
    if !(1..=100_000).contains(&args.frames) {
        bail!("--frames is {}, must be 1 to 100000", args.frames);
    }
    if args.seconds.is_some_and(|s| !(s.is_finite() && s >= 0.0)) {
        bail!("--seconds must be 0 or more");
    }
    let folder = args.out.clone().unwrap_or_else(|| PathBuf::from("out/view"));
    let gpu = pollster::block_on(Gpu::headless())?;
    let mut show = Show::new(&gpu, opening, wgpu::TextureFormat::Rgba8Unorm)?;
    show.clock.set_playing(false);
    show.feed.prepare()?;
    if let Some((duration_s, loaded_s)) = show.feed.extent_s() {
        show.clock.set_extent(duration_s, loaded_s);
    }
    if show.feed.remote().is_some() {
        return run_live(args, &gpu, show, &folder);
    }
    let rest_s = (show.clock.duration_s() - args.time).max(0.0);
    let span_s = args.seconds.unwrap_or(rest_s);

    let size = (args.size.width, args.size.height);
    let (mut frame_bytes, mut draw_seconds) = (0, 0.0);
    let mut first_bytes = None;
    for number in 0..args.frames {
        let time_s = args.time + span_s * f64::from(number) / f64::from(args.frames);
        show.clock.seek(time_s);
        let time_s = show.clock.time_s();
        show.look();
        for frame in receive(&mut show, time_s)? {
            frame_bytes += frame.len();
            show.receive(&frame, time_s)?;
        }
        first_bytes.get_or_insert(frame_bytes);
        show.finish_work();
        let start = Instant::now();
        // The clock of the pictures is the scene's.
        let pixels = picture::take(&gpu, &mut show, size, time_s)?;
        draw_seconds += start.elapsed().as_secs_f64();
        if let Some(fault) = gpu.take_fault() {
            return Err(fault.into());
        }
        write_png(&folder.join(format!("frame-{number:03}.png")), size.0, size.1, &pixels)?;
    }
    let stats = show.figures(args.time).viewer;
    let updates = frame_bytes - first_bytes.unwrap_or(0);
    say!(
        "wrote {} pictures of {} to {}: {}, {}, {}; {} points, {} texels, {} bytes to begin with{}; {:.0} ms a picture on {}",
        args.frames,
        args.size,
        folder.display(),
        show.title,
        show.options.method.name(),
        show.options.view.name(),
        stats.points,
        stats.texels,
        first_bytes.unwrap_or(0),
        if args.frames > 1 { format!(", {updates} bytes of updates") } else { String::new() },
        1e3 * draw_seconds / f64::from(args.frames),
        gpu.description()
    );
    Ok(())
}

/// Seconds that a live session may take until there is something to show.
const LIVE_PATIENCE_S: f64 = 60.0;

/// Pictures of a live session, at once and after real seconds.
fn run_live(args: &ViewArgs, gpu: &Gpu, mut show: Show, folder: &std::path::Path) -> Result<()> {
    let size = (args.size.width, args.size.height);
    let span_s = args.seconds.unwrap_or(0.0);
    let start = Instant::now();
    let now_s = || start.elapsed().as_secs_f64();
    let mut first_s = None;
    for number in 0..args.frames {
        let wanted_s = span_s * f64::from(number) / f64::from(args.frames);
        loop {
            let before = Instant::now();
            show.advance(now_s(), &|| before.elapsed().as_secs_f64())?;
            if let Some(reason) = show.ended() {
                bail!("{reason}");
            }
            if show.has_light() {
                show.finish_work();
                let first_s = *first_s.get_or_insert_with(now_s);
                if now_s() - first_s >= wanted_s {
                    break;
                }
            } else if now_s() > LIVE_PATIENCE_S {
                bail!("no light has come within {LIVE_PATIENCE_S} s: {}", show.feed.label());
            }
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        let pixels = picture::take(gpu, &mut show, size, now_s())?;
        if let Some(fault) = gpu.take_fault() {
            return Err(fault.into());
        }
        write_png(&folder.join(format!("frame-{number:03}.png")), size.0, size.1, &pixels)?;
    }
    let figures = show.figures(now_s());
    let live = show.feed.remote().map(|remote| remote.figures());
    say!(
        "wrote {} pictures of {} to {}: {}; {} points, {} bytes, the first light after {:.2} s, visibility {:.0} ms old, {} viewers",
        args.frames,
        args.size,
        folder.display(),
        show.title,
        figures.viewer.points,
        figures.viewer.bytes_received,
        first_s.unwrap_or_default(),
        1e3 * live.as_ref().and_then(|live| live.age_s).unwrap_or_default(),
        live.map_or(0, |live| live.status.viewers),
    );
    Ok(())
}

fn receive(show: &mut Show, time_s: f64) -> Result<Vec<std::sync::Arc<[u8]>>> {
    let bar = Bar::new("light", 1000);
    show.feed.wait_until(time_s, &|start| {
        if let Start::Doing(what, part) = start {
            bar.message(what);
            bar.set((1000.0 * part) as u64);
        }
    })
}
