//! The drive's controller: position P over velocity PI, with velocity and acceleration fed forward.
//!
//! The velocity is measured as the encoder's way over the last tick, so it is half a tick old, and the effort acts
//! over the coming tick. Both delays are met by their own kind: the velocity loop compares with the mean set-point
//! velocity of the last tick, and the acceleration fed forward is the mean over the coming one. With exact
//! feed-forward and no friction the error is then of second order in the tick, not of first.

use planner::job::machine::Plant;
use planner::job::machine::Servo;

/// Largest product of velocity bandwidth and control tick; the sampled loop loses its damping above (its
/// characteristic polynomial z^2 + (g/2 - 1) z + g/2 has its roots on the unit circle at g = 2).
const BANDWIDTH_PER_TICK: f64 = 1.0;

/// One axis' controller, in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoController {
    gains: Servo,
    inertia: f64,
    effort_limit: f64,
    tick_s: f64,
    integral: f64,
    last_measured: f64,
    last_velocity: f64,
}

/// What the servo shall do at one tick, in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Set-point position now [m or rad].
    pub position: f64,
    /// Set-point velocity now [m/s or rad/s].
    pub velocity: f64,
    /// Mean set-point acceleration over the coming tick [m/s^2 or rad/s^2].
    pub acceleration: f64,
}

/// What the servo asks of the motor over one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Force or torque [N or N m], within the limit.
    pub value: f64,
    /// Whether the limit cut it.
    pub saturated: bool,
}

/// Why a servo cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ServoError {
    /// A gain is outside its range.
    #[error("servo gain `{gain}` is {value}, outside its range")]
    Gain {
        /// Name as in the machine file.
        gain: &'static str,
        /// The offending value.
        value: f64,
    },
    /// The velocity loop cannot be stable at this control tick.
    #[error("`velocity_bandwidth` of {bandwidth} rad/s needs a control tick below {tick_s} s")]
    TooFast {
        /// Velocity loop bandwidth [rad/s].
        bandwidth: f64,
        /// Longest tick it can work with [s].
        tick_s: f64,
    },
}

impl ServoController {
    /// A controller at rest at the measured position [m or rad].
    ///
    /// # Errors
    /// When a gain is outside its range or the velocity loop is too fast for the tick.
    pub fn new(servo: &Servo, plant: &Plant, tick_s: f64, measured: f64) -> Result<Self, ServoError> {
        let require = |gain, value: f64, ok: bool| {
            if ok && value.is_finite() { Ok(()) } else { Err(ServoError::Gain { gain, value }) }
        };
        require("position_gain", servo.position_gain, servo.position_gain > 0.0)?;
        require("velocity_bandwidth", servo.velocity_bandwidth, servo.velocity_bandwidth > 0.0)?;
        require("integral_time_s", servo.integral_time_s, servo.integral_time_s > 0.0)?;
        for (gain, value) in [
            ("velocity_feed_forward", servo.velocity_feed_forward),
            ("acceleration_feed_forward", servo.acceleration_feed_forward),
        ] {
            require(gain, value, value >= 0.0)?;
        }
        if servo.velocity_bandwidth * tick_s > BANDWIDTH_PER_TICK {
            let tick_s = BANDWIDTH_PER_TICK / servo.velocity_bandwidth;
            return Err(ServoError::TooFast { bandwidth: servo.velocity_bandwidth, tick_s });
        }
        Ok(Self {
            gains: *servo,
            inertia: plant.inertia,
            effort_limit: plant.effort_limit,
            tick_s,
            integral: 0.0,
            last_measured: measured,
            last_velocity: 0.0,
        })
    }

    /// The effort for the coming tick, from the set-point and the measured position now [m or rad].
    pub fn step(&mut self, reference: &Reference, measured: f64) -> Effort {
        let g = &self.gains;
        let velocity = (measured - self.last_measured) / self.tick_s;
        let wanted = g.position_gain * (reference.position - measured)
            + g.velocity_feed_forward * 0.5 * (reference.velocity + self.last_velocity);
        let error = wanted - velocity;
        let integral = self.integral + error * self.tick_s / g.integral_time_s;
        let feed_forward = g.acceleration_feed_forward * self.inertia * reference.acceleration;
        let proportional = g.velocity_bandwidth * self.inertia;
        let effort = |integral: f64| proportional * (error + integral) + feed_forward;
        // Anti-windup: the integral does not grow while it would push further into the limit.
        let asked = effort(integral);
        if asked.abs() <= self.effort_limit || asked * error < 0.0 {
            self.integral = integral;
        }
        self.last_measured = measured;
        self.last_velocity = reference.velocity;
        let asked = effort(self.integral);
        let value = asked.clamp(-self.effort_limit, self.effort_limit);
        Effort { value, saturated: value != asked }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encoder::Encoder;
    use crate::plant::PlantModel;

    const TICK_S: f64 = 1e-3;

    fn plant() -> Plant {
        Plant {
            inertia: 20.0,
            viscous: 0.0,
            coulomb: 0.0,
            effort_limit: 400.0,
            encoder_counts_per_count: 1.0,
            two_mass: None,
        }
    }

    fn servo() -> Servo {
        Servo {
            position_gain: 40.0,
            velocity_bandwidth: 250.0,
            integral_time_s: 0.02,
            velocity_feed_forward: 1.0,
            acceleration_feed_forward: 1.0,
        }
    }

    /// Runs `reference` through the loop and returns the errors (set-point minus position) and efforts per tick.
    fn run(
        servo: &Servo,
        plant: &Plant,
        line_m: f64,
        ticks: u32,
        reference: impl Fn(f64) -> [f64; 3],
    ) -> Vec<(f64, Effort)> {
        let encoder = Encoder::new(line_m);
        let mut model = PlantModel::new(plant, TICK_S, 0.0).unwrap();
        let mut controller = ServoController::new(servo, plant, TICK_S, 0.0).unwrap();
        (0..ticks)
            .map(|k| {
                let t = f64::from(k) * TICK_S;
                let ([position, velocity, a0], [_, _, a1]) = (reference(t), reference(t + TICK_S));
                let error = position - model.load_position();
                let now = Reference { position, velocity, acceleration: 0.5 * (a0 + a1) };
                let effort = controller.step(&now, encoder.measure(model.motor_position()));
                model.advance(effort.value);
                (error, effort)
            })
            .collect()
    }

    /// A smooth back-and-forth of 50 mm, 4 s long, at rest at both ends.
    fn sweep(t: f64) -> [f64; 3] {
        let w = core::f64::consts::PI;
        [0.025 * (1.0 - (w * t).cos()), 0.025 * w * (w * t).sin(), 0.025 * w * w * (w * t).cos()]
    }

    fn worst(errors: &[(f64, Effort)]) -> f64 {
        errors.iter().fold(0.0, |m, e| m.max(e.0.abs()))
    }

    #[test]
    fn a_step_settles_without_ringing() {
        let settled = run(&servo(), &plant(), 1e-9, 600, |_| [1e-4, 0.0, 0.0]);
        let overshoot = settled.iter().fold(0.0f64, |m, e| m.max(-e.0)) / 1e-4;
        assert!(overshoot < 0.25, "overshoot {overshoot}");
        assert!(settled[500..].iter().all(|e| e.0.abs() < 1e-7));
        let crossings = settled[..500].windows(2).filter(|w| w[0].0 * w[1].0 < 0.0).count();
        assert!(crossings <= 3, "{crossings} crossings");
    }

    #[test]
    fn exact_feed_forward_leaves_almost_no_error() {
        let with = worst(&run(&servo(), &plant(), 1e-9, 4000, sweep)[1..]);
        let without = Servo { velocity_feed_forward: 0.0, acceleration_feed_forward: 0.0, ..servo() };
        let lagging = worst(&run(&without, &plant(), 1e-9, 4000, sweep));
        assert!(with < 2e-7, "{with} m");
        // Velocity over position gain: the lag of a pure P loop.
        let lag = 0.025 * core::f64::consts::PI / 40.0;
        assert!((lagging / lag - 1.0).abs() < 0.1, "{lagging} m, expected {lag} m");
    }

    #[test]
    fn quantisation_costs_a_few_lines_only() {
        let errors = run(&servo(), &plant(), 1e-6, 4000, sweep);
        assert!(worst(&errors[1..]) < 4e-6, "{} m", worst(&errors[1..]));
    }

    #[test]
    fn the_integral_carries_friction_and_the_reversal_shows() {
        let rough = Plant { coulomb: 40.0, viscous: 20.0, ..plant() };
        let errors = run(&servo(), &rough, 1e-7, 4000, sweep);
        let away: f64 = errors[700..900].iter().fold(0.0, |m, e| m.max(e.0.abs()));
        let reversal: f64 = errors[1000..1100].iter().fold(0.0, |m, e| m.max(e.0.abs()));
        assert!(away < 2e-6 && reversal > 3.0 * away, "{away} m, {reversal} m");
    }

    #[test]
    fn the_integral_does_not_wind_up_in_the_limit() {
        // A step far beyond the limit: the way back must not be longer than the limit itself explains.
        let weak = Plant { effort_limit: 20.0, ..plant() };
        let errors = run(&servo(), &weak, 1e-9, 3000, |_| [5e-3, 0.0, 0.0]);
        assert!(errors.iter().any(|e| e.1.saturated));
        assert!(errors.iter().all(|e| e.1.value.abs() <= 20.0));
        let overshoot = errors.iter().fold(0.0f64, |m, e| m.max(-e.0)) / 5e-3;
        assert!(overshoot < 0.5, "overshoot {overshoot}");
        assert!(errors[2500..].iter().all(|e| e.0.abs() < 1e-6));
    }

    #[test]
    fn impossible_gains_are_named() {
        let refuse = |s: Servo| ServoController::new(&s, &plant(), TICK_S, 0.0).unwrap_err();
        let gain = refuse(Servo { position_gain: f64::NAN, ..servo() });
        assert!(matches!(gain, ServoError::Gain { gain: "position_gain", .. }));
        assert!(matches!(
            refuse(Servo { velocity_bandwidth: 1001.0, ..servo() }),
            ServoError::TooFast { .. }
        ));
    }
}
