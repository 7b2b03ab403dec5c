//! The little of Markdown that the checks read: tables and links.

/// A row of a table, and where it stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Row {
    /// Cells without the space around them.
    pub(crate) cells: Vec<String>,
    /// Line number, from 1.
    pub(crate) line: usize,
}

/// The rows of the first table whose head begins with the columns `head`; `None` if there is none.
pub(crate) fn table(text: &str, head: &[&str]) -> Option<Vec<Row>> {
    let mut lines = text.lines().enumerate().map(|(i, line)| (i + 1, cells(line)));
    lines.find(|(_, cells)| {
        cells.as_ref().is_some_and(|c| c.len() >= head.len() && c.iter().zip(head).all(|(c, h)| c == h))
    })?;
    let rows = lines
        .skip(1) // the rule under the head
        .map_while(|(line, cells)| cells.map(|cells| Row { cells, line }))
        .collect();
    Some(rows)
}

fn cells(line: &str) -> Option<Vec<String>> {
    let inner = line.trim().strip_prefix('|')?.strip_suffix('|')?;
    Some(inner.split('|').map(|cell| cell.trim().to_owned()).collect())
}

/// The pieces of `text` that stand between backticks.
pub(crate) fn code_spans(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

/// Targets of all links and images `[...](target)` outside code, with their line numbers from 1.
pub(crate) fn links(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut in_fence = false;
    for (index, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            in_fence = !in_fence;
        }
        if in_fence {
            continue;
        }
        let plain = without_code(line);
        let mut rest = plain.as_str();
        while let Some((_, after)) = rest.split_once("](") {
            let Some((target, after)) = after.split_once(')') else { break };
            // What follows a space is a title.
            found.extend(target.split_whitespace().next().map(|target| (index + 1, target.to_owned())));
            rest = after;
        }
    }
    found
}

/// The line with what stands between backticks left out.
fn without_code(line: &str) -> String {
    line.split('`').step_by(2).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str =
        "# Title\n\n| a | b | why |\n|---|---|---|\n| `x`, `y` | – | c |\n|z|all|  |\n\nend\n| a |\n";

    #[test]
    fn finds_a_table_by_its_head() {
        let rows = table(TEXT, &["a", "b"]).unwrap();
        assert_eq!(rows.len(), 2);
        assert_eq!(rows[0], Row { cells: vec!["`x`, `y`".into(), "–".into(), "c".into()], line: 5 });
        assert_eq!(rows[1].cells, ["z", "all", ""]);
        assert_eq!(table(TEXT, &["b", "a"]), None);
        assert_eq!(table("| a | b |", &["a", "b"]), Some(Vec::new()));
    }

    #[test]
    fn finds_code_spans() {
        assert_eq!(code_spans("`x`, and `y z`").collect::<Vec<_>>(), ["x", "y z"]);
        assert_eq!(code_spans("none").count(), 0);
    }

    #[test]
    fn finds_links_outside_code() {
        let text = "[a](b.md) ![c](d.png \"title\") `[no](e)`\n```\n[no](f)\n```\n[`code`](g#h) [broken](\n";
        assert_eq!(links(text), [(1, "b.md".to_owned()), (1, "d.png".to_owned()), (5, "g#h".to_owned())]);
    }
}
