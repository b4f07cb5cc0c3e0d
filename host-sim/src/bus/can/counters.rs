//! Error counters of a CAN controller, and what they make of it (ISO 11898-1, fault confinement).

/// What a controller may do on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorState {
    /// Its error flags destroy frames.
    Active,
    /// The same, with a counter at [`ErrorCounters::WARNING`] or above.
    Warning,
    /// Nobody sees its error flags, and it waits longer between its frames.
    Passive,
    /// It neither sends nor receives.
    BusOff,
}

/// Transmit and receive error counter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ErrorCounters {
    transmit: u16,
    receive: u16,
}

impl ErrorCounters {
    /// A counter from which on the controller warns.
    pub const WARNING: u16 = 96;
    /// A counter from which on it is error passive.
    pub const PASSIVE: u16 = 128;
    /// A transmit counter from which on it is off the bus.
    pub const BUS_OFF: u16 = 256;

    /// The transmit error counter.
    pub fn transmit(&self) -> u16 {
        self.transmit
    }

    /// The receive error counter.
    pub fn receive(&self) -> u16 {
        self.receive
    }

    /// What the controller may do.
    pub fn state(&self) -> ErrorState {
        let most = self.transmit.max(self.receive);
        if self.transmit >= Self::BUS_OFF {
            ErrorState::BusOff
        } else if most >= Self::PASSIVE {
            ErrorState::Passive
        } else if most >= Self::WARNING {
            ErrorState::Warning
        } else {
            ErrorState::Active
        }
    }

    /// A frame of its own was destroyed.
    pub fn transmit_failed(&mut self) {
        self.transmit = (self.transmit + 8).min(Self::BUS_OFF);
    }

    /// Nobody has acknowledged a frame of its own: an error passive controller that is alone does not count that, so that it
    /// never goes off the bus for it.
    pub fn unacknowledged(&mut self) {
        if self.state() != ErrorState::Passive {
            self.transmit_failed();
        }
    }

    /// A frame of its own has crossed.
    pub fn transmitted(&mut self) {
        self.transmit = self.transmit.saturating_sub(1);
    }

    /// A frame of another one was destroyed; `first` if it was this controller that has seen the error by itself.
    pub fn receive_failed(&mut self, first: bool) {
        // Behind its own error flag it sees the flags of all others.
        let by = if first { 1 + 8 } else { 1 };
        self.receive = (self.receive + by).min(Self::BUS_OFF - 1);
    }

    /// A frame of another one has come.
    pub fn received(&mut self) {
        // Back into the range from 119 to 127 that the standard leaves open.
        self.receive = if self.receive >= Self::PASSIVE { 119 } else { self.receive.saturating_sub(1) };
    }

    /// It is back from being off the bus.
    pub fn recovered(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sender_whose_frames_fail_is_passive_after_16_and_off_after_32() {
        let mut counters = ErrorCounters::default();
        let states: Vec<ErrorState> = (0..32)
            .map(|_| {
                counters.transmit_failed();
                counters.state()
            })
            .collect();
        assert_eq!(states.iter().position(|s| *s == ErrorState::Warning), Some(11));
        assert_eq!(states.iter().position(|s| *s == ErrorState::Passive), Some(15));
        assert_eq!(states.iter().position(|s| *s == ErrorState::BusOff), Some(31));
        counters.recovered();
        assert_eq!((counters.state(), counters.transmit()), (ErrorState::Active, 0));
    }

    #[test]
    fn a_sender_that_is_alone_stays_passive_for_ever() {
        let mut counters = ErrorCounters::default();
        (0..1000).for_each(|_| counters.unacknowledged());
        assert_eq!((counters.state(), counters.transmit()), (ErrorState::Passive, 128));
        counters.transmitted();
        assert_eq!((counters.state(), counters.transmit()), (ErrorState::Warning, 127));
    }

    #[test]
    fn receivers_become_passive_but_never_leave() {
        let mut counters = ErrorCounters::default();
        (0..127).for_each(|_| counters.receive_failed(false));
        assert_eq!(counters.state(), ErrorState::Warning);
        (0..1000).for_each(|_| counters.receive_failed(true));
        assert_eq!((counters.state(), counters.receive()), (ErrorState::Passive, 255));
        counters.received();
        assert_eq!((counters.state(), counters.receive()), (ErrorState::Warning, 119));
        counters.received();
        assert_eq!(counters.receive(), 118);
    }
}
