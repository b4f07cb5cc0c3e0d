//! The machine: its axes, their limits, their drives.

use serde::{Deserialize, Serialize};

use super::program::MoveKind;

/// Most axes one job can move.
pub const MAX_AXES: usize = 9;

/// A position or direction in axis space, in axis units; entries beyond the machine's axes are zero.
pub type Point = [f64; MAX_AXES];

/// A machine, as its machine file describes it, checked and with every default filled in.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    /// Name shown in reports.
    pub name: String,
    /// Period of the drives' control loop [s].
    pub control_tick_s: f64,
    /// Path tolerance when the program says nothing [mm].
    pub tolerance_mm: f64,
    /// Path tolerance of the rotary axes [axis unit].
    pub tolerance_rotary: f64,
    /// Path tolerance of G64 without P [mm].
    pub best_speed_mm: f64,
    /// How far exact path mode (G61) may leave the contour [mm].
    pub exact_path_mm: f64,
    /// Joints of blocks when the program says nothing.
    pub corner: CornerMode,
    /// The axes, in the order of the file; at most [`MAX_AXES`].
    pub axes: Vec<Axis>,
    /// Stored position of G28, in machine coordinates.
    pub home: Point,
    /// Stored position of G30, in machine coordinates.
    pub second_home: Point,
    /// Tool lengths by tool number, for G43 H [mm].
    pub tools: Vec<Tool>,
    /// What overrides and holds may do.
    pub override_rule: OverrideRule,
}

/// How far an override may hurry the axes, and how far overrides and holds may exceed the limits of the axes while they
/// change the rate.
///
/// Slowing down costs acceleration and jerk beyond those of the path. Where the limits do not grant it, plans leave room:
/// they are made with limits that are lower by [`OverrideRule::headroom`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OverrideRule {
    /// Largest override; 1 is 100 %.
    pub most: f64,
    /// Acceleration may become so many times the limit.
    pub acceleration: f64,
    /// And jerk.
    pub jerk: f64,
}

impl Default for OverrideRule {
    fn default() -> Self {
        Self { most: 1.0, acceleration: 1.2, jerk: 1.3 }
    }
}

impl OverrideRule {
    /// What acceleration and jerk need beyond those of the largest rate, so that slowing down is brisk.
    const ROOM: [f64; 2] = [0.2, 0.3];

    /// Limits of plans are those of the axes over these: velocity, acceleration, jerk.
    pub fn headroom(&self) -> [f64; 3] {
        let [acceleration, jerk] = Self::ROOM;
        [
            self.most,
            ((self.most.powi(2) + acceleration) / self.acceleration).max(1.0),
            ((self.most.powi(3) + jerk) / self.jerk).max(1.0),
        ]
    }

    /// The same rule against the limits of plans.
    pub fn of_plans(&self) -> Self {
        let [_, acceleration, jerk] = self.headroom();
        Self { most: self.most, acceleration: self.acceleration * acceleration, jerk: self.jerk * jerk }
    }
}

/// One row of the tool table.
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    /// Tool number.
    pub number: u32,
    /// Length offset along Z [mm].
    pub length_mm: f64,
}

/// What happens where two blocks meet when the program does not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CornerMode {
    /// As G64 P with the machine's tolerance.
    Blend,
    /// As G61.
    ExactPath,
    /// As G61.1.
    ExactStop,
}

/// One axis with its drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Upper-case letter or name.
    pub name: String,
    /// Slide or turntable.
    pub kind: AxisKind,
    /// Unit of every length of this axis.
    pub unit: Unit,
    /// Drive counts per axis unit.
    pub counts_per_unit: f64,
    /// Lowest and highest machine position [axis unit].
    pub travel: [f64; 2],
    /// Limits of feed moves.
    pub limits: AxisLimits,
    /// Limits of rapid moves.
    pub rapid: AxisLimits,
    /// What plans leave to overrides: limits over these, velocity, acceleration, jerk ([`OverrideRule::headroom`]).
    pub headroom: [f64; 3],
    /// The mechanics behind the drive.
    pub plant: Plant,
    /// The drive's controller.
    pub servo: Servo,
}

/// How an axis moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum AxisKind {
    /// A slide; positions in millimetres.
    Linear,
    /// A turntable or a swivel; positions in degrees or radians.
    Rotary,
}

/// Unit of an axis position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Unit {
    /// Millimetre.
    Mm,
    /// Degree.
    Deg,
    /// Radian.
    Rad,
}

/// Velocity, acceleration and jerk bounds of one axis, symmetric, per second^n in the axis unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisLimits {
    /// Largest |velocity|.
    pub velocity: f64,
    /// Largest |acceleration|.
    pub acceleration: f64,
    /// Largest |jerk|; infinite when jerk is not limited.
    pub jerk: f64,
}

/// Which limits of the axes a plan keeps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LimitSet {
    /// Velocity and acceleration.
    VelocityAcceleration,
    /// Velocity, acceleration and jerk.
    #[default]
    VelocityAccelerationJerk,
}

impl LimitSet {
    /// The limits of `axis` that count for plans of moves of `kind`.
    pub fn of(self, axis: &Axis, kind: MoveKind) -> AxisLimits {
        let limits = match kind {
            MoveKind::Rapid => axis.rapid,
            MoveKind::Feed => axis.limits,
        };
        let [v, a, j] = axis.headroom;
        let limits = AxisLimits {
            velocity: limits.velocity / v,
            acceleration: limits.acceleration / a,
            jerk: limits.jerk / j,
        };
        match self {
            LimitSet::VelocityAcceleration => AxisLimits { jerk: f64::INFINITY, ..limits },
            LimitSet::VelocityAccelerationJerk => limits,
        }
    }
}

/// The mechanics of one axis, in generalised SI units: kg, N, m on slides; kg m^2, N m, rad on rotary axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plant {
    /// Moving mass [kg] or inertia [kg m^2], motor and load together.
    pub inertia: f64,
    /// Viscous friction [N s/m] or [N m s/rad].
    pub viscous: f64,
    /// Coulomb friction [N] or [N m].
    pub coulomb: f64,
    /// Largest motor force [N] or torque [N m].
    pub effort_limit: f64,
    /// Encoder counts per drive count (resolution of the measured position relative to the commanded one).
    pub encoder_counts_per_count: f64,
    /// Second mass behind an elastic coupling, if any.
    pub two_mass: Option<TwoMass>,
}

/// A load behind an elastic coupling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoMass {
    /// Share of the inertia on the load side, in (0, 1).
    pub load_share: f64,
    /// Natural frequency of the coupling with both masses free [Hz].
    pub frequency_hz: f64,
    /// Damping ratio of the coupling.
    pub damping: f64,
}

/// A cascaded P-PI controller with velocity and acceleration feed-forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servo {
    /// Position loop gain [1/s].
    pub position_gain: f64,
    /// Velocity loop bandwidth [rad/s]; the proportional gain is this times the inertia.
    pub velocity_bandwidth: f64,
    /// Integral time of the velocity loop [s].
    pub integral_time_s: f64,
    /// Share of the set-point velocity fed forward, 0 to 1.
    pub velocity_feed_forward: f64,
    /// Share of the set-point acceleration fed forward, 0 to 1.
    pub acceleration_feed_forward: f64,
}
