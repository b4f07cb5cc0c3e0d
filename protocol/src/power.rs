//! The power states of a drive and the ways between them, in terms of CiA 402 (IEC 61800-7-201).
//!
//! The numbers of the transitions are that standard's. "Not ready to switch on" is left out: a drive that speaks has
//! initialised itself.

use serde::{Deserialize, Serialize};

/// A power state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Power {
    /// No torque, and none may be switched on yet.
    SwitchOnDisabled,
    /// No torque; it may be switched on.
    ReadyToSwitchOn,
    /// The power stage is ready; set-points are not followed.
    SwitchedOn,
    /// Set-points are followed: the only state in which a motion can begin.
    OperationEnabled,
    /// Comes to rest, or stands after a quick stop, under torque.
    QuickStopActive,
    /// Comes to rest after a fault, under torque.
    FaultReactionActive,
    /// No torque; a fault is latched.
    Fault,
}

/// What can change a power state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum PowerEvent {
    /// Command: ready to switch on.
    Shutdown,
    /// Command: switch on.
    SwitchOn,
    /// Command: follow set-points.
    EnableOperation,
    /// Command: follow no set-points.
    DisableOperation,
    /// Command: no torque, at once.
    DisableVoltage,
    /// Command: come to rest off the path, as fast as the limits allow.
    QuickStop,
    /// Command: forget a latched fault whose reaction has ended.
    ResetFault,
    /// The drive has found a fault.
    Fault,
    /// The drive's way to rest has ended.
    Stopped,
}

use Power::{
    Fault, FaultReactionActive, OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled,
    SwitchedOn,
};
use PowerEvent as E;

/// All legal transitions: their number in the standard, from where, by what, to where.
///
/// Number 4 may be taken from [`Power::ReadyToSwitchOn`] as 3 and 4 in one; number 13 is possible everywhere but where
/// a fault is latched already.
pub const TRANSITIONS: [(u8, Power, PowerEvent, Power); 29] = [
    (2, SwitchOnDisabled, E::Shutdown, ReadyToSwitchOn),
    (3, ReadyToSwitchOn, E::SwitchOn, SwitchedOn),
    (4, SwitchedOn, E::EnableOperation, OperationEnabled),
    (4, ReadyToSwitchOn, E::EnableOperation, OperationEnabled),
    (5, OperationEnabled, E::DisableOperation, SwitchedOn),
    (6, SwitchedOn, E::Shutdown, ReadyToSwitchOn),
    (7, ReadyToSwitchOn, E::DisableVoltage, SwitchOnDisabled),
    (7, ReadyToSwitchOn, E::QuickStop, SwitchOnDisabled),
    (8, OperationEnabled, E::Shutdown, ReadyToSwitchOn),
    (9, OperationEnabled, E::DisableVoltage, SwitchOnDisabled),
    (10, SwitchedOn, E::DisableVoltage, SwitchOnDisabled),
    (10, SwitchedOn, E::QuickStop, SwitchOnDisabled),
    (11, OperationEnabled, E::QuickStop, QuickStopActive),
    (12, QuickStopActive, E::DisableVoltage, SwitchOnDisabled),
    (12, QuickStopActive, E::Stopped, SwitchOnDisabled),
    (13, SwitchOnDisabled, E::Fault, FaultReactionActive),
    (13, ReadyToSwitchOn, E::Fault, FaultReactionActive),
    (13, SwitchedOn, E::Fault, FaultReactionActive),
    (13, OperationEnabled, E::Fault, FaultReactionActive),
    (13, QuickStopActive, E::Fault, FaultReactionActive),
    (14, FaultReactionActive, E::Stopped, Fault),
    (14, FaultReactionActive, E::DisableVoltage, Fault),
    (15, Fault, E::ResetFault, SwitchOnDisabled),
    (16, QuickStopActive, E::EnableOperation, OperationEnabled),
    // What is so already.
    (0, ReadyToSwitchOn, E::Shutdown, ReadyToSwitchOn),
    (0, SwitchedOn, E::SwitchOn, SwitchedOn),
    (0, OperationEnabled, E::EnableOperation, OperationEnabled),
    (0, SwitchOnDisabled, E::DisableVoltage, SwitchOnDisabled),
    (0, QuickStopActive, E::QuickStop, QuickStopActive),
];

impl Power {
    /// Where an event leads; `None` if it is not legal here.
    pub fn after(self, event: PowerEvent) -> Option<Power> {
        TRANSITIONS.iter().find(|(_, from, by, _)| *from == self && *by == event).map(|(.., to)| *to)
    }

    /// The motor is under torque: it follows set-points, or is held by them.
    pub fn has_torque(self) -> bool {
        match self {
            OperationEnabled | QuickStopActive | FaultReactionActive => true,
            SwitchOnDisabled | ReadyToSwitchOn | SwitchedOn | Fault => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATES: [Power; 7] = [
        SwitchOnDisabled,
        ReadyToSwitchOn,
        SwitchedOn,
        OperationEnabled,
        QuickStopActive,
        FaultReactionActive,
        Fault,
    ];
    const EVENTS: [PowerEvent; 9] = [
        E::Shutdown,
        E::SwitchOn,
        E::EnableOperation,
        E::DisableOperation,
        E::DisableVoltage,
        E::QuickStop,
        E::ResetFault,
        E::Fault,
        E::Stopped,
    ];

    #[test]
    fn no_two_ways_lead_from_one_state_by_one_event() {
        for state in STATES {
            for event in EVENTS {
                let ways = TRANSITIONS.iter().filter(|(_, from, by, _)| (*from, *by) == (state, event));
                assert!(ways.count() <= 1, "{state:?} {event:?}");
            }
        }
    }

    #[test]
    fn torque_comes_by_enabling_only_and_faults_end_by_reset_only() {
        for (number, from, by, to) in TRANSITIONS {
            if to.has_torque() && !from.has_torque() {
                // A fault without torque reacts, too, so that its first cause is latched in one way.
                assert!(by == E::EnableOperation || number == 13, "{number}");
            }
            if from == Fault {
                assert_eq!((by, to), (E::ResetFault, SwitchOnDisabled));
            }
            if from == FaultReactionActive {
                assert_eq!(to, Fault);
            }
        }
        let faults = STATES.iter().filter(|s| s.after(E::Fault) == Some(FaultReactionActive));
        assert_eq!(faults.count(), 5);
    }

    #[test]
    fn the_usual_way_up_and_down() {
        let mut state = SwitchOnDisabled;
        for (event, to) in [
            (E::Shutdown, ReadyToSwitchOn),
            (E::SwitchOn, SwitchedOn),
            (E::EnableOperation, OperationEnabled),
            (E::QuickStop, QuickStopActive),
            (E::EnableOperation, OperationEnabled),
            (E::DisableOperation, SwitchedOn),
            (E::Fault, FaultReactionActive),
            (E::Stopped, Fault),
            (E::ResetFault, SwitchOnDisabled),
        ] {
            state = state.after(event).unwrap();
            assert_eq!(state, to);
        }
        assert_eq!(SwitchOnDisabled.after(E::EnableOperation), None);
        assert_eq!(Fault.after(E::EnableOperation), None);
    }
}
