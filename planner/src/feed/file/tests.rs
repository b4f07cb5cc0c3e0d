use super::*;
use crate::feed::job::PlannedSection;
use crate::feed::pack::tests::{CODES, sample, scales};
use crate::geometry::section::{BlockMark, Deviation, FeedCap, Marks, SpeedCap};
use crate::job::program::{MoveKind, StopCause};
use proptest::prelude::*;

fn header() -> FileHeader {
    let limits = scales()[0].limits;
    let axis = |name: &str| FileAxis {
        name: name.into(),
        kind: AxisKind::Linear,
        unit: Unit::Mm,
        counts_per_unit: 1000.0,
        travel: [-10.0, f64::INFINITY],
        limits,
        rapid: AxisLimits { jerk: 1e5, ..limits },
        tolerance_scale: 1.0,
    };
    FileHeader {
        name: "mill".into(),
        tick_ns: 1_000_000,
        axes: vec![axis("X"), axis("Y")],
        override_rule: OverrideRule::default(),
    }
}

fn section() -> PlannedSection {
    let speed = SpeedCap::Tangential { axes: 3, speed: 20.0 };
    let marks = Marks {
        caps: vec![FeedCap { until: 900, speed }, FeedCap { until: 2048, speed: SpeedCap::None }],
        blocks: vec![BlockMark { until: 100, line: 12 }, BlockMark { until: 2048, line: 11 }],
        deviation: Deviation { tolerance_mm: 0.01, bound_mm: 0.004, line: 12 },
        end: StopCause::ToolChange,
    };
    let limits = vec![scales()[0].limits; 2];
    PlannedSection { kind: MoveKind::Feed, limits, table: sample(&[0; 6], CODES), marks }
}

fn items() -> Vec<JobItem> {
    vec![
        JobItem::Note { text: "T1 6 mm".into(), line: 2 },
        JobItem::Section(section()),
        JobItem::Dwell { seconds: 0.5, line: 3 },
        JobItem::Section(section()),
    ]
}

fn bytes(items: &[JobItem]) -> Vec<u8> {
    let mut writer = FeedWriter::new(Vec::new(), &header()).unwrap();
    items.iter().for_each(|item| writer.push(item).unwrap());
    writer.finish().unwrap().0
}

fn read_bytes(bytes: &[u8]) -> Result<FeedFile, ReadError> {
    FeedReader::new(bytes)?.read_all()
}

#[test]
fn a_job_returns_exactly() {
    let file = read_bytes(&bytes(&items())).unwrap();
    assert_eq!(file.header, header());
    assert_eq!(file.items, items());
    assert_eq!((file.totals.items, file.totals.sections, file.totals.spans), (4, 2, 18));
}

#[test]
fn equal_neighbouring_caps_become_one() {
    let mut item = section();
    item.marks.caps = [5, 900, 2048].map(|until| FeedCap { until, speed: SpeedCap::None }).to_vec();
    let file = read_bytes(&bytes(&[JobItem::Section(item)])).unwrap();
    let JobItem::Section(found) = &file.items[0] else { panic!() };
    assert_eq!(found.marks.caps, [FeedCap { until: 2048, speed: SpeedCap::None }]);
}

#[test]
fn marks_that_do_not_cover_the_path_are_refused() {
    let push = |change: &dyn Fn(&mut PlannedSection)| {
        let mut item = section();
        change(&mut item);
        let mut writer = FeedWriter::new(Vec::new(), &header()).unwrap();
        writer.push(&JobItem::Section(item)).unwrap_err().to_string()
    };
    let refused = |what| format!("item 0: its {what} are not admissible");
    assert_eq!(push(&|s| s.marks.caps[1].until = 2047), refused("feed caps"));
    assert_eq!(push(&|s| s.marks.caps[0].speed = SpeedCap::Rate(f64::NAN)), refused("feed caps"));
    assert_eq!(push(&|s| s.marks.blocks[0].until = 3000), refused("block marks"));
    assert_eq!(push(&|s| s.marks.deviation.bound_mm = f64::NAN), refused("deviations"));
    assert_eq!(push(&|s| s.limits.truncate(1)), refused("limits"));
}

#[test]
fn files_appear_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("job.feed");
    let names = || std::fs::read_dir(folder.path()).unwrap().count();
    {
        let mut pending = PendingFile::create(&path, &header()).unwrap();
        pending.push(&items()[1]).unwrap();
        assert!(!path.exists());
    }
    assert_eq!(names(), 0);
    let totals = write(&path, &header(), &items()).unwrap();
    assert_eq!(names(), 1);
    let file = read(&path).unwrap();
    assert_eq!((file.items, file.totals), (items(), totals));
    let bad = JobItem::Dwell { seconds: f64::NAN, line: 1 };
    assert!(write(&path, &header(), [&bad]).is_err());
    assert_eq!(names(), 1);
    assert_eq!(read(&path).unwrap().totals, totals);
}

#[test]
fn every_corruption_has_its_name() {
    let good = bytes(&items());
    let changed = |at: usize, value: u8| {
        let mut bytes = good.clone();
        bytes[at] = value;
        read_bytes(&bytes).unwrap_err()
    };
    assert!(matches!(read_bytes(b""), Err(ReadError::Magic)));
    assert!(matches!(read_bytes(&[0; 100]), Err(ReadError::Magic)));
    assert!(matches!(read_bytes(b"G1 X10 Y10 F100\n"), Err(ReadError::Magic)));
    assert!(matches!(changed(8, 9), ReadError::Version { found: 9, expected: FILE_VERSION }));
    assert!(matches!(changed(10, 0), ReadError::Schema { .. }));
    assert!(matches!(changed(18, 7), ReadError::Checksum { record: 0 }));
    assert!(matches!(changed(22, 0xff), ReadError::TooLong { record: 0, .. }));
    assert!(matches!(changed(good.len() - 1, !good[good.len() - 1]), ReadError::Checksum { record: 5 }));
    assert!(matches!(read_bytes(&good[..good.len() - 1]), Err(ReadError::Truncated { record: 5 })));
    let long = [&good[..], &[0]].concat();
    assert!(matches!(read_bytes(&long), Err(ReadError::LeftOver)));
    assert!(matches!(read(std::path::Path::new("/")), Err(ReadError::Io(_))));
}

/// A file of hand-made records with good checksums.
fn forged(records: &[(u8, Vec<u8>)]) -> Result<FeedFile, ReadError> {
    let mut bytes = bytes(&[])[..18].to_vec();
    for (kind, payload) in records {
        let mut record = vec![*kind];
        record.extend((payload.len() as u32).to_le_bytes());
        record.extend(payload);
        bytes.extend(&record);
        bytes.extend(protocol::checksum::crc32(&record).to_le_bytes());
    }
    read_bytes(&bytes)
}

#[test]
fn good_checksums_do_not_make_bad_records_good() {
    let head = (1, postcard::to_allocvec(&header()).unwrap());
    let end = |totals: Totals| (3, postcard::to_allocvec(&totals).unwrap());
    let none = Totals::default();
    assert!(forged(&[head.clone(), end(none)]).is_ok());
    assert!(matches!(forged(&[end(none)]), Err(ReadError::Kind { record: 0, found: 3 })));
    assert!(matches!(forged(&[head.clone(), head.clone()]), Err(ReadError::Kind { record: 1, found: 1 })));
    assert!(matches!(forged(&[head.clone(), end(Totals { items: 1, ..none })]), Err(ReadError::Totals)));
    assert!(matches!(forged(&[head.clone(), (2, vec![9])]), Err(ReadError::Malformed { record: 1 })));
    let hostile = (2, vec![0, 0, 0xff, 0xff, 0xff, 0xff, 0x0f]);
    assert!(matches!(forged(&[head.clone(), hostile]), Err(ReadError::Malformed { record: 1 })));
    let mut bad = header();
    bad.axes[0].counts_per_unit = f64::NAN;
    let bad = (1, postcard::to_allocvec(&bad).unwrap());
    assert!(matches!(forged(&[bad]), Err(ReadError::Value { record: 0, what: "counts per unit" })));
}

#[test]
fn a_header_that_contradicts_its_table_is_refused() {
    let (mut item, _) = record::Item::from_job(&items()[1], &header(), 0, 0).unwrap();
    let record::Item::Section(section) = &mut item else { panic!() };
    section.shift_end_for_test();
    let head = (1, postcard::to_allocvec(&header()).unwrap());
    let forged = forged(&[head, (2, postcard::to_allocvec(&item).unwrap())]);
    assert!(matches!(forged, Err(ReadError::Value { record: 1, what: "table headers" })));
}

proptest! {
    #[test]
    fn mutated_files_never_panic_and_never_pass(
        changes in prop::collection::vec((any::<prop::sample::Index>(), 1u8..), 1..4),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let good = bytes(&items());
        let mut bytes = good.clone();
        for (at, change) in changes {
            let at = at.index(bytes.len());
            bytes[at] ^= change;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        prop_assume!(bytes != good);
        prop_assert!(read_bytes(&bytes).is_err());
    }

    #[test]
    fn mutated_records_with_good_checksums_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let (item, _) = record::Item::from_job(&items()[1], &header(), 0, 0).unwrap();
        let mut payload = postcard::to_allocvec(&item).unwrap();
        for (at, value) in changes {
            let at = at.index(payload.len());
            payload[at] = value;
        }
        let head = (1, postcard::to_allocvec(&header()).unwrap());
        // Without an end record nothing of it may pass.
        prop_assert!(forged(&[head, (2, payload)]).is_err());
    }
}
