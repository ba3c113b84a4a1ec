//! The few shapes of HTML that the page is made of. What comes from a record passes through [`escape`] first.

/// Text that is safe inside an element and inside a quoted attribute. Control characters, which HTML forbids, become U+FFFD.
pub(super) fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.replace("\r\n", "\n").chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            '\n' | '\t' => safe.push(c),
            c if c.is_control() => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// A name with slashes and dots, escaped, that may break after each of them.
pub(super) fn name(text: &str) -> String {
    escape(text).replace('/', "/<wbr>").replace('.', ".<wbr>")
}

/// One cell of a table.
#[derive(Clone, Debug, Default)]
pub(super) struct Cell {
    html: String,
    class: &'static str,
    title: String,
}

impl Cell {
    /// A cell of text.
    pub(super) fn text(html: impl Into<String>) -> Self {
        Self::classed("", html)
    }

    /// A cell of a number, set to the right.
    pub(super) fn number(html: impl Into<String>) -> Self {
        Self::classed("n", html)
    }

    /// A cell of a class of its own.
    pub(super) fn classed(class: &'static str, html: impl Into<String>) -> Self {
        Self {
            html: html.into(),
            class,
            title: String::new(),
        }
    }

    /// With text, not yet escaped, that shows where a pointer hovers.
    pub(super) fn titled(mut self, title: &str) -> Self {
        self.title = escape(title);
        self
    }

    fn html(&self, tag: &str, scope: &str) -> String {
        let mut attributes = String::new();
        for (key, value) in [
            ("scope", scope),
            ("class", self.class),
            ("title", &self.title),
        ] {
            if !value.is_empty() {
                attributes += &format!(" {key}=\"{value}\"");
            }
        }
        format!("<{tag}{attributes}>{}</{tag}>", self.html)
    }
}

/// Rows under a heading of their own; without a heading, plain rows.
#[derive(Clone, Debug, Default)]
pub(super) struct Group {
    /// Already escaped; empty for none.
    pub heading: String,
    /// The first cell of each row heads it.
    pub rows: Vec<Vec<Cell>>,
}

/// A table; the strings are already escaped.
#[derive(Clone, Debug, Default)]
pub(super) struct Table {
    pub caption: String,
    pub columns: Vec<Cell>,
    pub groups: Vec<Group>,
}

/// Rows up to which a table is kept on one printed page.
const SHORT: usize = 24;

impl Table {
    /// The table in a container that scrolls sideways where the page is narrower.
    pub(super) fn html(&self) -> String {
        let rows: usize = self.groups.iter().map(|g| g.rows.len() + 1).sum();
        let class = if rows <= SHORT {
            "scroll short"
        } else {
            "scroll"
        };
        let label = strip_tags(&self.caption);
        let head: String = self.columns.iter().map(|c| c.html("th", "col")).collect();
        let body: String = self.groups.iter().map(|g| self.body(g)).collect();
        format!(
            "<div class=\"{class}\" role=\"region\" tabindex=\"0\" aria-label=\"{label}\"><table><caption>{}</caption>\
             <thead><tr>{head}</tr></thead>{body}</table></div>\n",
            self.caption
        )
    }

    fn body(&self, group: &Group) -> String {
        let heading = match group.heading.as_str() {
            "" => String::new(),
            html => format!(
                "<tr class=\"group\"><th scope=\"rowgroup\" colspan=\"{}\"><span>{html}</span></th></tr>\n",
                self.columns.len()
            ),
        };
        let rows: String = group.rows.iter().map(|r| row(r)).collect();
        format!("<tbody>{heading}{rows}</tbody>\n")
    }
}

fn row(cells: &[Cell]) -> String {
    let cells: String = cells
        .iter()
        .enumerate()
        .map(|(i, cell)| match i {
            0 => cell.html("th", "row"),
            _ => cell.html("td", ""),
        })
        .collect();
    format!("<tr>{cells}</tr>\n")
}

/// The text of markup that this module made: what stands between tags.
pub(super) fn strip_tags(html: &str) -> String {
    let mut text = String::new();
    let mut inside = false;
    for c in html.chars() {
        match c {
            '<' => inside = true,
            '>' if inside => inside = false,
            c if !inside => text.push(c),
            _ => {}
        }
    }
    text
}

/// A section with its heading and anchor.
pub(super) fn section(id: &str, heading: &str, body: &str) -> String {
    format!("<section id=\"{id}\">\n<h2>{heading}</h2>\n{body}</section>\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_escapes_from_escape() {
        let hostile = "<script>\"a\" & 'b'</script>\u{0}\u{1b}[31m\r\nend\ttab";
        let safe = escape(hostile);
        assert!(!safe.contains(['<', '>', '"', '\'', '\u{0}', '\u{1b}', '\r']));
        assert!(safe.contains("&lt;script&gt;") && safe.ends_with("\nend\ttab"));
    }

    #[test]
    fn a_table_heads_its_columns_rows_and_groups() {
        let table = Table {
            caption: "all <b>cases</b>".into(),
            columns: vec![Cell::text("case"), Cell::number("time")],
            groups: vec![Group {
                heading: "signal.h".into(),
                rows: vec![vec![Cell::text("a"), Cell::number("1").titled("\"1\" < 2")]],
            }],
        };
        let html = table.html();
        for part in [
            "aria-label=\"all cases\"",
            "<th scope=\"col\" class=\"n\">time</th>",
            "<th scope=\"rowgroup\" colspan=\"2\"><span>signal.h</span></th>",
            "<th scope=\"row\">a</th>",
            "title=\"&quot;1&quot; &lt; 2\"",
        ] {
            assert!(html.contains(part), "{part} is not in {html}");
        }
    }
}
