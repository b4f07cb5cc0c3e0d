use super::control::{ControlReader, ControlWriter};
use super::geometry::{self, GeometryReader, GeometrySpan};
use super::rules::nearest_count;
use super::span::{Span, SpanReader, SpanWriter};
use super::*;
use proptest::prelude::*;

extern crate std;
use std::vec::Vec;

/// Two geometry spans, five q spans: 100 = 30 + 50 + 20, 40 = 25 + 15.
fn small() -> (Vec<u8>, Vec<u8>) {
    let (mut shared, mut spans, mut writer) = (Vec::new(), Vec::new(), SpanWriter::default());
    geometry::write(&mut shared, GeometrySpan { length: 100, spans: 3 });
    geometry::write(&mut shared, GeometrySpan { length: 40, spans: 2 });
    writer.push(&mut spans, Some(30), None);
    writer.push(&mut spans, Some(50), Some(1000));
    writer.push(&mut spans, None, Some(1100));
    writer.push(&mut spans, Some(25), Some(1201));
    writer.push(&mut spans, None, None);
    (shared, spans)
}

#[test]
fn streams_are_pinned() {
    let (shared, spans) = small();
    assert_eq!(shared, [0xc9, 1, 1, 81, 0]);
    assert_eq!(spans, [30, 50, 0xd0, 15, 0xc8, 1, 25, 2]);
    let (mut controls, mut writer) = (Vec::new(), ControlWriter::default());
    [-5, 10, 25, 41].into_iter().for_each(|p| writer.push(&mut controls, p));
    assert_eq!(controls, [9, 30, 0, 2]);
}

#[test]
fn spans_come_back_with_their_geometry() {
    let (geometry, bytes) = small();
    let mut reader = SpanReader::new(5, false);
    let mut spans = Vec::new();
    while let Some(span) = reader.next(&geometry, &bytes).unwrap() {
        spans.push(span);
    }
    let span = |step, code, opens_geometry| Span { step, code, opens_geometry };
    let all = [
        span(30, 0, true),
        span(50, 1000, false),
        span(20, 1100, false),
        span(25, 1201, true),
        span(15, 0, false),
    ];
    assert_eq!(spans, all);
    assert_eq!(reader.finish(&geometry, &bytes), Ok(()));
    assert_eq!(reader.geometry_spans(), 2);
}

fn read(spans: u32, geometry: &[u8], bytes: &[u8]) -> Result<(), TableError> {
    let mut reader = SpanReader::new(spans, false);
    while reader.next(geometry, bytes)?.is_some() {}
    reader.finish(geometry, bytes)
}

#[test]
fn every_fault_has_its_name_and_place() {
    let (geometry, bytes) = small();
    let (g, s) = (Stream::Geometry, Stream::Spans);
    let change = |from: &[u8], at: usize, to: u8| {
        let mut changed = from.to_vec();
        changed[at] = to;
        changed
    };
    assert_eq!(read(5, &geometry, &bytes), Ok(()));
    assert_eq!(read(5, &geometry[..3], &bytes), Err(TableError::Truncated { stream: g, index: 1 }));
    assert_eq!(read(5, &geometry, &bytes[..3]), Err(TableError::Truncated { stream: s, index: 1 }));
    assert_eq!(read(4, &geometry, &bytes), Err(TableError::Count { stream: s }));
    assert_eq!(read(6, &geometry, &bytes), Err(TableError::Truncated { stream: s, index: 4 }));
    assert_eq!(read(5, &change(&geometry, 3, 1), &bytes), Err(TableError::Range { stream: g, index: 1 }));
    assert_eq!(read(5, &geometry, &change(&bytes, 0, 0)), Err(TableError::Range { stream: s, index: 0 }));
    assert_eq!(read(5, &geometry, &change(&bytes, 1, 71)), Err(TableError::Overfull { index: 1 }));
    let zero_code = [30, 50, 0, 25, 2];
    assert_eq!(read(5, &geometry, &zero_code), Err(TableError::Range { stream: s, index: 1 }));
    let long = [&bytes[..], &[0]].concat();
    assert_eq!(read(5, &geometry, &long), Err(TableError::LeftOver { stream: s }));
    let long = [&geometry[..], &[8]].concat();
    assert_eq!(read(5, &long, &bytes), Err(TableError::LeftOver { stream: g }));
}

#[test]
fn control_points_are_bounded() {
    let mut bytes = Vec::new();
    ControlWriter::default().push(&mut bytes, 1 << 62);
    let range = TableError::Range { stream: Stream::Controls, index: 0 };
    assert_eq!(ControlReader::default().next(&bytes), Err(range));
}

#[test]
fn header_fields_are_checked_by_name() {
    let still = Warp { rate: 1 << 24, acceleration: 1 << 24, jerk: 1 << 24, slope: 1, bend: 1 };
    let joint = |table, code| Joint { table, step: 5, code, lengths: [9, 9] };
    let good = TableHeader {
        version: FORMAT_VERSION,
        table: 1,
        spans: 5,
        geometry_spans: 1,
        step_exponent: -10,
        q_scale: 1.0,
        tick_ns: 1_000_000,
        geometry_bytes: 1,
        span_bytes: 1,
        margin: 5,
        warp: None,
        joint: None,
        tail: None,
    };
    assert_eq!(good.check(), Ok(()));
    assert_eq!(good.step(), 1.0 / 1024.0);
    let cases = [
        (TableHeader { version: 0, ..good }, HeaderField::Version),
        (TableHeader { spans: 4, ..good }, HeaderField::Spans),
        (TableHeader { geometry_spans: 0, ..good }, HeaderField::GeometrySpans),
        (TableHeader { geometry_spans: 6, ..good }, HeaderField::Spans),
        (TableHeader { step_exponent: -33, ..good }, HeaderField::StepExponent),
        (TableHeader { q_scale: f32::NAN, ..good }, HeaderField::QScale),
        (TableHeader { q_scale: f32::INFINITY, ..good }, HeaderField::QScale),
        (TableHeader { q_scale: 0.0, ..good }, HeaderField::QScale),
        (TableHeader { tick_ns: 0, ..good }, HeaderField::Tick),
        (TableHeader { margin: 16, ..good }, HeaderField::Margin),
        (TableHeader { warp: Some(still), ..good }, HeaderField::Warp),
        (TableHeader { joint: Some(joint(1, 0)), ..good }, HeaderField::Joint),
        (TableHeader { joint: Some(joint(good.table, 7)), ..good }, HeaderField::Joint),
        (TableHeader { tail: Some(2), ..good }, HeaderField::Tail),
        (TableHeader { tail: Some(3), ..good }, HeaderField::Tail),
    ];
    for (header, field) in cases {
        assert_eq!(header.check(), Err(TableError::Header(field)));
    }
    let limits = |velocity, jerk| Limits { velocity, acceleration: 1.0, jerk };
    assert!(limits(1.0, None).are_valid() && limits(1.0, Some(1.0)).are_valid());
    for bad in [f32::NAN, f32::INFINITY, 0.0, -1.0] {
        assert!(!limits(bad, None).are_valid() && !limits(1.0, Some(bad)).are_valid());
    }
}

proptest! {
    #[test]
    fn any_bytes_end_in_bounded_steps(
        geometry in prop::collection::vec(any::<u8>(), 0..40),
        bytes in prop::collection::vec(any::<u8>(), 0..80),
        spans in any::<u32>(),
    ) {
        let mut reader = SpanReader::new(spans, false);
        let mut read = 0;
        while let Ok(Some(span)) = reader.next(&geometry, &bytes) {
            prop_assert!(span.step > 0);
            read += 1;
            prop_assert!(read <= geometry.len() + bytes.len());
        }
        let mut reader = GeometryReader::default();
        while reader.next(&geometry).is_ok() {
            prop_assert!(reader.index() as usize <= geometry.len());
        }
        let mut reader = ControlReader::default();
        while reader.next(&bytes).is_ok() {
            prop_assert!(reader.index() as usize <= bytes.len());
        }
    }

    #[test]
    fn nearest_count_is_within_half_a_count(control in -(1i64 << 40)..1 << 40, bits in 0u8..=12) {
        let off = (nearest_count(control, bits) << bits) - control;
        prop_assert!(2 * off <= 1 << bits && -2 * off < 1 << bits);
    }
}
