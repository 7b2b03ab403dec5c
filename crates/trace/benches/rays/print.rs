//! Tables for people and figures for programs.

use serde_json::{Map, Value, json};

use crate::clock::Took;
use crate::measure::{Measured, THREADS};
use crate::moving::Moving;
use crate::tracers::Column;
use crate::{LENGTHS, Length, SceneFigures};

/// The fastest of those that `keeps` accepts.
fn fastest(measured: &[Measured], threads: usize, keeps: impl Fn(Column) -> bool) -> Option<&Measured> {
    let kept = measured.iter().filter(|m| keeps(m.column));
    kept.max_by(|a, b| a.mrays[threads].total_cmp(&b.mrays[threads]))
}

/// Our speed by that of Embree's fastest way.
fn ratio(measured: &[Measured], threads: usize) -> Option<f64> {
    let ours = fastest(measured, threads, |c| c == Column::Ours)?;
    let embree = fastest(measured, threads, Column::is_embree)?;
    Some(ours.mrays[threads] / embree.mrays[threads])
}

fn verdict(length: &Length, ratio: f64) -> String {
    if ratio >= length.goal {
        format!("goal {} met", length.goal)
    } else if ratio >= length.least {
        format!("{} met", length.least)
    } else {
        format!("BELOW {}", length.least)
    }
}

fn dash(value: Option<String>) -> String {
    value.unwrap_or_else(|| "–".to_owned())
}

/// Speed.
pub(crate) fn rays(figures: &[SceneFigures]) {
    println!(
        "\nMillion rays per second of processor time (threads' summed; medians; Embree: fastest flag and quality)"
    );
    for length in LENGTHS {
        println!(
            "  {} rays: {} % of the scene's diagonal; ours ÷ Embree's fastest: at least {}, goal {}",
            length.name,
            length.part * 100.0,
            length.least,
            length.goal
        );
    }
    print!("\n{:<10}{:<6}{:>4}{:>9}", "scene", "rays", "thr", "blocked");
    Column::ALL.iter().for_each(|c| print!("{:>8}", c.title()));
    println!("{:>14}{:>7}  goal", "fastest", "ratio");
    for scene in figures {
        for (length, (_, measured)) in LENGTHS.iter().zip(&scene.lengths) {
            for (t, threads) in THREADS.into_iter().enumerate() {
                let blocked = measured[0].blocked as f64 / scene.rays as f64 * 100.0;
                print!("{:<10}{:<6}{threads:>4}{blocked:>7.1} %", scene.name, length.name);
                for column in Column::ALL {
                    let best = fastest(measured, t, |c| c == column);
                    print!("{:>8}", dash(best.map(|m| format!("{:.2}", m.mrays[t]))));
                }
                let best = fastest(measured, t, Column::is_embree).map(|m| m.name.clone());
                let ratio = ratio(measured, t);
                let (shown, met) = (ratio.map(|r| format!("{r:.2}")), ratio.map(|r| verdict(length, r)));
                println!("{:>14}{:>7}  {}", dash(best), dash(shown), dash(met));
            }
        }
    }
}

/// Above so many disagreements of a million, rounding at edges is no explanation.
const SUSPICIOUS_PER_MILLION: f64 = 200.0;

/// Whose answers differ.
pub(crate) fn disagreements(figures: &[SceneFigures]) {
    println!("\nRays on which others differ from ours (only theirs blocked + only ours blocked)");
    print!("{:<10}{:<6}{:>10}", "scene", "rays", "of");
    let others = &Column::ALL[1..];
    others.iter().for_each(|c| print!("{:>12}", c.title()));
    println!();
    let mut bugs = Vec::new();
    for scene in figures {
        for (length, (_, measured)) in LENGTHS.iter().zip(&scene.lengths) {
            print!("{:<10}{:<6}{:>10}", scene.name, length.name, scene.rays);
            for column in others {
                let of_column = measured.iter().filter(|m| m.column == *column);
                let most = of_column.max_by_key(|m| m.differ[0] + m.differ[1]);
                print!("{:>12}", dash(most.map(|m| format!("{} + {}", m.differ[0], m.differ[1]))));
            }
            println!();
            for m in measured {
                let differ = m.differ[0] + m.differ[1];
                let per_million = differ as f64 / scene.rays as f64 * 1e6;
                let whose = format!("{} {}, {}", scene.name, length.name, m.name);
                if m.changed > 0 {
                    bugs.push(format!("{whose}: {} answers changed between repetitions", m.changed));
                }
                if m.column == Column::OursSingle && differ > 0 {
                    bugs.push(format!("{whose}: differs from occlusion on {differ} rays"));
                } else if per_million > SUSPICIOUS_PER_MILLION {
                    bugs.push(format!("{whose}: differs on {per_million:.0} rays of a million"));
                }
            }
        }
    }
    bugs.iter().for_each(|bug| println!("SUSPICIOUS: {bug}"));
}

/// Building time and memory.
pub(crate) fn builds(figures: &[SceneFigures]) {
    println!("\nBuilding, ms, and bytes per triangle (without vertices and indices that a builder is given)");
    println!(
        "{:<10}{:>10}  {:<14}{:>12}{:>12}{:>14}{:>14}{:>11}{:>11}",
        "scene",
        "triangles",
        "builder",
        "1 thr wall",
        "1 thr cpu",
        "all thr wall",
        "all thr cpu",
        "bytes",
        "most"
    );
    let ms = |t: Option<Took>, pick: fn(&Took) -> f64| dash(t.map(|t| format!("{:.1}", pick(&t) * 1e3)));
    for scene in figures {
        let triangles = scene.mesh.triangles.len();
        for b in &scene.built {
            let per_triangle =
                |bytes: Option<usize>| dash(bytes.map(|b| format!("{:.1}", b as f64 / triangles as f64)));
            println!(
                "{:<10}{:>10}  {:<14}{:>12}{:>12}{:>14}{:>14}{:>11}{:>11}",
                scene.name,
                triangles,
                b.name,
                ms(Some(b.one_thread), |t| t.wall_s),
                ms(Some(b.one_thread), |t| t.cpu_s),
                ms(b.all_threads, |t| t.wall_s),
                ms(b.all_threads, |t| t.cpu_s),
                per_triangle(b.bytes),
                per_triangle(b.most_bytes)
            );
        }
    }
}

/// Frames of moving scenes.
pub(crate) fn moving(moving: &[Moving]) {
    println!("\nA frame of a moving scene, ms of one thread (medians)");
    println!(
        "{:<14}{:>10}{:>10}{:>18}{:>18}",
        "scene", "triangles", "deformed", "pose (skinning)", "update (refit)"
    );
    for m in moving {
        println!(
            "{:<14}{:>10}{:>10}{:>18.3}{:>18.3}",
            m.name, m.triangles, m.deformed, m.pose_ms, m.update_ms
        );
    }
}

/// All of it.
pub(crate) fn json(
    figures: &[SceneFigures],
    moving: &[Moving],
    has_embree: bool,
    robust: bool,
    repetitions: usize,
) -> Value {
    let scenes: Vec<Value> = figures.iter().map(scene_json).collect();
    let moving: Vec<Value> = moving
        .iter()
        .map(|m| {
            json!({
                "scene": m.name, "triangles": m.triangles, "deformed": m.deformed,
                "pose_ms": m.pose_ms, "update_ms": m.update_ms,
            })
        })
        .collect();
    json!({
        "schema": 1, "embree": has_embree, "embree_robust": robust, "repetitions": repetitions,
        "scenes": scenes, "moving": moving,
    })
}

fn scene_json(scene: &SceneFigures) -> Value {
    let took = |t: Took| json!({ "wall_s": t.wall_s, "cpu_s": t.cpu_s });
    let built: Vec<Value> = scene
        .built
        .iter()
        .map(|b| {
            json!({
                "name": b.name, "one_thread": took(b.one_thread), "all_threads": b.all_threads.map(took),
                "bytes": b.bytes, "most_bytes": b.most_bytes,
            })
        })
        .collect();
    let lengths: Vec<Value> = LENGTHS
        .iter()
        .zip(&scene.lengths)
        .map(|(length, (t_max, measured))| {
            let tracers: Map<String, Value> = measured
                .iter()
                .map(|m| {
                    let value = json!({
                        "mrays_per_cpu_s": m.mrays, "blocked": m.blocked,
                        "only_its_blocked": m.differ[0], "only_ours_blocked": m.differ[1],
                    });
                    let prefix = if m.column.is_embree() { "embree " } else { "" };
                    (format!("{prefix}{}", m.name), value)
                })
                .collect();
            let ratios: Vec<Option<f64>> = (0..THREADS.len()).map(|t| ratio(measured, t)).collect();
            json!({
                "rays": length.name, "t_max_m": t_max, "threads": THREADS, "tracers": tracers,
                "ratio_to_embree": ratios, "least": length.least, "goal": length.goal,
            })
        })
        .collect();
    json!({
        "scene": scene.name, "triangles": scene.mesh.triangles.len(), "rays": scene.rays,
        "lengths": lengths, "built": built,
    })
}
