//! A long run: viewers come, go, break off, stall and move things. In the end all hold the same, nothing was lost, and the server's memory has stayed flat.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use dapple_scene::{Edit, Placement};
use dapple_session::{Event, GuestConfig};
use dapple_trace::sampling::hash;
use tokio::sync::watch;

use super::served::Served;
use super::swarm::Bot;
use crate::args::SoakArgs;
use crate::live::Address;
use crate::progress::Bar;

/// Memory is watched from this part of the time on: before, caches and pools fill.
const WARM: f64 = 0.34;

/// The server may grow by so much an hour, MB, and by so many MB in all.
const MOST_MB_PER_HOUR: f64 = 60.0;
const MOST_MB: f64 = 8.0;

/// How long the last changes may take to reach everyone.
const SETTLE: Duration = Duration::from_secs(20);

pub(crate) fn run(args: &SoakArgs) -> Result<()> {
    if !(args.seconds.is_finite() && args.seconds >= 5.0 && (2..=10_000).contains(&args.viewers)) {
        bail!("--seconds must be at least 5, --viewers 2 to 10000");
    }
    let max_viewers = (4 * args.viewers).to_string();
    let mut served = Served::start(&args.served, &["--max-viewers", &max_viewers])?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .context("cannot start the threads of viewers")?;
    let outcome = runtime.block_on(soak(&mut served, args))?;
    say!(
        "{:.0} s, {} viewers at a time: {} joined, {} broke off, {} stalled, {} events; memory {:.1} to {:.1} MB, slope {:+.2} MB an hour; \
         all hold the same, no event was lost",
        args.seconds,
        args.viewers,
        outcome.joined,
        outcome.broken,
        outcome.stalled,
        outcome.events,
        outcome.memory_mb.0,
        outcome.memory_mb.1,
        outcome.slope_mb_per_hour
    );
    Ok(())
}

struct Outcome {
    joined: u32,
    broken: u32,
    stalled: u32,
    events: u64,
    memory_mb: (f64, f64),
    slope_mb_per_hour: f64,
}

/// One place among the viewers, taken by one after the other.
#[derive(Default, Clone, Copy)]
struct Story {
    joined: u32,
    broken: u32,
    stalled: u32,
    events: u32,
    /// Where it put its node last.
    last: Option<(u32, Placement)>,
}

async fn soak(served: &mut Served, args: &SoakArgs) -> Result<Outcome> {
    let until = Instant::now() + Duration::from_secs_f64(args.seconds);
    let (stop, stopped) = watch::channel(false);
    // These two stay throughout: what they hold in the end is what was published.
    let keepers: Vec<Arc<Bot>> = (0..2).map(|seed| Bot::new(served, config(seed), true)).collect();
    let mut tasks = Vec::new();
    for bot in &keepers {
        let (bot, address, stopped) = (bot.clone(), served.live.clone(), stopped.clone());
        tasks.push(tokio::spawn(async move { bot.view(&address, stopped).await }));
    }
    let mut places = Vec::new();
    for place in 0..args.viewers - 2 {
        let random = Random { seed: args.seed, place: u64::from(place), number: 0 };
        let live = (served.live.clone(), served.scene.clone(), served.url.clone());
        places.push(tokio::spawn(live_on(live, place, random, until)));
    }
    let mut samples = Vec::new();
    let bar = Bar::new("soaking", args.seconds.ceil() as u64);
    let start = Instant::now();
    while Instant::now() < until {
        tokio::time::sleep(Duration::from_millis(500)).await;
        if !served.is_running() {
            bail!("the server has ended after {:.0} s", start.elapsed().as_secs_f64());
        }
        samples.push((start.elapsed().as_secs_f64(), served.process()?.1 as f64 * 1e-6));
        bar.set(start.elapsed().as_secs());
    }
    drop(bar);
    let mut story = Story::default();
    let mut last = Vec::new();
    for place in places {
        let part = place.await.context("a viewer ended in a panic")??;
        last.extend(part.last);
        story = Story {
            last: None,
            joined: story.joined + part.joined,
            broken: story.broken + part.broken,
            stalled: story.stalled + part.stalled,
            events: story.events + part.events,
        };
    }
    settle(&keepers).await?;
    check(served, &keepers, &story, &last)?;
    stop.send_replace(true);
    for task in tasks {
        task.await.context("a viewer ended in a panic")?;
    }
    let warm: Vec<(f64, f64)> =
        samples.iter().copied().filter(|(time, _)| *time >= WARM * args.seconds).collect();
    let slope_mb_per_hour = 3600.0 * slope(&warm);
    let memory_mb = (warm.first().map_or(0.0, |s| s.1), warm.last().map_or(0.0, |s| s.1));
    // In a short run a page more or less is a steep slope.
    if slope_mb_per_hour > MOST_MB_PER_HOUR && memory_mb.1 - memory_mb.0 > MOST_MB {
        bail!(
            "the server's memory grows: {:.1} to {:.1} MB, {slope_mb_per_hour:.1} MB an hour",
            memory_mb.0,
            memory_mb.1
        );
    }
    let events = u64::from(story.events);
    Ok(Outcome {
        joined: story.joined,
        broken: story.broken,
        stalled: story.stalled,
        events,
        memory_mb,
        slope_mb_per_hour,
    })
}

fn config(seed: u64) -> GuestConfig {
    GuestConfig { seed, ..GuestConfig::default() }
}

/// Viewers in one place, one after the other, until the time is over. Every event of theirs is answered before they go.
async fn live_on(
    (address, scene, url): (Address, Arc<dapple_scene::Scene>, String),
    place: u32,
    mut random: Random,
    until: Instant,
) -> Result<Story> {
    let served = Served::attached(url, address.clone(), scene.clone());
    let mut story = Story::default();
    while Instant::now() < until {
        story.joined += 1;
        let bot = Bot::new(&served, config(random.bits()), random.below(4) == 0);
        let (stop, stopped) = watch::channel(false);
        let mut viewing = Box::pin(bot.view(&address, stopped.clone()));
        for _ in 0..1 + random.below(6) {
            let left = until.saturating_duration_since(Instant::now());
            let stay = Duration::from_millis(200 + random.below(3000)).min(left);
            match random.below(8) {
                // It goes on where it was, over another connection.
                0 => {
                    story.broken += 1;
                    drop(viewing);
                    bot.shared.lock().disconnected();
                    tokio::time::sleep(stay / 4).await;
                    viewing = Box::pin(bot.view(&address, stopped.clone()));
                }
                // It reads nothing for a while.
                1 => {
                    story.stalled += 1;
                    tokio::time::sleep(2 * stay).await;
                }
                2..5 => {
                    let count = 1 + random.below(10) as u32;
                    for _ in 0..count {
                        let (node, placement) = movement(&scene, place, story.events);
                        let event = Event::Edit { change: Edit::Place { node, placement } };
                        if bot.shared.lock().send(event) {
                            story.events += 1;
                            story.last = Some((node, placement));
                            let _ = tokio::time::timeout(Duration::from_millis(40), &mut viewing).await;
                        }
                    }
                }
                _ => drop(tokio::time::timeout(stay, &mut viewing).await),
            }
        }
        // What was asked for must be answered, however the connection fares.
        let answered = async {
            while bot.shared.lock().has_pending() {
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        };
        tokio::select! {
            () = &mut viewing => bail!("a session ended for good: {:?}", *bot.state.borrow()),
            answered = tokio::time::timeout(SETTLE, answered) => {
                if answered.is_err() {
                    bail!("an event was not answered within {} s", SETTLE.as_secs());
                }
            }
        }
        {
            let log = bot.log();
            if let Some(failure) = log.failures.first() {
                bail!("a viewer could not take {} frames: {failure}", log.failures.len());
            }
        }
        if random.below(2) == 0 {
            stop.send_replace(true);
            let _ = tokio::time::timeout(Duration::from_secs(5), &mut viewing).await;
        }
    }
    Ok(story)
}

/// An instance's node goes a little further each time.
fn movement(scene: &dapple_scene::Scene, place: u32, number: u32) -> (u32, Placement) {
    let instance = &scene.instances[place as usize % scene.instances.len()];
    let placement = Placement {
        translation: [0.01 * (number % 100) as f32, 0.5, 0.1 * (place % 20) as f32],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: [1.0; 3],
    };
    (instance.node, placement)
}

/// Waits until those who stayed hold the same, while time stands still.
async fn settle(keepers: &[Arc<Bot>]) -> Result<()> {
    keepers[0].shared.lock().send(Event::Pause);
    let start = Instant::now();
    let mut equal_since = None;
    loop {
        tokio::time::sleep(Duration::from_millis(100)).await;
        let held: Vec<_> = keepers
            .iter()
            .map(|bot| {
                // In the order in which they are taken where messages come in.
                let guest = bot.shared.lock();
                let log = bot.log();
                let subscriber = log.subscriber.as_ref();
                let light =
                    subscriber.and_then(|s| Some((s.group()?, s.epoch()?, s.store()?.visibility().to_vec())));
                (guest.version(), guest.clock(), guest.edits().clone(), guest.has_pending(), light)
            })
            .collect();
        let is_still = held.windows(2).all(|pair| pair[0] == pair[1])
            && held[0].4.is_some()
            && !held[0].3
            && !held[0].1.playing;
        match (is_still, equal_since) {
            // A second without news is rest.
            (true, Some(since)) if Instant::now() - since > Duration::from_secs(1) => return Ok(()),
            (true, None) => equal_since = Some(Instant::now()),
            (true, Some(_)) => {}
            (false, _) => equal_since = None,
        }
        if start.elapsed() > SETTLE {
            bail!("{} s after the last event viewers hold different things", SETTLE.as_secs());
        }
    }
}

/// Everyone heard everything, and the server counted what was sent.
fn check(served: &Served, keepers: &[Arc<Bot>], story: &Story, last: &[(u32, Placement)]) -> Result<()> {
    let edits = keepers[0].shared.lock().edits().clone();
    for (node, placement) in last {
        // Who shares a node with another place may have been overtaken.
        let is_alone = last.iter().filter(|(other, _)| other == node).count() == 1;
        if is_alone && edits.placed.get(node) != Some(placement) {
            bail!("node {node} was put to {placement:?} and stands at {:?}", edits.placed.get(node));
        }
    }
    for bot in keepers {
        if let Some(failure) = bot.log().failures.first() {
            bail!("a viewer that stayed could not take a frame: {failure}");
        }
    }
    let metrics = served.get("metrics")?;
    let (taken, rejected) = (
        served.figure(&metrics, "dapple_events_total"),
        served.figure(&metrics, "dapple_events_rejected_total"),
    );
    // The pause at the end is one more. Of a drag that waits only the end is sent.
    let most = f64::from(story.events) + 1.0;
    if taken + rejected > most || rejected > 0.0 {
        bail!("of {} events the server took {taken} and rejected {rejected}", story.events);
    }
    Ok(())
}

/// Least squares.
fn slope(samples: &[(f64, f64)]) -> f64 {
    let count = samples.len().max(1) as f64;
    let mean = samples.iter().fold((0.0, 0.0), |sum, s| (sum.0 + s.0 / count, sum.1 + s.1 / count));
    let (above, below) = samples.iter().fold((0.0, 0.0), |(above, below), (time, value)| {
        (above + (time - mean.0) * (value - mean.1), below + (time - mean.0) * (time - mean.0))
    });
    if below > 0.0 { above / below } else { 0.0 }
}

/// Numbers of a seed and a place, one after the other.
struct Random {
    seed: u64,
    place: u64,
    number: u32,
}

impl Random {
    fn bits(&mut self) -> u64 {
        self.number = self.number.wrapping_add(1);
        u64::from(hash(self.seed, self.place, self.number))
    }

    fn below(&mut self, n: u64) -> u64 {
        self.bits() % n.max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_found() {
        let line: Vec<(f64, f64)> = (0..50).map(|i| (f64::from(i), 3.0 + 0.5 * f64::from(i))).collect();
        assert!((slope(&line) - 0.5).abs() < 1e-12);
        assert_eq!(slope(&[]), 0.0);
        assert_eq!(slope(&[(1.0, 2.0)]), 0.0);
    }
}
