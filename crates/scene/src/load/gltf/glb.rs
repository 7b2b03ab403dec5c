//! The binary glTF container: a header and chunks.

use crate::load::LoadError;
use crate::load::context::Context;

const JSON_CHUNK: u32 = 0x4E4F_534A;
const BIN_CHUNK: u32 = 0x004E_4942;

/// The JSON chunk and, if there is one, the binary chunk.
pub(super) fn split<'a>(
    context: &Context<'_>,
    bytes: &'a [u8],
) -> Result<(&'a [u8], Option<&'a [u8]>), LoadError> {
    let damaged = |problem: String| LoadError::Container { file: context.file(), problem };
    if !bytes.starts_with(b"glTF") {
        return Err(damaged("it does not begin with 'glTF'".to_owned()));
    }
    let (Some(version), Some(length)) = (u32_at(bytes, 4), u32_at(bytes, 8)) else {
        return Err(context.truncated("the GLB header", 12, bytes.len() as u64));
    };
    if version != 2 {
        return Err(LoadError::Version {
            file: context.file(),
            found: format!("{version} (in the GLB header)"),
        });
    }
    if (length as usize) < 12 {
        return Err(damaged(format!("its header says that it is {length} bytes long, less than a header")));
    }
    let Some(mut rest) = bytes.get(12..length as usize) else {
        return Err(context.truncated("the GLB file", u64::from(length), bytes.len() as u64));
    };
    if bytes.len() > length as usize {
        context.warn(format!(
            "{} bytes after the end of the GLB container are ignored",
            bytes.len() - length as usize
        ));
    }
    let mut json = None;
    let mut bin = None;
    let mut index = 0;
    while !rest.is_empty() {
        let (Some(chunk_length), Some(kind)) = (u32_at(rest, 0), u32_at(rest, 4)) else {
            return Err(context.truncated(format!("the header of GLB chunk {index}"), 8, rest.len() as u64));
        };
        let Some(data) = rest[8..].get(..chunk_length as usize) else {
            let has = rest.len() as u64 - 8;
            return Err(context.truncated(format!("GLB chunk {index}"), u64::from(chunk_length), has));
        };
        rest = &rest[8 + data.len()..];
        match (index, kind) {
            (0, JSON_CHUNK) => json = Some(data),
            (0, _) => return Err(damaged("its first chunk is not JSON".to_owned())),
            (_, BIN_CHUNK) if bin.is_none() => {
                if index != 1 {
                    context.warn("the binary chunk is not the second chunk of the GLB container".to_owned());
                }
                bin = Some(data);
            }
            (_, JSON_CHUNK | BIN_CHUNK) => {
                context.warn(format!("GLB chunk {index} repeats a chunk and is ignored"));
            }
            _ => context.warn(format!("GLB chunk {index} is of an unknown kind and is ignored")),
        }
        index += 1;
    }
    match json {
        Some(json) => Ok((json, bin)),
        None => Err(damaged("it has no JSON chunk".to_owned())),
    }
}

fn u32_at(bytes: &[u8], offset: usize) -> Option<u32> {
    let four = bytes.get(offset..)?.first_chunk::<4>()?;
    Some(u32::from_le_bytes(*four))
}
