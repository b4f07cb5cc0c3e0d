//! Files of way-points, from the file to sections.
//!
//! Programs start at 0 on every axis, and so do these: unless the first way-point is there, a rapid comes before it.

use std::collections::BTreeMap;

use planner::analysis::comparison::Comparison;
use planner::analysis::steady::arc_length;
use planner::geometry::sections::{PathSettings, SectionError, SectionItem, sections};
use planner::job::gcode::{BoundingBox, Counters};
use planner::job::machine::{LimitSet, Machine, Point};
use planner::job::program::{Corner, Feed, Item, Move, MoveKind, Shape, StopCause, ToleranceSource};
use planner::job::waypoints::{self, SplineForm, WayPointError, WayPoints};
use planner::splines::cubic::Ends;
use planner::splines::knots::Knots;

use super::job::{InForce, Points, Stream, Told, placed};
use crate::args::{self, JobArgs};
use crate::failure::Failure;

/// Reads way-points and hands their sections to `consume`: a rapid to the first one, unless the machine starts there,
/// and the spline through them all.
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
    let refused =
        |e: WayPointError| placed(e.kind().to_string(), &args.file, e.line(), e.column()).quoting(e);
    let points = waypoints::read(&args.file, machine).map_err(refused)?;
    let tolerance = match args.tolerance {
        Some(mm) => InForce { mm, source: Some(ToleranceSource::CommandLine) },
        None => InForce { mm: points.resolution_mm(), source: Some(ToleranceSource::Resolution) },
    };
    let form = SplineForm { tolerance_mm: tolerance.mm, ..form(args, &points) };
    let feed = args.feed.map(|per_minute| per_minute / 60.0);
    let spline = points.section(&form, feed).map_err(refused)?;
    let mut told = tell(&points, feed, Comparison::new(&machine.axes, limits), tolerance);
    let (ends, knots) = (args.spline.unwrap_or_default(), args.knots.unwrap_or_default());
    told.points = Some(Points { count: points.count(), ends, knots, geometry_spans: spline.path.spans() });
    told.counters.feed_length_mm = arc_length(&spline.path, points.counted());

    let approach = approach(&points);
    let moves: Vec<Item> = approach.iter().cloned().map(Item::Move).collect();
    let mut rapid = sections(moves.into_iter().map(Ok), machine, settings);
    let mut before: Vec<SectionItem> = rapid
        .by_ref()
        .collect::<Result<_, SectionError<std::convert::Infallible>>>()
        .map_err(|e| placed(e.to_string(), &args.file, Some(points.line(0)), None))?;
    for item in &mut before {
        if let SectionItem::Section(section) = item {
            section.marks.end = StopCause::Rapid;
            *told.stops.entry(StopCause::Rapid).or_default() += 1;
        }
    }
    drop(points);
    let mut stream = before.into_iter().chain([SectionItem::Section(spline)]).map(Ok);
    let result = consume(&mut stream)?;
    if let Some(m) = approach {
        told.comparison.add(&m);
        told.counters.rapids = 1;
        told.counters.rapid_length_mm = told.comparison.rapid_length;
    }
    Ok((result, told))
}

/// The rapid from 0 to the first way-point, if it is elsewhere.
fn approach(points: &WayPoints<'_>) -> Option<Move> {
    let (start, end) = (Point::default(), points.point(0));
    (start != end).then(|| Move {
        kind: MoveKind::Rapid,
        shape: Shape::Line,
        start,
        end,
        feed: None,
        corner: Corner::Exact,
        line: points.line(0),
    })
}

/// Counts and measures of the way-points, each chord taken for a block.
fn tell(points: &WayPoints<'_>, feed: Option<f64>, mut comparison: Comparison, tolerance: InForce) -> Told {
    let mut whole = BoundingBox { min: points.point(0), max: points.point(0) };
    let mut start = points.point(0);
    for i in 1..points.count() {
        let end = points.point(i);
        whole.hold(&end);
        comparison.add(&Move {
            kind: MoveKind::Feed,
            shape: Shape::Line,
            start,
            end,
            feed: feed.map(Feed::Speed),
            corner: Corner::Exact,
            line: points.line(i),
        });
        start = end;
    }
    Told {
        counters: Counters { bounding_box: Some(whole), ..Counters::default() },
        comparison,
        stops: BTreeMap::from([(StopCause::ProgramEnd, 1)]),
        tolerance,
        left_out_mm: 0.0,
        points: None,
    }
}

/// The spline that is asked for; a clamped one sets out along its first chord and arrives along its last.
fn form(args: &JobArgs, points: &WayPoints<'_>) -> SplineForm {
    let knots = match args.knots.unwrap_or_default() {
        args::Knots::Uniform => Knots::Uniform,
        args::Knots::Chord => Knots::Chord,
        args::Knots::Centripetal => Knots::Centripetal,
    };
    SplineForm {
        ends: match args.spline.unwrap_or_default() {
            args::Ends::NotAKnot => Ends::NotAKnot,
            args::Ends::Clamped => Ends::Clamped,
            args::Ends::Natural => Ends::Natural,
            args::Ends::Periodic => Ends::Periodic,
        },
        knots,
        end_slopes: points.end_chords(knots),
        ..SplineForm::default()
    }
}
