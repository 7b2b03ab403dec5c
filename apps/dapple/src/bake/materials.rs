//! Materials that read what was baked: edited where all that wears them reads the same image, copied otherwise.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use serde_json::json;

use super::document::{Document, List};
use super::edit::Dressed;
use super::json::{Object, Raw};
use super::layout::Reads;
use super::texels::Images;

const VARIANTS: &str = "KHR_materials_variants";
const UNLIT: &str = "KHR_materials_unlit";

/// Textures of a sheet.
#[derive(Clone, Copy, Debug)]
struct SheetTextures {
    visibility: usize,
    bent: Option<usize>,
}

/// Makes materials on demand.
pub(crate) struct Wardrobe {
    textures: Vec<SheetTextures>,
    /// How many primitives that are not baked wear each material.
    others: BTreeMap<usize, usize>,
    /// Materials made so far, by what they were made from and what they read.
    made: BTreeMap<(Option<usize>, Reads), usize>,
    /// Materials of the file that were edited.
    edited: BTreeMap<usize, ()>,
    replaced: usize,
    unlit: usize,
}

impl Wardrobe {
    /// Adds the images to the document. `others` counts the primitives that stay as they are, by material.
    pub(crate) fn new(
        document: &mut Document,
        images: &[Images],
        others: BTreeMap<usize, usize>,
    ) -> Result<Wardrobe> {
        let mut textures = Vec::new();
        // Bilinear, with mip maps. In new coordinates surfaces end before the border.
        let mut samplers = BTreeMap::new();
        for repeats in images.iter().map(|images| images.repeats) {
            let wrap = if repeats { 10497 } else { 33071 };
            let sampler = json!({"magFilter": 9729, "minFilter": 9987, "wrapS": wrap, "wrapT": wrap});
            if let std::collections::btree_map::Entry::Vacant(free) = samplers.entry(repeats) {
                free.insert(document.push_value(List::Samplers, &sampler)?);
            }
        }
        for (number, sheet) in images.iter().enumerate() {
            let suffix = if images.len() > 1 { format!(" {number}") } else { String::new() };
            let sampler = samplers[&sheet.repeats];
            let mut add = |bytes: &[u8], name: String| -> Result<usize> {
                let view = document.push_view(bytes, None)?;
                let image = json!({"name": name, "mimeType": "image/png", "bufferView": view});
                let source = document.push_value(List::Images, &image)?;
                document
                    .push_value(List::Textures, &json!({"name": name, "sampler": sampler, "source": source}))
            };
            let visibility = add(&sheet.visibility, format!("baked visibility{suffix}"))?;
            let bent = sheet
                .bent
                .as_ref()
                .map(|bent| add(bent, format!("baked bent normals{suffix}")))
                .transpose()?;
            textures.push(SheetTextures { visibility, bent });
        }
        let (made, edited) = (BTreeMap::new(), BTreeMap::new());
        Ok(Wardrobe { textures, others, made, edited, replaced: 0, unlit: 0 })
    }

    /// The materials of a primitive that is to read `reads`.
    pub(crate) fn dress(
        &mut self,
        document: &mut Document,
        primitive: &Object,
        reads: Reads,
    ) -> Result<Dressed> {
        let material = self.material(document, primitive.whole("material")?, reads)?;
        let mut extensions = primitive.object("extensions")?;
        if !extensions.has(VARIANTS) {
            return Ok(Dressed { material, extensions: None });
        }
        let mut variants = extensions.object(VARIANTS)?;
        let mut mappings: Vec<Raw> = Vec::new();
        for raw in variants.list("mappings")? {
            let mut mapping = Object::parse(&raw)?;
            if let Some(worn) = mapping.whole("material")? {
                mapping.set("material", &self.material(document, Some(worn), reads)?)?;
            }
            mappings.push(mapping.to_raw()?);
        }
        variants.set("mappings", &mappings)?;
        extensions.set(VARIANTS, &variants)?;
        Ok(Dressed { material, extensions: Some(serde_json::to_string(&extensions)?) })
    }

    /// A material like the given one (the default one, where there is none) that reads `reads`.
    fn material(&mut self, document: &mut Document, worn: Option<usize>, reads: Reads) -> Result<usize> {
        if let Some(&made) = self.made.get(&(worn, reads)) {
            return Ok(made);
        }
        let mut material = match worn {
            Some(index) => document.object(List::Materials, index)?,
            None => Object::default(),
        };
        let textures = self.textures[reads.sheet];
        if material.has("occlusionTexture") && !worn.is_some_and(|index| self.edited.contains_key(&index)) {
            self.replaced += 1;
        }
        self.unlit += usize::from(material.object("extensions")?.has(UNLIT));
        material.set("occlusionTexture", &texture_info(textures.visibility, reads.set))?;
        if let Some(bent) = textures.bent {
            name_bent_normals(&mut material, bent, reads.set)?;
        }
        let is_free =
            worn.filter(|index| !self.others.contains_key(index) && !self.edited.contains_key(index));
        let made = match is_free {
            Some(index) => {
                document.put(List::Materials, index, &material)?;
                self.edited.insert(index, ());
                index
            }
            None => document.push(List::Materials, &material)?,
        };
        self.made.insert((worn, reads), made);
        Ok(made)
    }

    /// Says what a user should know.
    pub(crate) fn warn(&self, title: &str) {
        if self.replaced > 0 {
            tracing::warn!(
                "{title}: {} materials had an occlusion texture, which is replaced",
                self.replaced
            );
        }
        if self.unlit > 0 {
            tracing::warn!(
                "{title}: {} materials are unlit, and viewers ignore occlusion textures on those; --into vertex shows on them",
                self.unlit
            );
        }
    }
}

fn texture_info(index: usize, set: u32) -> serde_json::Value {
    // Set 0 is the default.
    if set == 0 { json!({"index": index}) } else { json!({"index": index, "texCoord": set}) }
}

/// Extras name the texture of bent normals, as glTF has no place for it.
fn name_bent_normals(material: &mut Object, texture: usize, set: u32) -> Result<()> {
    let mut extras = match material.get("extras") {
        None => Object::default(),
        Some(raw) => match Object::parse(raw) {
            Ok(extras) => extras,
            Err(_) => {
                tracing::warn!("a material has extras that are no object: they cannot name its bent normals");
                return Ok(());
            }
        },
    };
    extras.set("bentNormalTexture", &json!({"index": texture, "texCoord": set, "space": "object"}))?;
    material.set("extras", &extras)
}

/// How often each material is named by primitives, variants included.
pub(crate) fn count_worn(primitives: &[Raw], worn: &mut BTreeMap<usize, isize>, step: isize) -> Result<()> {
    for (index, raw) in primitives.iter().enumerate() {
        let primitive = Object::parse(raw).with_context(|| format!("primitives[{index}]"))?;
        let mut count = |material: Option<usize>| {
            if let Some(material) = material {
                *worn.entry(material).or_default() += step;
            }
        };
        count(primitive.whole("material")?);
        for mapping in primitive.object("extensions")?.object(VARIANTS)?.list("mappings")? {
            count(Object::parse(&mapping)?.whole("material")?);
        }
    }
    Ok(())
}
