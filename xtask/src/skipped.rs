//! Which tests skipped themselves, read from the report that nextest writes.
//!
//! A test that lacks something (scenes, an adapter) prints a line with `skipped: what and why` and passes. A runner
//! hides the output of tests that pass, so those lines are looked up here and shown.

use std::collections::BTreeMap;

const MARK: &str = "skipped: ";

/// The lines that say `skipped:` in a JUnit report, each once, with the number of tests that say it.
pub(crate) fn skipped_lines(junit_xml: &str) -> Vec<String> {
    let mut counts = BTreeMap::<String, usize>::new();
    for line in junit_xml.lines() {
        if let Some(start) = line.find(MARK) {
            // What follows on the same line of XML is markup; `<` in a message is escaped.
            let message = line[start..].split('<').next().unwrap_or_default();
            *counts.entry(unescape(message.trim_end())).or_default() += 1;
        }
    }
    counts.into_iter().map(|(m, n)| if n == 1 { m } else { format!("{m} ({n} tests)") }).collect()
}

fn unescape(text: &str) -> String {
    // `&amp;` last, so that an escaped ampersand does not start a new entity.
    let entities = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&apos;", "'"), ("&amp;", "&")];
    entities.iter().fold(text.to_owned(), |text, (entity, plain)| text.replace(entity, plain))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_lines_and_counts_them() {
        let report = "<testcase name=\"a\"><system-err>skipped: no &quot;x&quot; &amp;lt; here</system-err>\n\
                      <system-err>noise\nskipped: no scenes\nmore</system-err>\nskipped: no scenes\n";
        assert_eq!(skipped_lines(report), ["skipped: no \"x\" &lt; here", "skipped: no scenes (2 tests)"]);
        assert!(skipped_lines("<testsuites skipped=\"0\"/>").is_empty());
    }
}
