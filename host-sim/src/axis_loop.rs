//! One axis behind its drive: encoder, servo and plant, closed every control tick.

use planner::job::machine::Axis;

use crate::axis_scale::AxisScale;
use crate::encoder::Encoder;
use crate::plant::{PlantError, PlantModel};
use crate::servo::{Reference, ServoController, ServoError};
use crate::statistics::Magnitude;
use crate::trace::AxisSample;

/// A set-point as a drive gives it: counts, counts/s, counts/s^2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CountSetpoint {
    /// Position [counts].
    pub position: i64,
    /// Velocity [counts/s].
    pub velocity: f32,
    /// Acceleration [counts/s^2].
    pub acceleration: f32,
}

/// Encoder, servo and plant of one axis, with what they went through.
///
/// The plant's own origin is where the axis stood at first, so that large positions cost no precision.
#[derive(Clone, Debug)]
pub struct AxisLoop {
    scale: AxisScale,
    origin: i64,
    encoder: Encoder,
    servo: ServoController,
    plant: PlantModel,
    following: Magnitude,
    effort: Magnitude,
    saturated_ticks: u64,
    ticks: u64,
}

/// Why an axis cannot be simulated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum AxisLoopError {
    /// The mechanics.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The controller.
    #[error(transparent)]
    Servo(#[from] ServoError),
}

impl AxisLoop {
    /// An axis at rest at `origin` [counts].
    ///
    /// # Errors
    /// When a parameter of plant or servo is outside its range.
    pub fn new(axis: &Axis, tick_s: f64, origin: i64) -> Result<Self, AxisLoopError> {
        let scale = AxisScale::of(axis);
        let plant = PlantModel::new(&axis.plant, tick_s, 0.0)?;
        Ok(Self {
            scale,
            origin,
            encoder: Encoder::new(scale.si_per_count / axis.plant.encoder_counts_per_count),
            servo: ServoController::new(&axis.servo, &axis.plant, tick_s, 0.0)?,
            plant,
            following: Magnitude::default(),
            effort: Magnitude::default(),
            saturated_ticks: 0,
            ticks: 0,
        })
    }

    /// Runs the servo at `now` and the plant up to `next`, one control tick later; returns what was at `now`.
    pub fn tick(&mut self, now: &CountSetpoint, next: &CountSetpoint) -> AxisSample {
        let si = self.scale.si_per_count;
        let wanted = (now.position - self.origin) as f64 * si;
        let reference = Reference {
            position: wanted,
            velocity: f64::from(now.velocity) * si,
            acceleration: 0.5 * (f64::from(now.acceleration) + f64::from(next.acceleration)) * si,
        };
        let error = wanted - self.plant.load_position();
        let effort = self.servo.step(&reference, self.encoder.measure(self.plant.motor_position()));
        self.plant.advance(effort.value);

        let units = self.scale.units_per_count;
        let following_error = error / self.scale.si_per_unit;
        self.following.add(following_error);
        self.effort.add(effort.value);
        self.saturated_ticks += u64::from(effort.saturated);
        self.ticks += 1;
        let position = now.position as f64 * units;
        AxisSample {
            position,
            velocity: f64::from(now.velocity) * units,
            acceleration: f64::from(now.acceleration) * units,
            actual: position - following_error,
            following_error,
            effort: effort.value,
        }
    }

    /// Following error so far [axis unit].
    pub fn following(&self) -> Magnitude {
        self.following
    }

    /// Effort so far [N or N m].
    pub fn effort(&self) -> Magnitude {
        self.effort
    }

    /// Share of the ticks in which the effort limit cut the servo.
    pub fn saturated_share(&self) -> f64 {
        if self.ticks == 0 { 0.0 } else { self.saturated_ticks as f64 / self.ticks as f64 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis_scale::tests::axis;
    use planner::job::machine::{AxisKind, Unit};

    /// Half a second back and forth, starting from `origin` [counts].
    fn swing(origin: i64) -> (AxisLoop, Vec<AxisSample>) {
        let at = |k: i32| {
            let w = core::f64::consts::TAU / 250.0;
            let a = w * f64::from(k);
            let (rate, tick) = (w * 1000.0, 2000.0);
            CountSetpoint {
                position: origin + (tick * (1.0 - a.cos())).round() as i64,
                velocity: (tick * rate * a.sin()) as f32,
                acceleration: (tick * rate * rate * a.cos()) as f32,
            }
        };
        let mut axis = AxisLoop::new(&axis(AxisKind::Linear, Unit::Mm, 1000.0), 1e-3, origin).unwrap();
        let samples = (0..500).map(|k| axis.tick(&at(k), &at(k + 1))).collect();
        (axis, samples)
    }

    #[test]
    fn errors_do_not_depend_on_where_the_axis_is() {
        let ((_, near), (_, far)) = (swing(0), swing(123_456_789_012));
        for (a, b) in near.iter().zip(&far) {
            assert_eq!((a.following_error, a.effort), (b.following_error, b.effort));
        }
    }

    #[test]
    fn samples_are_in_axis_units_and_make_up_the_statistics() {
        let (axis, samples) = swing(1000);
        assert!((samples[125].position - 5.0).abs() < 1e-9);
        let peak = samples.iter().fold(0.0f64, |m, s| m.max(s.velocity));
        assert!((peak - 2.0 * core::f64::consts::TAU * 4.0).abs() < 0.1, "{peak} mm/s");
        for s in &samples {
            assert!((s.position - s.actual - s.following_error).abs() < 1e-12);
        }
        let mean = samples.iter().map(|s| s.following_error.powi(2)).sum::<f64>() / 500.0;
        assert!((axis.following().rms() / mean.sqrt() - 1.0).abs() < 1e-9);
        assert!(axis.effort().max() <= 50.0);
    }
}
