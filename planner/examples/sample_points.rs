//! Writes the sample way-point jobs as CSV.
//!
//!     cargo run -p planner --example sample_points -- cat 3000 > jobs/cat2d.csv
//!     cargo run -p planner --example sample_points -- tooth 1000 100 > tooth.csv

use std::io::{BufWriter, Write, stdout};
use std::process::ExitCode;

use planner::job::samples::{cat_contour, tooth_raster};

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let sizes: Vec<usize> = words.iter().skip(1).filter_map(|w| w.parse().ok()).collect();
    let written = match (words.first().map(String::as_str), sizes.as_slice()) {
        (Some("cat"), &[points]) => match cat_contour(points) {
            Ok(cat) => write("X [mm],Y [mm]", &cat, 7),
            Err(error) => {
                eprintln!("{error}");
                return ExitCode::from(2);
            }
        },
        (Some("tooth"), &[rows, points]) => write("X [mm],Y [mm],Z [mm]", &tooth_raster(rows, points), 9),
        _ => {
            eprintln!("expected: cat POINTS, or tooth ROWS POINTS");
            return ExitCode::from(2);
        }
    };
    match written {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Writes way-points with enough digits that rounding them does not shake the machine.
fn write<const N: usize>(header: &str, points: &[[f64; N]], digits: usize) -> std::io::Result<()> {
    let mut out = BufWriter::new(stdout().lock());
    writeln!(out, "{header}")?;
    for point in points {
        let fields = point.map(|v| format!("{v:.digits$}"));
        writeln!(out, "{}", fields.join(","))?;
    }
    out.flush()
}
