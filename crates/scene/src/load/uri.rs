//! Resolves the references of a scene file: `data:` URIs and relative paths that stay in its folder.

use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::{percent_decode, percent_decode_str};

use super::LoadError;
use super::context::{Context, EXTERNAL_FILE_LIMIT_BYTES};

/// Where a reference leads.
pub(super) enum Target {
    /// Bytes inside the reference itself.
    Data(Vec<u8>),
    /// A clean relative path.
    File(String),
}

pub(super) fn resolve(context: &Context<'_>, at: &str, uri: &str) -> Result<Target, LoadError> {
    let refuse = |problem: &str| LoadError::Uri {
        file: context.file(),
        at: at.to_owned(),
        uri: uri.chars().take(80).collect(),
        problem: problem.to_owned(),
    };
    if uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:")) {
        return match decode_data(&uri[5..]) {
            Some(data) => Ok(Target::Data(data)),
            None => Err(refuse("which is not a valid data URI; embed the data again as base64")),
        };
    }
    let Ok(path) = percent_decode_str(uri).decode_utf8() else {
        return Err(refuse("which is not UTF-8 after percent-decoding; rename the file"));
    };
    match clean_path(&path) {
        Some(path) => Ok(Target::File(path)),
        None => Err(refuse(
            "but only files in the scene's own folder or below it are read \
             (no network addresses, absolute paths or '..' out of it); copy the file there and name it relatively",
        )),
    }
}

/// The bytes a reference leads to.
pub(super) fn read(context: &Context<'_>, at: &str, uri: &str) -> Result<Vec<u8>, LoadError> {
    match resolve(context, at, uri)? {
        Target::Data(data) => Ok(data),
        Target::File(path) => read_file(context, at, path),
    }
}

pub(super) fn read_file(context: &Context<'_>, at: &str, path: String) -> Result<Vec<u8>, LoadError> {
    match context.files.read(&path, EXTERNAL_FILE_LIMIT_BYTES) {
        Ok(bytes) => {
            context.count_input(bytes.len());
            Ok(bytes)
        }
        Err(source) => Err(LoadError::Read { file: context.file(), at: at.to_owned(), uri: path, source }),
    }
}

/// A relative path without `.` and `..`, or `None` if it is empty or leads out of the folder.
fn clean_path(path: &str) -> Option<String> {
    if path.contains([':', '\0']) || path.starts_with(['/', '\\']) {
        return None;
    }
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split(['/', '\\']) {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            _ => parts.push(part),
        }
    }
    if parts.is_empty() { None } else { Some(parts.join("/")) }
}

fn decode_data(rest: &str) -> Option<Vec<u8>> {
    let (media_type, data) = rest.split_once(',')?;
    if media_type.to_ascii_lowercase().ends_with(";base64") {
        let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
        let engine = GeneralPurpose::new(&base64::alphabet::STANDARD, config);
        let data: std::borrow::Cow<'_, [u8]> = percent_decode_str(data).into();
        engine.decode(&data).ok()
    } else {
        Some(percent_decode(data.as_bytes()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_stay_in_the_folder() {
        assert_eq!(clean_path("a/b.bin").as_deref(), Some("a/b.bin"));
        assert_eq!(clean_path("./a//b.bin").as_deref(), Some("a/b.bin"));
        assert_eq!(clean_path("a\\b\\..\\c.png").as_deref(), Some("a/c.png"));
        for bad in [
            "",
            ".",
            "..",
            "../x",
            "a/../../x",
            "/etc/passwd",
            "\\x",
            "C:\\x",
            "http://h/x",
            "file:x",
            "a\0b",
        ] {
            assert_eq!(clean_path(bad), None, "{bad:?}");
        }
    }

    #[test]
    fn data_uris_decode() {
        assert_eq!(decode_data("application/octet-stream;base64,AQID").as_deref(), Some(&[1, 2, 3][..]));
        assert_eq!(decode_data(";base64,AQ").as_deref(), Some(&[1][..]));
        assert_eq!(decode_data("text/plain,a%20b").as_deref(), Some(&b"a b"[..]));
        assert_eq!(decode_data(";base64,***"), None);
        assert_eq!(decode_data("nothing"), None);
    }
}
