//! Time per operation.

use super::model::{Mode, Operation};

/// Most operations listed one by one; what follows is added to the last.
const MOST: usize = 60;

/// Sums up times as a job goes by.
#[derive(Clone, Debug, Default)]
pub struct Operations {
    done: Vec<Operation>,
}

impl Operations {
    /// An operation begins: a tool change or a comment of the program.
    ///
    /// One that has taken no time yet is renamed, so that a header of many comments makes no empty rows.
    pub fn begin(&mut self, name: &str, line: u32) {
        let fresh =
            Operation { name: name.into(), line, feed_s: 0.0, rapid_s: 0.0, dwell_s: 0.0, feed_mm: 0.0 };
        let full = self.done.len() == MOST;
        match self.done.last_mut() {
            Some(last) if last.seconds() == 0.0 => *last = fresh,
            Some(last) if last.name == name => {}
            Some(last) if full => last.name = "everything after".into(),
            _ => self.done.push(fresh),
        }
    }

    /// Time goes by; `length_mm` counts at feed.
    pub fn spend(&mut self, mode: Mode, seconds: f64, length_mm: f64, line: u32) {
        if self.done.is_empty() {
            self.begin("program", line);
        }
        let Some(last) = self.done.last_mut() else { return };
        match mode {
            Mode::Feed => {
                last.feed_s += seconds;
                last.feed_mm += length_mm;
            }
            Mode::Rapid => last.rapid_s += seconds,
            Mode::Still => last.dwell_s += seconds,
        }
    }

    /// The operations that took time.
    pub fn finish(mut self) -> Vec<Operation> {
        self.done.retain(|o| o.seconds() > 0.0);
        self.done
    }
}

impl Operation {
    /// Everything [s].
    pub fn seconds(&self) -> f64 {
        self.feed_s + self.rapid_s + self.dwell_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_goes_to_the_operation_it_falls_in() {
        let mut o = Operations::default();
        o.begin("header", 1);
        o.begin("roughing", 2);
        o.spend(Mode::Rapid, 1.0, 50.0, 3);
        o.spend(Mode::Feed, 2.0, 30.0, 4);
        o.begin("finishing", 9);
        o.spend(Mode::Still, 0.5, 0.0, 9);
        let done = o.finish();
        assert_eq!(done.iter().map(|o| o.name.as_str()).collect::<Vec<_>>(), ["roughing", "finishing"]);
        assert_eq!((done[0].rapid_s, done[0].feed_s, done[0].feed_mm), (1.0, 2.0, 30.0));
        assert_eq!(done[1].seconds(), 0.5);
    }

    #[test]
    fn a_program_without_names_is_one_operation() {
        let mut o = Operations::default();
        o.spend(Mode::Feed, 2.0, 30.0, 4);
        assert_eq!((o.done[0].name.as_str(), o.done[0].line), ("program", 4));
    }

    #[test]
    fn no_time_is_lost_beyond_the_last_row() {
        let mut o = Operations::default();
        for i in 0..500 {
            o.begin(&format!("op {i}"), i);
            o.spend(Mode::Feed, 1.0, 1.0, i);
        }
        let done = o.finish();
        assert_eq!(done.len(), MOST);
        assert_eq!(done.iter().map(Operation::seconds).sum::<f64>(), 500.0);
    }
}
