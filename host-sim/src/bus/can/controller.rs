//! One controller on the simulated bus: its settings, its queues and what it has gone through.

use std::collections::VecDeque;

use super::counters::{ErrorCounters, ErrorState};
use super::source::Source;
use crate::bus::{Frame, FrameSize, Nanoseconds, Received};

/// How a controller comes back from being off the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Recovery {
    /// By itself, after 128 times 11 recessive bits.
    #[default]
    Automatic,
    /// After 128 times 11 recessive bits from [`super::CanBus::recover`] on, as FDCAN does.
    Manual,
}

/// How a controller is set up, and in what it is defective.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Controller {
    /// Frames that it can read and that it sends: the bus' format, or a wrong one.
    pub format: Option<FrameSize>,
    /// How it comes back.
    pub recovery: Recovery,
    /// Frames that may wait to be sent; more are refused.
    pub send_depth: usize,
    /// Received frames that may wait to be taken; the newest is lost when there are more.
    pub receive_depth: usize,
    /// A frame that was destroyed is not sent again.
    pub one_shot: bool,
    /// Takes part in nothing but reading: no acknowledgement, no error flags.
    pub listen_only: bool,
    /// Probability that a frame of its own is garbled on its way out.
    pub garbles: f64,
    /// Probability that it reads a sound frame of another one as garbled.
    pub misreads: f64,
}

impl Default for Controller {
    fn default() -> Self {
        Self {
            format: None,
            recovery: Recovery::Automatic,
            send_depth: usize::MAX,
            receive_depth: usize::MAX,
            one_shot: false,
            listen_only: false,
            garbles: 0.0,
            misreads: 0.0,
        }
    }
}

impl Controller {
    /// A controller with a wrong bit rate: it understands nobody, and nobody understands it.
    pub fn out_of_rate() -> Self {
        Self { garbles: 1.0, misreads: 1.0, ..Self::default() }
    }
}

/// What a controller has gone through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct History {
    /// Its frames that have crossed.
    pub sent: u64,
    /// Its frames that were destroyed, and sent again.
    pub retried: u64,
    /// Frames that found no room in its queue.
    pub refused: u64,
    /// Received frames that found no room.
    pub overruns: u64,
    /// Frames that it alone has missed.
    pub misread: u64,
    /// How often it went off the bus.
    pub bus_offs: u64,
    /// How often it came back.
    pub recoveries: u64,
}

/// Recessive sequences that a controller waits for before it comes back.
const SEQUENCES: u64 = 128;

/// A controller on the wire.
#[derive(Clone, Debug)]
pub(super) struct Station {
    pub(super) settings: Controller,
    pub(super) counters: ErrorCounters,
    pub(super) history: History,
    /// Which piece of wire it hangs on.
    pub(super) wire: usize,
    pub(super) sending: VecDeque<(Nanoseconds, Frame)>,
    pub(super) received: VecDeque<Received>,
    pub(super) sent: VecDeque<Received>,
    /// It sends nothing before.
    pub(super) ready: Nanoseconds,
    /// Off the bus and on its way back: since when it counts, and how many sequences are left.
    pub(super) returning: Option<(Nanoseconds, u64)>,
    pub(super) source: Option<Source>,
}

impl Station {
    pub(super) fn new(settings: Controller, source: Option<Source>) -> Self {
        Self {
            settings,
            counters: ErrorCounters::default(),
            history: History::default(),
            wire: 0,
            sending: VecDeque::new(),
            received: VecDeque::new(),
            sent: VecDeque::new(),
            ready: 0,
            returning: None,
            source,
        }
    }

    pub(super) fn is_off(&self) -> bool {
        self.counters.state() == ErrorState::BusOff
    }

    /// Its error flags are seen, and its acknowledgements.
    pub(super) fn flags(&self) -> bool {
        !self.settings.listen_only
            && matches!(self.counters.state(), ErrorState::Active | ErrorState::Warning)
    }

    pub(super) fn push(&mut self, now: Nanoseconds, frame: Frame) {
        if self.sending.len() < self.settings.send_depth {
            self.sending.push_back((now, frame));
        } else {
            self.history.refused += 1;
        }
    }

    /// When its oldest frame may go, and the frame.
    pub(super) fn head(&self) -> Option<(Nanoseconds, Frame)> {
        if self.is_off() || self.settings.listen_only {
            return None;
        }
        self.sending.front().map(|&(time, frame)| (time.max(self.ready), frame))
    }

    /// Takes in a sound frame.
    pub(super) fn take(&mut self, received: Received) {
        self.counters.received();
        // Sources are not interested.
        if self.source.is_some() {
            return;
        }
        if self.received.len() < self.settings.receive_depth {
            self.received.push_back(received);
        } else {
            self.history.overruns += 1;
        }
    }

    /// After a change of its counters at `now`.
    pub(super) fn confine(&mut self, now: Nanoseconds) {
        if self.is_off() && self.returning.is_none() && self.ready != Nanoseconds::MAX {
            self.history.bus_offs += 1;
            match self.settings.recovery {
                Recovery::Automatic => self.returning = Some((now, SEQUENCES)),
                // Until it is told to come back.
                Recovery::Manual => self.ready = Nanoseconds::MAX,
            }
        }
    }

    /// Is told to come back.
    pub(super) fn recover(&mut self, now: Nanoseconds) {
        if self.is_off() && self.returning.is_none() {
            (self.ready, self.returning) = (now, Some((now, SEQUENCES)));
        }
    }

    /// When it is back if the wire stays recessive from `idle` on.
    pub(super) fn back_at(&self, idle: Nanoseconds, eleven: Nanoseconds) -> Option<Nanoseconds> {
        let (since, left) = self.returning?;
        Some(since.max(idle) + left * eleven)
    }

    /// The wire was recessive from `idle` to `start`, then a frame was on it until `end`.
    pub(super) fn count_recessive(
        &mut self,
        idle: Nanoseconds,
        start: Nanoseconds,
        end: Nanoseconds,
        eleven: Nanoseconds,
    ) {
        if let Some((since, left)) = &mut self.returning {
            if *since > start {
                return;
            }
            let quiet = start.saturating_sub((*since).max(idle)) / eleven.max(1);
            // Behind each frame: delimiter of the acknowledgement, end of frame, interframe space.
            *left = left.saturating_sub(quiet + 1);
            *since = end;
        }
    }

    /// It is back at `now`.
    pub(super) fn come_back(&mut self, now: Nanoseconds) {
        self.counters.recovered();
        self.history.recoveries += 1;
        (self.returning, self.ready) = (None, now);
    }
}
