use super::*;
use proptest::prelude::*;

/// A table with three geometry spans and nine q spans; codes and control points vary.
pub(crate) fn sample(bumps: &[i64; 6], codes: [u32; 7]) -> FeedTable {
    let line = [0, 2000, 6000, 12_000, 15_000, 16_000];
    let axis = |offset: i64| GridAxis {
        lsb: 1.0 / 8000.0,
        controls: line.iter().zip(bumps).map(|(p, bump)| p + bump + offset).collect(),
    };
    let path = GridPath {
        step: 1.0 / 256.0,
        breaks: vec![0, 1024, 1600, 2048],
        axes: vec![axis(0), axis(-80_000_000)],
    };
    let steps = vec![100, 150, 300, 474, 576, 200, 100, 90, 58];
    FeedTable { path, steps, q_scale: 1e-6, codes: codes.to_vec() }
}

pub(crate) const CODES: [u32; 7] = [9000, 14_000, 17_000, 16_000, 14_000, 11_000, 8000];

/// For drives of 1 kHz.
pub(crate) fn target() -> Target {
    Target { tick_ns: 1_000_000, override_rule: OverrideRule::default(), axes: scales() }
}

pub(crate) fn scales() -> Vec<AxisScale> {
    let limits = AxisLimits { velocity: 100.0, acceleration: 1000.0, jerk: f64::INFINITY };
    vec![AxisScale { counts_per_unit: 1000.0, limits }; 2]
}

fn packed() -> Packed {
    pack(&sample(&[0; 6], CODES), 7, &target()).unwrap()
}

#[test]
fn headers_say_what_the_table_is() {
    let packed = packed();
    let header = packed.header;
    assert_eq!((header.table, header.spans, header.geometry_spans), (7, 9, 3));
    assert_eq!((header.step_exponent, header.tick_ns), (-8, 1_000_000));
    let axis = packed.axes[1].header;
    assert_eq!((axis.axis, axis.fraction_bits, axis.start, axis.end), (1, 3, -10_000_000, -9_998_000));
    assert_eq!(axis.limits, Limits { velocity: 1e5, acceleration: 1e6, jerk: None });
}

#[test]
fn sizes_add_up() {
    let packed = packed();
    let bytes = packed.bytes();
    assert_eq!((bytes.spans, bytes.geometry_spans, bytes.axes), (9, 3, 2));
    assert_eq!(bytes.shared as usize, packed.shared.len());
    let controls: usize = packed.axes.iter().map(|axis| axis.controls.len()).sum();
    assert_eq!(bytes.total(), bytes.shared + controls as u64 + bytes.headers);
    assert!(bytes.shared_per_span() <= 5.0, "{bytes:?}");
}

#[test]
fn what_the_format_cannot_express_is_refused_by_name() {
    let good = sample(&[0; 6], CODES);
    let refuse = |change: &dyn Fn(&mut FeedTable)| {
        let mut table = good.clone();
        change(&mut table);
        pack(&table, 0, &target()).unwrap_err()
    };
    let rule = |error| PackError::Rule(error);
    let axis = |error| PackError::AxisRule { axis: 0, error };
    assert_eq!(refuse(&|t| t.steps.truncate(4)), PackError::Shape("spans"));
    assert_eq!(refuse(&|t| t.codes.truncate(4)), PackError::Shape("spans and codes"));
    assert_eq!(refuse(&|t| t.codes[2] = 0), PackError::Shape("spans or codes of zero"));
    assert_eq!(refuse(&|t| t.path.breaks[0] = 1), PackError::Shape("geometry knots"));
    assert_eq!(refuse(&|t| t.path.breaks[1] += 1), PackError::Shape("q spans and geometry knots"));
    assert_eq!(refuse(&|t| t.steps[8] += 1), PackError::Shape("q spans and geometry knots"));
    assert_eq!(refuse(&|t| t.path.axes[1].controls.truncate(3)), PackError::Shape("control points"));
    assert_eq!(refuse(&|t| t.path.axes.truncate(1)), PackError::Shape("axes"));
    assert_eq!(refuse(&|t| t.path.step = 0.3), PackError::Step { step: 0.3 });
    let unit = PackError::ControlUnit { axis: 0, counts: 0.3 };
    assert_eq!(refuse(&|t| t.path.axes[0].lsb = 0.0003), unit);
    assert_eq!(refuse(&|t| t.codes[2] = 65_535), rule(TableError::Bend { index: 2 }));
    assert_eq!(refuse(&|t| t.q_scale = 1e-13), rule(TableError::Slow { index: 0 }));
    assert_eq!(refuse(&|t| t.q_scale = 1e4), rule(TableError::Fast { index: 0 }));
    assert_eq!(refuse(&|t| t.q_scale = f32::NAN), rule(TableError::Slow { index: 0 }));
    let far = 2000 + (8 << 20);
    assert_eq!(refuse(&|t| t.path.axes[0].controls[2] = far), axis(TableError::ControlStep { index: 2 }));
    let range = TableError::Range { stream: Stream::Controls, index: 0 };
    assert_eq!(refuse(&|t| t.path.axes[0].controls[0] = i64::MIN), axis(range));
    let mut limits = scales();
    limits[1].limits.velocity = f64::NAN;
    assert_eq!(pack(&good, 0, &Target { axes: limits, ..target() }), Err(PackError::Limits { axis: 1 }));
}

#[test]
fn frames_carry_every_byte() {
    use protocol::bus::{FrameSize, Node, data};
    let (packed, node) = (packed(), Node::new(9).unwrap());
    for (size, units) in [(FrameSize::Classic, 1), (FrameSize::Fd, 12)] {
        for axis in [None, Some(1)] {
            let part = packed.part(axis);
            let mut bytes = Vec::<u8>::new();
            for k in 0.. {
                let Some(frame) = packed.data_frame(axis, node, size, k * units) else { break };
                let data = data::parse(frame.data()).unwrap();
                assert_eq!((frame.id(), data.tag), (if axis.is_some() { 0x309 } else { 0x300 }, 7));
                assert_eq!(data.unit as usize * data::UNIT, bytes.len());
                bytes.extend(
                    data.bytes.iter().take(units as usize * data::UNIT).take(part.len() - bytes.len()),
                );
            }
            assert_eq!(bytes, part);
        }
    }
}

proptest! {
    #[test]
    fn tables_return_exactly(
        bumps in prop::array::uniform6(-500i64..500),
        codes in prop::array::uniform7(0u32..600),
        number in any::<u32>(),
    ) {
        let table = sample(&bumps, std::array::from_fn(|i| CODES[i] + codes[i]));
        let packed = pack(&table, number, &target()).unwrap();
        let lsbs: Vec<f64> = table.path.axes.iter().map(|axis| axis.lsb).collect();
        prop_assert_eq!(unpack(&packed, &lsbs), Ok(table));
    }

    #[test]
    fn damaged_streams_never_panic(
        at in any::<prop::sample::Index>(),
        value in any::<u8>(),
        cut in any::<prop::sample::Index>(),
        spans in any::<u32>(),
    ) {
        let mut packed = packed();
        let i = at.index(packed.shared.len());
        packed.shared[i] = value;
        packed.axes[0].controls.truncate(cut.index(20));
        packed.header.spans = if spans % 4 == 0 { spans } else { packed.header.spans };
        if let Ok(table) = unpack(&packed, &[1.0, 1.0]) {
            prop_assert_eq!(table.codes.len() + 2, table.steps.len());
        }
    }
}
