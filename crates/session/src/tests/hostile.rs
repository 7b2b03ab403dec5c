//! What viewers may not do, and that others do not notice.

use std::sync::Arc;

use dapple_scene::{NoFiles, Scene, builtin};

use crate::host::{Access, Arrival, Host, HostConfig, Link, Next, hex};
use crate::{FromViewer, Hello, Look, MAX_FROM_VIEWER_BYTES, PROTOCOL, Reason, Role};

fn scene() -> Arc<Scene> {
    let glb = builtin::glb("cornell", 0.2).unwrap();
    Arc::new(dapple_scene::load("cornell.glb", &glb, &NoFiles).unwrap())
}

fn hello(scene: &Scene) -> Hello {
    Hello {
        protocol: PROTOCOL,
        wire: dapple_stream::codec::VERSION,
        scene: hex(&scene.hash().0),
        ..Hello::default()
    }
}

fn arrival(number: u64) -> Arrival {
    Arrival { key: format!("{number:032x}"), is_reliable: true, is_foreign: false, shares: false, unix_us: 0 }
}

fn join(host: &mut Host, hello: &Hello, number: u64) -> Result<Link, Reason> {
    host.join(hello, arrival(number), 0).map_err(|refusal| refusal.reason)
}

#[test]
fn hellos_that_do_not_fit_are_refused_with_the_reason() {
    let scene = scene();
    let tokens = vec![("s3cret".to_owned(), Role::Interact), ("look".to_owned(), Role::View)];
    let config = HostConfig { access: Access::new(tokens), max_viewers: 2, ..HostConfig::default() };
    let mut host = Host::new(scene.clone(), config, 0);
    let good = Hello { token: Some("look".into()), ..hello(&scene) };
    assert_eq!(join(&mut host, &Hello { protocol: 99, ..good.clone() }, 1), Err(Reason::Version));
    assert_eq!(join(&mut host, &Hello { wire: 1, ..good.clone() }, 1), Err(Reason::Version));
    assert_eq!(join(&mut host, &Hello { scene: "00".into(), ..good.clone() }, 1), Err(Reason::Scene));
    assert_eq!(join(&mut host, &Hello { token: None, ..good.clone() }, 1), Err(Reason::Token));
    assert_eq!(
        join(&mut host, &Hello { token: Some("S3cret".into()), ..good.clone() }, 1),
        Err(Reason::Token)
    );
    let first = join(&mut host, &good, 1).unwrap();
    join(&mut host, &good, 2).unwrap();
    assert_eq!(join(&mut host, &good, 3), Err(Reason::Full));
    // Someone else's key is of no use without it, and one's own takes one's own place.
    let again = Hello { key: Some(format!("{:032x}", 1)), ..good.clone() };
    let second = join(&mut host, &again, 4).unwrap();
    assert_eq!(second.viewer, first.viewer);
    let Next::Close(refusal) = host.next(first, 0) else { panic!("the older connection goes on") };
    assert_eq!(refusal.reason, Reason::Replaced);
    // Who left makes room.
    host.leave(second, 1);
    join(&mut host, &good, 5).unwrap();
    assert_eq!(host.counts().refused, 6);
    host.close();
    assert_eq!(join(&mut host, &good, 6), Err(Reason::Closing));
}

#[test]
fn ten_thousand_connects_leave_no_more_than_may_be_there() {
    let scene = scene();
    let config = HostConfig { max_viewers: 50, ..HostConfig::default() };
    let mut host = Host::new(scene.clone(), config, 0);
    let hello = hello(&scene);
    let quiet = join(&mut host, &hello, 0).unwrap();
    for number in 1..=10_000 {
        if let Ok(link) = join(&mut host, &hello, number)
            && number % 2 == 0
        {
            host.leave(link, number);
        }
    }
    assert!(host.counts().viewers <= 50);
    assert!(matches!(host.next(quiet, 0), Next::Send(_)), "the first one goes on");
}

#[test]
fn messages_that_are_none_end_their_connection_alone() {
    let scene = scene();
    let mut host = Host::new(scene.clone(), HostConfig::default(), 0);
    let quiet = join(&mut host, &hello(&scene), 0).unwrap();
    let huge = format!(r#"{{"type":"look","number":1,"pad":"{}"}}"#, "x".repeat(MAX_FROM_VIEWER_BYTES));
    let deep = format!("{}{}", "[".repeat(8000), "]".repeat(8000));
    let nan = r#"{"type":"look","number":1,"camera":{"eye":[1e39,0,0],"forward":[0,0,-1],"up":[0,1,0],"yfov":1,"aspect":1}}"#;
    let flat = r#"{"type":"look","number":1,"camera":{"eye":[0,0,0],"forward":[0,1,0],"up":[0,1,0],"yfov":1,"aspect":1}}"#;
    let seek = r#"{"type":"event","number":1,"event":{"event":"seek","time_s":-1}}"#;
    let again = FromViewer::Hello(hello(&scene)).to_text();
    let number = r#"{"type":"event","number":-1,"event":{"event":"play"}}"#;
    for (index, text) in [
        "",
        "{}",
        "null",
        "[]",
        "\u{0}",
        r#"{"type":"welcome"}"#,
        r#"{"type":"look"}"#,
        &huge,
        &deep,
        nan,
        flat,
        seek,
        number,
    ]
    .into_iter()
    .enumerate()
    {
        let link = join(&mut host, &hello(&scene), 100 + index as u64).unwrap();
        let refusal = host.receive(link, text, 0).expect_err(text);
        assert_eq!(refusal.reason, Reason::Malformed, "{text:.80}");
        // It has left: what else comes from it is not even read.
        assert_eq!(host.receive(link, "{}", 0), Ok(()));
    }
    assert_eq!(host.counts().viewers, 1);
    // A hello that is said again, because the welcome took its time, changes nothing.
    assert_eq!(host.receive(quiet, &again, 0), Ok(()));
    assert_eq!((host.counts().viewers, host.counts().joined), (1, 14));
    assert_eq!(host.receive(quiet, &FromViewer::Look(Look::default()).to_text(), 0), Ok(()));
}

#[test]
fn events_are_counted_once_and_only_by_those_who_may() {
    let scene = scene();
    let tokens = vec![("touch".to_owned(), Role::Interact)];
    let config = HostConfig { access: Access::new(tokens), events_per_s: 5, ..HostConfig::default() };
    let mut host = Host::new(scene.clone(), config, 0);
    let viewer = join(&mut host, &hello(&scene), 1).unwrap();
    let actor = join(&mut host, &Hello { token: Some("touch".into()), ..hello(&scene) }, 2).unwrap();
    let event = |number: u32| format!(r#"{{"type":"event","number":{number},"event":{{"event":"pause"}}}}"#);
    host.receive(viewer, &event(1), 0).unwrap();
    host.begin_step(1);
    assert_eq!((host.counts().events, host.counts().rejected), (0, 1));
    assert!(host.state().1.playing);
    // Replayed, skipped ahead, and far too many.
    for number in [1, 1, 1, 5, 0, u32::MAX] {
        host.receive(actor, &event(number), 2).unwrap();
    }
    host.begin_step(3);
    assert_eq!(host.counts().events, 1);
    assert!(!host.state().1.playing);
    for number in 2..100 {
        host.receive(actor, &event(number), 4).unwrap();
    }
    host.begin_step(5);
    assert_eq!(host.counts().events, 20, "five a second, four seconds' worth at once");
    // Edits of what is not there, or of sizes that break everything.
    for (number, change) in [
        r#"{"edit":"remove","instance":4000000000}"#,
        r#"{"edit":"place","node":99999,"placement":{"translation":[0,0,0],"rotation":[0,0,0,1],"scale":[1,1,1]}}"#,
        r#"{"edit":"place","node":0,"placement":{"translation":[1e30,0,0],"rotation":[0,0,0,1],"scale":[1,1,1]}}"#,
        r#"{"edit":"place","node":0,"placement":{"translation":[0,0,0],"rotation":[0,0,0,0],"scale":[1,1,1]}}"#,
        r#"{"edit":"light","light":0,"color":[-1,0,0],"intensity":1}"#,
    ]
    .iter()
    .enumerate()
    {
        let before = host.state().0;
        let now_us = 10_000_000 * (number as u64 + 1);
        let number = 100 + number;
        let text = format!(r#"{{"type":"event","number":{number},"event":{{"event":"edit","change":{change}}}}}"#);
        host.receive(actor, &text, now_us).unwrap();
        host.begin_step(now_us);
        assert_eq!(host.state().0, before, "{change}");
    }
}

#[test]
fn who_says_too_much_or_nothing_is_let_go() {
    let scene = scene();
    let config = HostConfig { messages_per_s: 50, silence_us: 10_000_000, ..HostConfig::default() };
    let mut host = Host::new(scene.clone(), config, 0);
    let (loud, silent) =
        (join(&mut host, &hello(&scene), 1).unwrap(), join(&mut host, &hello(&scene), 2).unwrap());
    let look = |number: u64| FromViewer::Look(Look { number, ..Look::default() }).to_text();
    let refused = (0..1000).find_map(|number| host.receive(loud, &look(number), 0).err());
    assert_eq!(refused.unwrap().reason, Reason::TooMany);
    host.begin_step(9_000_000);
    assert!(matches!(host.next(silent, 9_000_000), Next::Send(_)));
    host.begin_step(11_000_000);
    let mut last = host.next(silent, 11_000_000);
    while let Next::Send(_) = last {
        last = host.next(silent, 11_000_000);
    }
    let Next::Close(refusal) = last else { panic!("{last:?}") };
    assert_eq!(refusal.reason, Reason::Silent);
    assert_eq!(host.counts().expelled, 2);
}

#[test]
fn one_who_never_reads_holds_nothing_up() {
    let scene = scene();
    let mut host = Host::new(scene.clone(), HostConfig { silence_us: u64::MAX, ..HostConfig::default() }, 0);
    let link = join(&mut host, &hello(&scene), 1).unwrap();
    // It sends events and takes no answer.
    let mut refusal = None;
    for number in 1..=300u32 {
        let now_us = u64::from(number) * 100_000;
        let text = format!(
            r#"{{"type":"event","number":{number},"event":{{"event":"edit","change":{{"edit":"remove","instance":99999}}}}}}"#
        );
        if host.receive(link, &text, now_us).is_err() {
            break;
        }
        host.begin_step(now_us);
        if number == 300 {
            refusal = Some(host.next(link, now_us));
        }
    }
    assert!(
        matches!(refusal, Some(Next::Close(ref refusal)) if refusal.reason == Reason::TooMany),
        "{refusal:?}"
    );
}
