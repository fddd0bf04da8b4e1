//! The page around the data: HTML, style and scripts in one file.

use serde::Serialize;

use super::chart::ChartData;
use super::picture::PictureData;
use super::{Report, ReportError, Section, Summary, Table};

const PLOTLY: &str = include_str!("../../assets/plotly/plotly-basic-4.1.1.min.js");
const PLOTLY_LICENSE: &str = include_str!("../../assets/plotly/LICENSE");
const COLOURS: &str = include_str!("../../assets/report/colours.css");
const STYLE: &str = include_str!("../../assets/report/report.css");

/// The scripts of the page, in the order in which they build on each other.
const SCRIPTS: [&str; 8] = [
    include_str!("../../assets/report/base.js"),
    include_str!("../../assets/report/model.js"),
    include_str!("../../assets/report/paint.js"),
    include_str!("../../assets/report/plan.js"),
    include_str!("../../assets/report/charts.js"),
    include_str!("../../assets/report/tracks.js"),
    include_str!("../../assets/report/picture.js"),
    include_str!("../../assets/report/main.js"),
];

/// What the page may do: run what it carries. It can reach no other place.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
                      img-src data: blob:; base-uri 'none'; form-action 'none'";

/// The data of a section, as the scripts read it.
#[derive(Serialize)]
#[serde(untagged)]
enum SectionData<'a> {
    Picture(Box<PictureData<'a>>),
    Chart(ChartData),
}

/// Writes the whole page.
pub(super) fn render(report: &Report) -> Result<String, ReportError> {
    let mut body = String::new();
    let mut data = Vec::new();
    for section in &report.sections {
        match section {
            Section::Summary(summary) => push_summary(&mut body, summary),
            Section::Table(table) => push_table(&mut body, table),
            Section::Picture(picture) => {
                push_host(&mut body, "picture", data.len());
                data.push(SectionData::Picture(Box::new(picture.data()?)));
            }
            Section::Chart(chart) => {
                push_host(&mut body, "chart", data.len());
                data.push(SectionData::Chart(chart.data(0.0)?));
            }
        }
    }
    let data = script_json(&data)?;
    let scripts = SCRIPTS.concat();
    let title = escape(&report.title);
    let subtitle = match &report.subtitle {
        Some(text) => format!("<p class=\"subtitle\">{}</p>\n", escape(text)),
        None => String::new(),
    };
    let version = env!("CARGO_PKG_VERSION");
    Ok(format!(
        r#"<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta name="generator" content="Tercel {version}">
<title>{title}</title>
<link rel="icon" href="data:,">
<style>
{COLOURS}{STYLE}</style>
</head>
<body>
<header>
<h1>{title}</h1>
{subtitle}</header>
<noscript><p class="note">The pictures of this report are drawn by scripts, which are switched off here.</p></noscript>
<main>
{body}</main>
<footer>Made by Tercel {version}. Drawn with plotly.js (MIT). The file is complete and opens offline.</footer>
<script id="report-data" type="application/json">{data}</script>
<script>
/*
{PLOTLY_LICENSE}*/
{PLOTLY}
</script>
<script>
(function () {{
"use strict";
{scripts}}})();
</script>
</body>
</html>
"#
    ))
}

fn push_summary(body: &mut String, summary: &Summary) {
    body.push_str("<dl class=\"summary\" aria-label=\"Summary\">\n");
    for figure in &summary.rows {
        let help = match &figure.help {
            Some(text) => format!("<dd class=\"help\">{}</dd>", escape(text)),
            None => String::new(),
        };
        let (name, value) = (escape(&figure.name), escape(&figure.value));
        body.push_str(&format!("<div><dt>{name}</dt><dd class=\"value\">{value}</dd>{help}</div>\n"));
    }
    body.push_str("</dl>\n");
}

fn push_table(body: &mut String, table: &Table) {
    let open = if table.folded { "" } else { " open" };
    let note = table.note.as_ref().map(|note| format!("<p class=\"hint\">{}</p>\n", escape(note)));
    let cells = |tag: &str, cells: &[String]| -> String {
        cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escape(cell))).collect()
    };
    body.push_str(&format!(
        "<details class=\"figures\"{open}>\n<summary>{}</summary>\n{}<div class=\"wide\">\n<table>\n\
         <thead><tr>{}</tr></thead>\n<tbody>\n",
        escape(&table.heading),
        note.unwrap_or_default(),
        cells("th", &table.columns),
    ));
    for row in &table.rows {
        body.push_str(&format!("<tr>{}</tr>\n", cells("td", row)));
    }
    body.push_str("</tbody>\n</table>\n</div>\n</details>\n");
}

/// The empty element that a script fills from entry `index` of the data.
fn push_host(body: &mut String, kind: &str, index: usize) {
    body.push_str(&format!("<section class=\"{kind}\" data-{kind}=\"{index}\"></section>\n"));
}

/// Text as HTML, safe between tags and in quoted attributes.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            // Control characters are not allowed in HTML, and a NUL would be replaced by the parser.
            c if c.is_control() && !matches!(c, '\n' | '\t') => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

/// JSON that stays inside its script element: `<` only occurs in strings, where its escape means the same.
fn script_json(value: &impl Serialize) -> Result<String, ReportError> {
    Ok(serde_json::to_string(value)?.replace('<', "\\u003c"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_leave_its_element() {
        assert_eq!(escape("<b onclick='x'>\"&\0"), "&lt;b onclick=&#39;x&#39;&gt;&quot;&amp;\u{fffd}");
    }

    #[test]
    fn json_cannot_close_its_script_and_reads_back_the_same() {
        let attack = "</script><script>alert(1)</script><!--\u{2028}";
        let json = script_json(&attack).unwrap();
        assert!(!json.contains('<'));
        assert_eq!(serde_json::from_str::<String>(&json).unwrap(), attack);
    }

    #[test]
    fn no_asset_closes_the_script_that_carries_it() {
        for script in SCRIPTS.iter().chain([&PLOTLY, &PLOTLY_LICENSE]) {
            let lower = script.to_lowercase();
            assert!(!lower.contains("</script") && !lower.contains("<!--"));
        }
        assert!(!format!("{COLOURS}{STYLE}").to_lowercase().contains("</style"));
    }
}
