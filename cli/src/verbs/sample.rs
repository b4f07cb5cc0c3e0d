//! `feedspline sample`: write way-points of this project's own drawing, to try the other verbs on.

use std::io::Write;
use std::path::{Path, PathBuf};

use planner::job::samples::{cat_contour, tooth_raster, write_csv};

use super::Verdict;
use crate::args::{self, Sample, SampleArgs};
use crate::console::Console;
use crate::failure::Failure;
use crate::json::SampleJson;
use crate::output::OutputSet;
use crate::summary;

/// Way-points of the cat when nothing is said: ten times 300, as in Zhao 2016, sec. 3.3.1.
const CAT_POINTS: u32 = 3000;

/// Rows of the tooth and way-points of each when nothing is said, as in Zhao 2016, sec. 3.3.2.
const TOOTH: [u32; 2] = [1000, 100];

/// Most way-points in all.
const MOST_POINTS: u64 = 10_000_000;

/// Runs the verb.
///
/// # Errors
/// The sample would be too large, or the file cannot be written; then none is left behind.
pub fn execute(args: &SampleArgs, console: &mut Console<'_>) -> Result<Verdict, Failure> {
    let path = match &args.out {
        Some(path) => path.clone(),
        None => Path::new("out").join(args::name(args.what)).with_extension("csv"),
    };
    let no_file = || {
        Failure::input("this names no file").in_file(&path).with_help("Name a file, such as out/tooth.csv.")
    };
    let name = path.file_name().ok_or_else(no_file)?.to_string_lossy().into_owned();
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if args.what == Sample::Cat && args.rows.is_some() {
        return Err(Failure::input("--rows says nothing about the cat, which is one line")
            .with_help("Leave --rows away, or write the tooth."));
    }
    let [rows, points] = match args.what {
        Sample::Cat => [1, args.points.unwrap_or(CAT_POINTS)],
        Sample::Tooth => [args.rows.unwrap_or(TOOTH[0]), args.points.unwrap_or(TOOTH[1])],
    };
    let count = u64::from(rows) * u64::from(points);
    if count > MOST_POINTS {
        return Err(Failure::input(format!("{count} way-points, at most {MOST_POINTS} in one job"))
            .with_help("Ask for fewer rows or fewer points."));
    }
    let mut set = OutputSet::open(folder)?;
    let mut out = set.stream(&name)?;
    let written = match args.what {
        Sample::Cat => {
            let cat = cat_contour(points as usize)
                .map_err(|e| Failure::internal(format!("the cat cannot be drawn: {e}")))?;
            write_csv(&mut out, "X [mm],Y [mm]", &cat, 7)
        }
        Sample::Tooth => {
            write_csv(&mut out, "X [mm],Y [mm],Z [mm]", &tooth_raster(rows as usize, points as usize), 9)
        }
    };
    written.and_then(|()| out.flush()).map_err(|e| Failure::unwritable(&path, &e))?;
    drop(out);
    set.commit()?;
    let told = SampleJson { file: path.display().to_string(), points: count, file_bytes: size(&path)? };
    console.show(&told, &summary::sample(&told))?;
    Ok(Verdict::Holds)
}

fn size(path: &PathBuf) -> Result<u64, Failure> {
    Ok(std::fs::metadata(path).map_err(|e| Failure::unreadable(path, &e))?.len())
}
