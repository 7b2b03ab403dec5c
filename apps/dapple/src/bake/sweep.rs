//! Keeps the file from growing by what nothing reads any more: accessors whose elements were copied elsewhere are replaced in
//! their place, and bytes that lost their last reader are left out.

use std::collections::BTreeSet;

use anyhow::Result;

use super::document::{BIN, Document, List};
use super::json::Object;

/// Extensions that name neither accessors nor buffer views, but by ways that are known here. `KHR_materials_` are such, too.
const KNOWN: [&str; 12] = [
    "EXT_texture_avif",
    "EXT_texture_webp",
    "EXT_meshopt_compression",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "MSFT_texture_dds",
];

const DRACO: &str = "KHR_draco_mesh_compression";

/// How often each accessor of a document is named; `None` if an extension could name more.
pub(crate) fn accessor_users(document: &Document) -> Result<Option<Vec<u32>>> {
    let used: Vec<String> = document.root().read("extensionsUsed")?.unwrap_or_default();
    if !used.iter().all(|name| KNOWN.contains(&name.as_str()) || name.starts_with("KHR_materials_")) {
        return Ok(None);
    }
    let mut users = vec![0; document.len(List::Accessors)];
    let mut count = |accessor: Option<usize>| {
        if let Some(users) = accessor.and_then(|accessor| users.get_mut(accessor)) {
            *users += 1;
        }
    };
    for mesh in 0..document.len(List::Meshes) {
        for primitive in document.object(List::Meshes, mesh)?.list("primitives")? {
            let primitive = Object::parse(&primitive)?;
            count(primitive.whole("indices")?);
            let targets = primitive.list("targets")?;
            let targets = targets.iter().map(|target| Object::parse(target));
            for attributes in std::iter::once(primitive.object("attributes")).chain(targets) {
                let attributes = attributes?;
                for key in attributes.keys() {
                    count(attributes.whole(key)?);
                }
            }
        }
    }
    for skin in document.root().list("skins")? {
        count(Object::parse(&skin)?.whole("inverseBindMatrices")?);
    }
    for animation in document.root().list("animations")? {
        for sampler in Object::parse(&animation)?.list("samplers")? {
            let sampler = Object::parse(&sampler)?;
            count(sampler.whole("input")?);
            count(sampler.whole("output")?);
        }
    }
    Ok(Some(users))
}

/// The buffer views that something names.
pub(crate) fn views_in_use(document: &Document) -> Result<BTreeSet<usize>> {
    let mut used = BTreeSet::new();
    for index in 0..document.len(List::Accessors) {
        let accessor = document.object(List::Accessors, index)?;
        used.extend(accessor.whole("bufferView")?);
        let sparse = accessor.object("sparse")?;
        used.extend(sparse.object("indices")?.whole("bufferView")?);
        used.extend(sparse.object("values")?.whole("bufferView")?);
    }
    for index in 0..document.len(List::Images) {
        used.extend(document.object(List::Images, index)?.whole("bufferView")?);
    }
    for mesh in 0..document.len(List::Meshes) {
        for primitive in document.object(List::Meshes, mesh)?.list("primitives")? {
            let draco = Object::parse(&primitive)?.object("extensions")?.object(DRACO)?;
            used.extend(draco.whole("bufferView")?);
        }
    }
    Ok(used)
}

/// Leaves out the views of `before` that nothing names now, and the bytes that only they had. Accessors that lost their users
/// keep their place in the list, but no bytes. Expects that all references are known ([`accessor_users`]).
pub(crate) fn sweep(document: &mut Document, before: &BTreeSet<usize>, users: &[u32]) -> Result<()> {
    let users_now = accessor_users(document)?.unwrap_or_default();
    for index in (0..users.len()).filter(|&i| users[i] > 0 && users_now.get(i) == Some(&0)) {
        let mut accessor = document.object(List::Accessors, index)?;
        for key in ["bufferView", "byteOffset", "sparse", "min", "max"] {
            accessor.remove(key);
        }
        document.put(List::Accessors, index, &accessor)?;
    }
    let now = views_in_use(document)?;
    let lost: BTreeSet<usize> = before.difference(&now).copied().collect();
    if lost.is_empty() {
        return Ok(());
    }
    let removed = removed_ranges(document, &lost)?;
    let mut bin = Vec::with_capacity(document.bin.len());
    let mut end = 0;
    for &(from, to) in &removed {
        bin.extend_from_slice(&document.bin[end..from]);
        end = to;
    }
    bin.extend_from_slice(&document.bin[end..]);
    document.bin = bin;

    let views = document.take(List::BufferViews);
    let mut new_index = vec![0; views.len()];
    for (index, raw) in views.iter().enumerate().filter(|(index, _)| !lost.contains(index)) {
        let mut view = Object::parse(raw)?;
        shift(&mut view, &removed)?;
        let mut extensions = view.object("extensions")?;
        for key in super::gather::COMPRESSED_VIEWS {
            let mut compressed = extensions.object(key)?;
            if !compressed.is_empty() && shift(&mut compressed, &removed)? {
                extensions.set(key, &compressed)?;
                view.set("extensions", &extensions)?;
            }
        }
        new_index[index] = document.push(List::BufferViews, &view)?;
    }
    renumber(document, &new_index)
}

/// Ranges of bytes, ascending, that only lost views had; in steps of 16, so that what follows stays aligned.
fn removed_ranges(document: &Document, lost: &BTreeSet<usize>) -> Result<Vec<(usize, usize)>> {
    let (mut gone, mut kept) = (Vec::new(), Vec::new());
    for index in 0..document.len(List::BufferViews) {
        let view = document.object(List::BufferViews, index)?;
        let mut ranges: Vec<(usize, usize)> = range_of(&view)?.into_iter().collect();
        for key in super::gather::COMPRESSED_VIEWS {
            ranges.extend(range_of(&view.object("extensions")?.object(key)?)?);
        }
        if lost.contains(&index) { gone.extend(ranges) } else { kept.extend(ranges) }
    }
    gone.sort_unstable();
    kept.sort_unstable();
    let mut removed: Vec<(usize, usize)> = Vec::new();
    let mut next_kept = kept.into_iter().peekable();
    // How far what is kept reaches so far.
    let mut kept_end = 0;
    for (from, to) in gone {
        let mut from = from.max(removed.last().map_or(0, |&(_, end)| end));
        while from < to {
            while let Some(&(start, end)) = next_kept.peek().filter(|(start, _)| *start <= from) {
                let _ = start;
                kept_end = kept_end.max(end);
                next_kept.next();
            }
            from = from.max(kept_end);
            let free_end = next_kept.peek().map_or(to, |&(start, _)| start.min(to));
            // Padding behind a view at the end of what is kept stays.
            let first = from.next_multiple_of(16);
            let last = first + free_end.saturating_sub(first) / 16 * 16;
            if first < last && last <= document.bin.len() {
                match removed.last_mut() {
                    Some((_, end)) if *end == first => *end = last,
                    _ => removed.push((first, last)),
                }
            }
            from = free_end.max(from + 1);
        }
    }
    Ok(removed)
}

/// Bytes of buffer 0 that a view has.
fn range_of(view: &Object) -> Result<Option<(usize, usize)>> {
    if view.whole("buffer")? != Some(BIN) {
        return Ok(None);
    }
    let (first, length) = (view.whole("byteOffset")?.unwrap_or(0), view.whole("byteLength")?.unwrap_or(0));
    Ok(Some((first, first.saturating_add(length))))
}

/// Moves a view forward by what was removed before it; whether it moved.
fn shift(view: &mut Object, removed: &[(usize, usize)]) -> Result<bool> {
    let Some((first, _)) = range_of(view)? else { return Ok(false) };
    let before: usize =
        removed.iter().take_while(|(from, _)| *from < first).map(|(from, to)| to - from).sum();
    if before > 0 {
        view.set("byteOffset", &(first - before))?;
    }
    Ok(before > 0)
}

fn renumber(document: &mut Document, new_index: &[usize]) -> Result<()> {
    let update = |object: &mut Object| -> Result<bool> {
        let Some(old) = object.whole("bufferView")? else { return Ok(false) };
        let new = new_index.get(old).copied().unwrap_or(old);
        if new != old {
            object.set("bufferView", &new)?;
        }
        Ok(new != old)
    };
    for list in [List::Accessors, List::Images] {
        for index in 0..document.len(list) {
            let mut object = document.object(list, index)?;
            let mut changed = update(&mut object)?;
            let mut sparse = object.object("sparse")?;
            for key in ["indices", "values"] {
                let mut part = sparse.object(key)?;
                if update(&mut part)? {
                    sparse.set(key, &part)?;
                    object.set("sparse", &sparse)?;
                    changed = true;
                }
            }
            if changed {
                document.put(list, index, &object)?;
            }
        }
    }
    for index in 0..document.len(List::Meshes) {
        let mut mesh = document.object(List::Meshes, index)?;
        let mut primitives = mesh.list("primitives")?;
        let mut changed = false;
        for raw in &mut primitives {
            let mut primitive = Object::parse(raw)?;
            let mut extensions = primitive.object("extensions")?;
            let mut draco = extensions.object(DRACO)?;
            if update(&mut draco)? {
                extensions.set(DRACO, &draco)?;
                primitive.set("extensions", &extensions)?;
                *raw = primitive.to_raw()?;
                changed = true;
            }
        }
        if changed {
            mesh.set("primitives", &primitives)?;
            document.put(List::Meshes, index, &mesh)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five views of 32 bytes each; accessors read the second to fourth, of which the fourth overlaps the third by half.
    fn document() -> Document {
        let json = r#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":160}],"bufferViews":[
            {"buffer":0,"byteOffset":0,"byteLength":32},{"buffer":0,"byteOffset":32,"byteLength":32},
            {"buffer":0,"byteOffset":64,"byteLength":32},{"buffer":0,"byteOffset":80,"byteLength":32},
            {"buffer":0,"byteOffset":128,"byteLength":32}],
            "accessors":[{"bufferView":1},{"bufferView":2},{"bufferView":3}],"images":[{"bufferView":4}]}"#;
        let mut document = Document::open(json.as_bytes()).unwrap();
        document.bin = (0..160).collect();
        document
    }

    /// The bytes of the view that an object of a list names.
    fn bytes(document: &Document, list: List, index: usize) -> Vec<u8> {
        let view = document.object(list, index).unwrap().whole("bufferView").unwrap().unwrap();
        let (from, to) = range_of(&document.object(List::BufferViews, view).unwrap()).unwrap().unwrap();
        document.bin[from..to].to_vec()
    }

    #[test]
    fn what_lost_its_reader_goes_and_the_rest_stays_the_same() {
        for dropped in [0usize, 1, 2] {
            let mut document = document();
            let before = views_in_use(&document).unwrap();
            assert_eq!(before, BTreeSet::from([1, 2, 3, 4]));
            let old: Vec<_> = (0..3).map(|i| bytes(&document, List::Accessors, i)).collect();
            let mut accessor = document.object(List::Accessors, dropped).unwrap();
            accessor.remove("bufferView");
            document.put(List::Accessors, dropped, &accessor).unwrap();
            sweep(&mut document, &before, &[0; 3]).unwrap();
            for (i, old) in old.iter().enumerate().filter(|(i, _)| *i != dropped) {
                assert_eq!(&bytes(&document, List::Accessors, i), old, "without {dropped}");
            }
            assert_eq!(bytes(&document, List::Images, 0), (128..160).collect::<Vec<u8>>());
            // Half of what overlaps is still read; the first view was never read and is left alone.
            let expected = [160 - 32, 160 - 16, 160 - 16][dropped];
            assert_eq!(document.bin.len(), expected, "without {dropped}");
            assert_eq!(document.len(List::BufferViews), 4);
            assert_eq!(document.bin[..32], (0..32).collect::<Vec<u8>>());
        }
    }

    #[test]
    fn an_accessor_without_users_has_no_bytes() {
        let mut document = document();
        let before = views_in_use(&document).unwrap();
        sweep(&mut document, &before, &[1, 0, 0]).unwrap();
        assert!(document.object(List::Accessors, 0).unwrap().is_empty());
        assert_eq!((document.bin.len(), document.len(List::Accessors)), (128, 3));
    }

    #[test]
    fn nothing_lost_is_nothing_changed() {
        let mut document = document();
        let before = views_in_use(&document).unwrap();
        sweep(&mut document, &before, &[0; 3]).unwrap();
        assert_eq!((document.bin.len(), document.len(List::BufferViews)), (160, 5));
    }
}
