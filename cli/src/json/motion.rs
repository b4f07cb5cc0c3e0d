//! The objects of `move`.

use host_sim::group::{AxisMotion, DoubleSError, GroupError, GroupMotion, Quantity, Segment, State, Sync};
use serde::Serialize;

/// One row of `move`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MoveJson {
    /// From 1.
    pub row: u64,
    /// Line in the file; 1 from the command line.
    pub line: u32,
    /// How long the longest axis takes [s].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub duration_s: Option<f64>,
    /// How the axes wait for each other in fact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sync: Option<&'static str>,
    /// Of one axis without a name: its parts of constant jerk.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phases: Option<Vec<PhaseJson>>,
    /// Of one axis without a name: where it ends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end: Option<StateJson>,
    /// Of axes with names: every one of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axes: Option<Vec<MoveAxisJson>>,
    /// Why there is no motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<MoveErrorJson>,
}

/// One axis of a row.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MoveAxisJson {
    /// What follows the underscore in the columns' names.
    pub axis: String,
    /// How long it takes [s].
    pub duration_s: f64,
    /// Its parts of constant jerk.
    pub phases: Vec<PhaseJson>,
    /// Where it ends.
    pub end: StateJson,
}

/// A part of constant jerk.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PhaseJson {
    /// How long it takes [s].
    pub duration_s: f64,
    /// Its jerk.
    pub jerk: f64,
    /// Where it starts.
    #[serde(flatten)]
    pub start: StateJson,
}

/// A state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StateJson {
    /// Position.
    pub position: f64,
    /// Velocity.
    pub velocity: f64,
    /// Acceleration.
    pub acceleration: f64,
}

/// Why a row has no motion.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MoveErrorJson {
    /// Which error it is.
    pub name: &'static str,
    /// Of which quantity, if it is of one.
    pub quantity: Option<&'static str>,
    /// The axis' name, if it has one.
    pub axis: Option<String>,
    /// What is wrong and what would be right.
    pub message: String,
}

impl MoveJson {
    /// A row of which nothing is known yet.
    pub fn row(index: usize, line: u32) -> Self {
        MoveJson {
            row: index as u64 + 1,
            line,
            duration_s: None,
            sync: None,
            phases: None,
            end: None,
            axes: None,
            error: None,
        }
    }

    /// Takes over a motion.
    pub fn take(&mut self, names: &[String], motion: &GroupMotion) {
        match (names, motion.axes.as_slice()) {
            ([name], [axis]) if name.is_empty() => {
                self.phases = Some(phases(axis));
                self.end = Some(StateJson::from(axis.end));
            }
            _ => {
                let axis = |(name, axis): (&String, &AxisMotion)| MoveAxisJson {
                    axis: name.clone(),
                    duration_s: axis.duration,
                    phases: phases(axis),
                    end: StateJson::from(axis.end),
                };
                self.axes = Some(names.iter().zip(&motion.axes).map(axis).collect());
            }
        }
    }
}

fn phases(axis: &AxisMotion) -> Vec<PhaseJson> {
    let phase = |s: &Segment<f64>| PhaseJson {
        duration_s: s.duration,
        jerk: s.jerk,
        start: StateJson::from(s.start),
    };
    axis.segments.iter().map(phase).collect()
}

impl From<State<f64>> for StateJson {
    fn from(s: State<f64>) -> Self {
        StateJson { position: s.position, velocity: s.velocity, acceleration: s.acceleration }
    }
}

/// The name of a way to wait.
pub fn sync_name(sync: Sync) -> &'static str {
    match sync {
        Sync::None => "none",
        Sync::Time => "time",
        Sync::Phase => "phase",
    }
}

impl MoveErrorJson {
    /// What a group's error says.
    pub fn of(error: &GroupError, names: &[String]) -> Self {
        let (name, quantity) = match error.error {
            DoubleSError::Start(q) => ("start_not_finite", Some(q)),
            DoubleSError::Target(q) => ("target_not_finite", Some(q)),
            DoubleSError::Limit(q) => ("limit", Some(q)),
            DoubleSError::TargetOutside(q) => ("target_outside", Some(q)),
            DoubleSError::TargetUnreachable => ("target_unreachable", None),
            DoubleSError::Precision => ("precision", None),
        };
        let word = quantity.map(quantity_name);
        let what = word.unwrap_or_default();
        let message = match error.error {
            DoubleSError::Start(_) => format!("the {what} of the start is not a finite number"),
            DoubleSError::Target(_) => format!("the {what} of the target is not a finite number"),
            DoubleSError::Limit(_) => {
                format!("the limits of {what} are not finite numbers on either side of zero")
            }
            DoubleSError::TargetOutside(_) => format!("the {what} of the target is outside its limits"),
            DoubleSError::TargetUnreachable => {
                "the target's acceleration cannot be built up without breaking the \
                 velocity limit just before it"
                    .to_owned()
            }
            DoubleSError::Precision => {
                "the numbers lie too many decades apart: what was found does not arrive".to_owned()
            }
        };
        let axis = names.get(error.axis).filter(|name| !name.is_empty()).cloned();
        MoveErrorJson { name, quantity: word, axis, message }
    }
}

fn quantity_name(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Position => "position",
        Quantity::Velocity => "velocity",
        Quantity::Acceleration => "acceleration",
        Quantity::Jerk => "jerk",
    }
}
