//! The sample programs are what their readers expect.

use super::*;

fn sample(name: &str, machine: &Machine) -> (Vec<Item>, Counters) {
    let path = format!("{}/../jobs/{name}", env!("CARGO_MANIFEST_DIR"));
    let mut program = open(&path, machine, Options::default()).unwrap();
    let items = (&mut program).collect::<Result<_, _>>().unwrap_or_else(|e| panic!("{e}"));
    (items, program.counters().clone())
}

#[test]
fn every_sample_runs_on_both_machines() {
    for name in ["cat.ngc", "bracket.ngc", "wave.ngc"] {
        for machine in [mill(), router()] {
            let (items, counters) = sample(name, &machine);
            assert!(counters.lines + counters.arcs > 50, "{name}");
            assert_eq!(counters.zero_length, 0, "{name}");
            assert!(matches!(items.last(), Some(Item::Stop { .. })), "{name}");
        }
    }
}
#[test]
fn the_cat_has_its_size_eyes_and_holes() {
    let (items, counters) = sample("cat.ngc", &mill());
    let size = counters.feed_box.unwrap();
    let [width, height] = [0, 1].map(|i| size.max[i] - size.min[i]);
    assert!((width - 87.5).abs() < 0.1 && (height - 116.9).abs() < 0.1, "{width} {height}");
    assert_eq!((counters.arcs, counters.holes), (22, 6));
    let notes = notes(&items);
    assert!(notes.contains(&"Outline, first pass") && notes.contains(&"Whisker holes"), "{notes:?}");
}
