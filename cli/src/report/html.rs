//! The page around the sections.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::data::{Data, text};
use super::model::Report;
use super::{sections, tables};

const STYLE: &str = include_str!("report.css");
const PLOTS: &str = include_str!("plots.js");
const SCRIPT: &str = include_str!("report.js");

/// Nothing may be loaded from anywhere, whatever a program's comments hold.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

/// The report as one HTML file.
pub fn page(report: &Report) -> String {
    let body = html! {
        (sections::header(report))
        (sections::headline(report))
        noscript { p.note { "The plots need JavaScript; all tables are complete without it." } }
        (sections::picture(report))
        (sections::limiting(report))
        (tables::slow(report))
        (sections::speed(report))
        (sections::axes(report))
        (sections::drives(report))
        (tables::operations(report))
        (tables::proof(report))
        (tables::facts(report))
        (tables::notes(report))
    };
    let title = format!("{} \u{2013} motion report", report.job);
    shell(&title, &body, &text(&Data::new(report)), SCRIPT)
}

/// One HTML file: the body, the numbers behind its plots, and the script that draws them.
pub(super) fn shell(title: &str, body: &Markup, data: &str, script: &str) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                main { (body) }
                script #data type="application/json" { (PreEscaped(data)) }
                script { (PreEscaped(PLOTS)) (PreEscaped(script)) }
            }
        }
    }
    .into_string()
}
