//! Exhibits on the page: tables, charts and pictures under one line that says what to look for.

use super::markup::{Cell, Group, Table, escape};
use super::pictures;
use super::plots;
use crate::exhibits::{Exhibit, Panel, Picture, Table as Sheet};

/// Every exhibit.
pub(super) fn all(exhibits: &[Exhibit]) -> String {
    if exhibits.is_empty() {
        return "<p>This run made no exhibits; <code>meshseq verify --exhibits</code> does.</p>\n"
            .into();
    }
    exhibits.iter().map(one).collect()
}

fn one(exhibit: &Exhibit) -> String {
    let panels: String = exhibit.panels.iter().map(panel).collect();
    format!(
        "<div class=\"stage\">\n<h3>{}</h3>\n<p>{} <span class=\"faint\">({})</span></p>\n<div class=\"exhibit\">\n{panels}</div></div>\n",
        escape(&exhibit.title),
        escape(&exhibit.look),
        escape(&exhibit.datasets.join(", "))
    )
}

fn panel(panel: &Panel) -> String {
    match panel {
        Panel::Table(sheet) => table(sheet),
        Panel::Chart(chart) => pictures::figure(&plots::exhibit::picture(chart)),
        Panel::Picture(picture) => image(picture),
    }
}

fn table(sheet: &Sheet) -> String {
    let cells = |row: &[String]| {
        let cell = |(i, text): (usize, &String)| match i {
            0 => Cell::text(escape(text)),
            _ => Cell::number(escape(text)),
        };
        row.iter().enumerate().map(cell).collect()
    };
    Table {
        caption: escape(&sheet.caption),
        columns: cells(&sheet.heads),
        groups: vec![Group {
            heading: String::new(),
            rows: sheet.rows.iter().map(|row| cells(row)).collect(),
        }],
    }
    .html()
}

/// A picture that is part of the page; one that is no base 64 is left out.
fn image(picture: &Picture) -> String {
    let title = escape(&picture.title);
    let sound = |c: u8| c.is_ascii_alphanumeric() || b"+/=".contains(&c);
    if picture.png.is_empty() || !picture.png.bytes().all(sound) {
        return format!("<p class=\"undrawn\">Not drawn: {title}.</p>\n");
    }
    format!(
        "<figure class=\"poses\">\n<img alt=\"{title}\" width=\"{}\" height=\"{}\" src=\"data:image/png;base64,{}\"/>\n\
         <figcaption>{title}.</figcaption>\n</figure>\n",
        picture.width, picture.height, picture.png
    )
}
