//! What broadcasts and tracks are called.

use moq_net::{Pattern, Patterns};

use crate::LinkError;

/// What all may know of a host.
pub(crate) const ABOUT: &str = "about";
/// The scene's state.
pub(crate) const STATE: &str = "state";
/// Words, either way.
pub(crate) const TALK: &str = "talk";
/// How a viewer looks: the newest counts.
pub(crate) const LOOKS: &str = "looks";

/// Longest name of a viewer.
const MAX_VIEWER: usize = 64;

/// Longest name of a broadcast, bytes.
const MAX_NAME: usize = 200;

/// The track of a rung's light.
pub(crate) fn light(rung: usize) -> String {
    format!("light/{rung}")
}

/// The track of its snapshots.
pub(crate) fn snapshot(rung: usize) -> String {
    format!("snapshot/{rung}")
}

/// The track of a part's light.
pub(crate) fn part(number: usize) -> String {
    format!("part/{number}")
}

/// The track of its snapshots.
pub(crate) fn part_snapshot(number: usize) -> String {
    format!("part-snapshot/{number}")
}

/// Names of one host's broadcasts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Names {
    base: String,
    shared: String,
}

/// Says what is wrong with a broadcast's name, if anything is: parts of letters, digits, `.`, `_` and `-` with `/` between, 200 bytes at most.
///
/// # Errors
/// What is wrong.
pub fn check_name(name: &str) -> Result<(), String> {
    let is_good = |part: &str| {
        !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte))
    };
    if name.len() > MAX_NAME || name.split('/').count() > 16 || !name.split('/').all(is_good) {
        return Err(format!(
            "{name:?} is no name of a broadcast: letters, digits, '.', '_' and '-', with '/' between parts"
        ));
    }
    Ok(())
}

impl Names {
    /// Of a host whose broadcast is called this ([`check_name`]).
    ///
    /// # Errors
    /// What is wrong with the name.
    pub fn new(name: &str) -> Result<Names, LinkError> {
        check_name(name).map_err(LinkError::Refused)?;
        Ok(Names { base: name.to_owned(), shared: format!("{name}/all") })
    }

    /// The broadcast of light and state. Beside those of viewers and not above them: interest goes by prefix, and who asks for this must not be told of all
    /// viewers.
    pub fn shared(&self) -> &str {
        &self.shared
    }

    /// What a viewer says.
    pub fn from_viewer(&self, viewer: &str) -> String {
        format!("{}/in/{viewer}", self.base)
    }

    /// What is said to it.
    pub fn to_viewer(&self, viewer: &str) -> String {
        format!("{}/out/{viewer}", self.base)
    }

    /// The path at which one viewer connects to the host itself; with `{viewer}` in its place it is told to all.
    pub fn path_of(&self, viewer: &str) -> String {
        format!("/{}/{viewer}", self.base)
    }

    /// The viewer that connects at a path; `None` if that is none of this host's.
    pub fn viewer_at<'a>(&self, path: &'a str) -> Option<&'a str> {
        let viewer = path.strip_prefix('/')?.strip_prefix(&self.base)?.strip_prefix('/')?;
        is_viewer(viewer).then_some(viewer)
    }

    /// What a viewer may read, and what it may write (`*` for all viewers): of other viewers nothing, not even that they are there.
    ///
    /// # Errors
    /// None, for names that were checked.
    pub fn rights(&self, viewer: &str) -> Result<(Patterns, Patterns), LinkError> {
        Ok((
            patterns(&[self.shared.clone(), self.to_viewer(viewer)])?,
            patterns(&[self.from_viewer(viewer)])?,
        ))
    }
}

fn patterns(texts: &[String]) -> Result<Patterns, LinkError> {
    let mut patterns = Patterns::new();
    for text in texts {
        let pattern: Pattern =
            text.parse().map_err(|error| LinkError::Refused(format!("{text}: {error}")))?;
        patterns.insert(pattern);
    }
    Ok(patterns)
}

/// Whether this can be a viewer's name: hexadecimal digits, 32 to 64 of them, so that nobody guesses it.
pub(crate) fn is_viewer(name: &str) -> bool {
    (32..=MAX_VIEWER).contains(&name.len()) && name.bytes().all(|byte| byte.is_ascii_hexdigit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_bounded_and_patterns_tell_whose_they_are() {
        for name in ["a", "dapple/room-1", "a/b.c_d"] {
            assert_eq!(check_name(name), Ok(()));
        }
        for name in
            ["", "/", "a/", "/a", "a//b", "a b", "a/*", "**", "ä", &"a".repeat(201), &["a"; 17].join("/")]
        {
            assert!(check_name(name).is_err(), "{name}");
        }
        let names = Names::new("dapple/room").unwrap();
        let (readable, writable) = names.rights("*").unwrap();
        assert!(readable.matches("dapple/room/all") && readable.matches(&names.to_viewer("ab")));
        assert!(!readable.matches(&names.from_viewer("ab")) && !readable.matches("dapple/room"));
        assert!(writable.matches(&names.from_viewer("ab")) && !writable.matches(&names.to_viewer("ab")));
        assert!(!writable.matches("dapple/room/all") && !writable.matches("dapple/room/in/a/b"));
        let (one, other) = ("0f".repeat(16), "0e".repeat(16));
        let (readable, writable) = names.rights(&one).unwrap();
        assert!(readable.matches(names.shared()) && readable.matches(&names.to_viewer(&one)));
        // What is asked for by prefix is that and nothing else.
        let heads: Vec<&str> = readable.iter().map(|pattern| pattern.head()).collect();
        assert!(heads.iter().all(|head| !names.from_viewer(&other).starts_with(head)), "{heads:?}");
        assert!(heads.iter().all(|head| !names.to_viewer(&other).starts_with(head)), "{heads:?}");
        assert!(!readable.matches(&names.to_viewer(&other)) && !writable.matches(&names.from_viewer(&other)));
        assert_eq!(names.viewer_at(&names.path_of(&one)), Some(&one[..]));
        for path in ["/", "", "/dapple/room", "/dapple/room/", "/dapple/room/ab", "/dapple/other/x"] {
            assert_eq!(names.viewer_at(path), None, "{path}");
        }
    }

    #[test]
    fn viewers_names_cannot_be_guessed() {
        assert!(is_viewer(&"0f".repeat(16)) && is_viewer(&"A".repeat(64)));
        assert!(!is_viewer(&"0f".repeat(15)) && !is_viewer(&"g".repeat(32)) && !is_viewer(&"0".repeat(65)));
    }
}
