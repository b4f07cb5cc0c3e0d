//! Part programs, from the file to sections.

use planner::analysis::comparison::Comparison;
use planner::geometry::sections::{PathSettings, SectionError, sections};
use planner::job::gcode::{self, Options, ProgramError};
use planner::job::machine::{LimitSet, Machine};
use planner::job::program::{Corner, Item, MoveKind, ToleranceSource};

use super::job::{InForce, Stream, Told, placed};
use crate::args::{self, JobArgs};
use crate::failure::Failure;

/// Reads a part program and hands its sections to `consume`.
///
/// # Errors
/// As [`super::job::read`].
pub(super) fn read<R>(
    args: &JobArgs,
    machine: &Machine,
    limits: LimitSet,
    settings: &PathSettings,
    consume: impl FnOnce(Stream<'_>) -> Result<R, Failure>,
) -> Result<(R, Told), Failure> {
    let refused = |e: ProgramError| placed(e.kind().to_string(), &args.file, e.line(), e.column()).quoting(e);
    let mut program = gcode::open(&args.file, machine, options(args)).map_err(refused)?;
    let mut comparison = Comparison::new(&machine.axes, limits);
    let mut tolerance = InForce::default();
    let items = program.by_ref().inspect(|item| match item {
        Ok(Item::Move(m)) => {
            comparison.add(m);
            if m.kind == MoveKind::Feed {
                tolerance.note(m.corner, machine);
            }
        }
        Ok(Item::Dwell { seconds, .. }) => comparison.add_dwell(*seconds),
        Ok(Item::Stop { .. } | Item::Note { .. }) | Err(_) => {}
    });
    let mut sections = sections(items, machine, settings);
    let mut stream = sections.by_ref().map(|item| {
        item.map_err(|e| match e {
            SectionError::Program(e) => refused(e),
            SectionError::Geometry(e) => placed(e.to_string(), &args.file, Some(e.line()), None)
                .with_help("Widen the tolerance (G64 P or --tolerance), or change the path at this line."),
        })
    });
    let result = consume(&mut stream)?;
    let stops = sections.stops().clone();
    let left_out_mm = sections.left_out_mm();
    drop(sections);
    let counters = program.counters().clone();
    Ok((result, Told { counters, comparison, stops, tolerance, left_out_mm, points: None }))
}

impl InForce {
    /// Takes in the corner of one feed move.
    fn note(&mut self, corner: Corner, machine: &Machine) {
        let (mm, source) = match corner {
            Corner::Within { tolerance_mm, source } if tolerance_mm > 0.0 => (tolerance_mm, source),
            Corner::Within { source, .. } => (machine.exact_path_mm, source),
            Corner::Stop | Corner::Exact => (machine.exact_path_mm, ToleranceSource::Program),
        };
        if self.source.is_none() || mm > self.mm {
            *self = InForce { mm, source: Some(source) };
        }
    }
}

fn options(args: &JobArgs) -> Options {
    Options {
        dialect: match args.dialect.unwrap_or_default() {
            args::Dialect::Rs274 => gcode::Dialect::Rs274,
            args::Dialect::Printer => gcode::Dialect::Printer,
        },
        tolerance_mm: args.tolerance,
        ignore_feed: args.ignore_feed,
        block_delete: false,
    }
}
