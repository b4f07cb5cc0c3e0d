//! What was measured, as text and as JSON.

use serde_json::{Value, json};

/// One planner on one item.
pub struct Row {
    item: String,
    planner: String,
    seconds: f64,
    time: f64,
    ratio: Option<f64>,
}

/// All rows.
#[derive(Default)]
pub struct Table {
    rows: Vec<Row>,
}

impl Row {
    /// This planner: seconds it took and traverse time of its answer [s].
    pub fn ours(item: &str, planner: &str, seconds: f64, time: f64) -> Self {
        Row { item: item.into(), planner: planner.into(), seconds, time, ratio: None }
    }

    /// Another planner, against the seconds of this one.
    pub fn peer(item: &str, planner: &str, seconds: f64, time: f64, ours: f64) -> Self {
        Row { ratio: Some(seconds / ours), ..Row::ours(item, planner, seconds, time) }
    }
}

impl Table {
    /// Adds a row, and shows it at once.
    pub fn push(&mut self, row: Row) {
        eprintln!("{}", line(&row));
        self.rows.push(row);
    }

    /// A Markdown table.
    pub fn text(&self) -> String {
        let mut text =
            String::from("| item | planner | ms | ratio | traverse time s |\n|---|---|--:|--:|--:|\n");
        for row in &self.rows {
            text += &line(row);
            text.push('\n');
        }
        text
    }

    /// A JSON array of objects.
    pub fn json(&self) -> String {
        let object = |row: &Row| {
            json!({
                "item": row.item,
                "planner": row.planner.trim(),
                "seconds": row.seconds,
                "ratio": row.ratio,
                "traverse_time_s": row.time,
            })
        };
        let rows: Vec<Value> = self.rows.iter().map(object).collect();
        format!("{:#}\n", Value::from(rows))
    }
}

fn line(row: &Row) -> String {
    let ratio = row.ratio.map_or_else(|| "1".to_string(), |r| format!("{r:.1}"));
    format!("| {} | {} | {:.4} | {ratio} | {:.5} |", row.item, row.planner, 1e3 * row.seconds, row.time)
}
