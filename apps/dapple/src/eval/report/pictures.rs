//! Which pictures go into the page, and their bytes.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::io::Cursor;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{DynamicImage, ExtendedColorType, ImageEncoder, ImageFormat};
use rayon::prelude::*;

use super::island::Shelf;
use super::results::{Case, FrameRow, Results};

/// Bytes of pictures that a page holds; text makes a third more of them. Most browsers and mail servers bear such a file.
pub(super) const BUDGET_BYTES: usize = 40 << 20;

/// Pictures worked on at once.
const BATCH: usize = 64;

/// What went into a page.
#[derive(Debug, Default)]
pub(super) struct Embedded {
    /// One script element a picture, which no browser runs.
    pub(super) elements: String,
    pub(super) same: Vec<(u32, u32)>,
    pub(super) missing: Vec<u32>,
    /// For each case the pictures along its path that are here whole.
    pub(super) frames: Vec<Vec<usize>>,
    /// Pictures that the results name and that are not here for lack of room.
    pub(super) left_out: usize,
}

/// Reads pictures from `folder` until `budget_bytes` are spent: of each case in turn the worst and evenly chosen ones.
pub(super) fn embed(results: &Results, folder: &Path, shelf: &mut Shelf, budget_bytes: usize) -> Embedded {
    let places = order(results);
    // What one moment needs, all methods of it; a picture that two moments share comes with the first.
    let mut wanted = Vec::new();
    let mut seen = BTreeSet::new();
    for &(case, frame) in &places {
        let numbers = names(&results.cases[case], frame).into_iter().filter_map(|name| shelf.number(name));
        wanted.extend(numbers.filter(|number| seen.insert(*number)));
    }
    let mut embedded = Embedded::default();
    let mut here = BTreeSet::new();
    let mut by_bytes: BTreeMap<Vec<u8>, u32> = BTreeMap::new();
    let mut spent = 0;
    'all: for (batch_index, batch) in wanted.chunks(BATCH).enumerate() {
        let read: Vec<Option<Vec<u8>>> = batch
            .par_iter()
            .map(|&number| {
                std::fs::read(folder.join(shelf.name(number))).ok().and_then(|bytes| shrink(&bytes))
            })
            .collect();
        for (index, (&number, bytes)) in batch.iter().zip(read).enumerate() {
            let Some(bytes) = bytes else {
                embedded.missing.push(number);
                continue;
            };
            if let Some(&twin) = by_bytes.get(&bytes) {
                embedded.same.push((number, twin));
            } else if spent + bytes.len() > budget_bytes {
                embedded.left_out = wanted.len() - (batch_index * BATCH + index);
                break 'all;
            } else {
                spent += bytes.len();
                let _ = writeln!(
                    embedded.elements,
                    "<script type=\"text/plain\" id=\"p{number}\">data:{};base64,{}</script>",
                    media_type(&bytes),
                    STANDARD.encode(&bytes)
                );
                by_bytes.insert(bytes, number);
            }
            here.insert(number);
        }
    }
    embedded.frames = vec![Vec::new(); results.cases.len()];
    for (case, frame) in places {
        let numbers: Vec<u32> =
            names(&results.cases[case], frame).into_iter().filter_map(|name| shelf.number(name)).collect();
        if !numbers.is_empty() && numbers.iter().all(|number| here.contains(number)) {
            embedded.frames[case].push(frame);
        }
    }
    embedded.frames.iter_mut().for_each(|frames| frames.sort_unstable());
    embedded
}

/// The pictures of one moment: of the truth and of all methods.
fn names(case: &Case, frame: usize) -> Vec<&str> {
    let truth = case.truth.frames.get(frame).into_iter().flat_map(|f| [&f.beauty, &f.visibility]);
    let rows = case.rows.iter().filter_map(|row| row.frames.get(frame));
    let rows = rows.flat_map(|f| [&f.beauty, &f.visibility, &f.error, &f.flip_map]);
    truth.chain(rows).map(String::as_str).collect()
}

/// Cases and moments, the most wanted first: cases take turns.
fn order(results: &Results) -> Vec<(usize, usize)> {
    let of_cases: Vec<Vec<usize>> = results.cases.iter().map(order_in).collect();
    let longest = of_cases.iter().map(Vec::len).max().unwrap_or(0);
    let turn = |at: usize| {
        of_cases.iter().enumerate().filter_map(move |(case, frames)| Some((case, *frames.get(at)?)))
    };
    (0..longest).flat_map(turn).collect()
}

/// All moments of a case: worst ones and evenly spread ones in turn.
pub(super) fn order_in(case: &Case) -> Vec<usize> {
    let count = case.rows.iter().map(|row| row.frames.len()).max().unwrap_or(0).max(case.truth.frames.len());
    let mut worst = Vec::new();
    let measures: [fn(&FrameRow) -> f64; 2] =
        [|f| f.flip, |f| -f.visibility_psnr_db.unwrap_or(f64::INFINITY)];
    for measure in measures {
        for row in &case.rows {
            let frames = row.frames.iter().enumerate();
            // Of equals the first.
            worst.extend(frames.rev().max_by(|a, b| measure(a.1).total_cmp(&measure(b.1))).map(|(at, _)| at));
        }
    }
    let mut seen = BTreeSet::new();
    let mut worst = worst.into_iter();
    let mut even = spread(count).into_iter();
    let mut order = Vec::with_capacity(count);
    loop {
        let next = [worst.find(|at| !seen.contains(at)), even.find(|at| !seen.contains(at))];
        if next == [None, None] {
            return order;
        }
        order.extend(next.into_iter().flatten().filter(|at| seen.insert(*at)));
    }
}

/// `0 … count` so that any first part is spread evenly: both ends, then middles of what lies between.
pub(super) fn spread(count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = [0, count.saturating_sub(1)].into_iter().take(count).collect();
    let mut gaps = vec![(0, count.saturating_sub(1))];
    while !gaps.is_empty() {
        let mut halves = Vec::new();
        for (first, last) in gaps {
            if last > first + 1 {
                let middle = first.midpoint(last);
                order.push(middle);
                halves.extend([(first, middle), (middle, last)]);
            }
        }
        gaps = halves;
    }
    order
}

/// The same pixels in fewer bytes where there is a way; `None` if they are not a picture.
pub(super) fn shrink(bytes: &[u8]) -> Option<Vec<u8>> {
    let picture = image::load(Cursor::new(bytes), ImageFormat::Png).ok()?;
    let smaller = encode(&picture).filter(|smaller| smaller.len() < bytes.len());
    Some(smaller.unwrap_or_else(|| bytes.to_vec()))
}

/// Lossless WebP; `None` where that cannot hold the picture.
fn encode(picture: &DynamicImage) -> Option<Vec<u8>> {
    let (width, height, color) =
        (picture.width(), picture.height(), ExtendedColorType::from(picture.color()));
    let mut bytes = Vec::new();
    let encoder = image::codecs::webp::WebPEncoder::new_lossless(&mut bytes);
    encoder.write_image(picture.as_bytes(), width, height, color).ok()?;
    Some(bytes)
}

pub(super) fn media_type(bytes: &[u8]) -> &'static str {
    if bytes.starts_with(b"RIFF") { "image/webp" } else { "image/png" }
}
