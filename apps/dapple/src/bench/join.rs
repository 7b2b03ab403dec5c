//! How long the first light takes over a narrow link.

use std::time::Duration;

use anyhow::{Context, Result, bail};
use dapple_session::GuestConfig;
use tokio::sync::watch;

use super::percentile;
use super::served::Served;
use super::shaper;
use super::swarm::Bot;
use crate::args::JoinArgs;
use crate::live::Address;

/// How long one may wait.
const TIMEOUT: Duration = Duration::from_secs(60);

pub(crate) fn run(args: &JoinArgs) -> Result<()> {
    if !(0.0..=10_000.0).contains(&args.delay) || !(1..=1000).contains(&args.times) {
        bail!("--delay must be 0 to 10000 milliseconds, --times 1 to 1000");
    }
    let served = Served::start(&args.served, &[])?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .context("cannot start the viewer's thread")?;
    let (mut seconds, mut bytes, mut points) = (Vec::new(), 0, 0);
    for _ in 0..args.times {
        let (first_s, first_bytes, held) = runtime.block_on(once(&served, args))?;
        seconds.push(first_s);
        (bytes, points) = (first_bytes, held);
    }
    seconds.sort_by(f64::total_cmp);
    let median_s = percentile(&seconds, 0.5);
    say!(
        "the first light over {}bit/s and {} ms there and back: {median_s:.2} s ({:.2} to {:.2} of {}), {:.2} MB for {points} points, \
         {:.2} bytes a point; the link alone takes {:.2} s for these bytes",
        args.link,
        args.delay,
        seconds.first().copied().unwrap_or_default(),
        seconds.last().copied().unwrap_or_default(),
        args.times,
        bytes as f64 * 1e-6,
        bytes as f64 / points.max(1) as f64,
        bytes as f64 * 8.0 / args.link.0 as f64,
    );
    Ok(())
}

async fn once(served: &Served, args: &JoinArgs) -> Result<(f64, u64, usize)> {
    let target = served.url.trim_start_matches("http://").trim_end_matches('/').to_owned();
    let round_trip = Duration::from_secs_f64(args.delay * 1e-3);
    let link = shaper::start(target.clone(), args.link.0 as f64 / 8.0, round_trip).await?;
    let Address::Ws(live) = &served.live else {
        bail!("--moq: the link that this makes narrow is TCP; leave it out");
    };
    let address = Address::Ws(live.replace(&target, &link));
    let (stop, stopped) = watch::channel(false);
    let bot = Bot::new(served, GuestConfig::default(), true);
    let viewing = {
        let bot = bot.clone();
        tokio::spawn(async move { bot.view(&address, stopped).await })
    };
    let wait = async {
        while bot.log().first_s.is_none() {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    let came = tokio::time::timeout(TIMEOUT, wait).await;
    stop.send_replace(true);
    let _ = viewing.await;
    came.with_context(|| format!("no light came within {} s", TIMEOUT.as_secs()))?;
    let log = bot.log();
    if let Some(failure) = log.failures.first() {
        bail!("the light could not be taken: {failure}");
    }
    let points = log.subscriber.as_ref().and_then(|s| s.store()).map_or(0, |store| store.visibility().len());
    Ok((log.first_s.unwrap_or_default(), log.first_bytes, points))
}
