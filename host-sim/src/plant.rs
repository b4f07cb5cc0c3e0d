//! The mechanics of one axis: inertia, friction and, if wanted, an elastic coupling.
//!
//! Effort is constant over a control tick, as a sampled controller's is. Between the reversals of motion the
//! equations are linear and are solved exactly; a reversal is located in time and Coulomb friction is decided
//! there: the mass sticks while the other forces are below it. So friction never chatters and the result does not
//! depend on a step size chosen for stability. The current loop is taken as ideal.

mod rigid;
mod two_mass;

#[cfg(test)]
mod tests;

use planner::job::machine::Plant;

use rigid::RigidBody;
use two_mass::ElasticPair;

/// Most substeps one tick may need before a coupling counts as rigid at this tick.
const MAX_SUBSTEPS: u32 = 256;

/// The simulated mechanics of one axis, in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantModel(Kind);

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Rigid(RigidBody),
    Elastic(ElasticPair),
}

/// Why a plant cannot be simulated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// A parameter is outside its range.
    #[error("plant parameter `{parameter}` is {value}, outside its range")]
    Parameter {
        /// Name as in the machine file.
        parameter: &'static str,
        /// The offending value.
        value: f64,
    },
    /// The coupling swings too often per control tick.
    #[error("a coupling of {frequency_hz} Hz is rigid at this control tick; leave `two_mass` out")]
    TooStiff {
        /// Natural frequency [Hz].
        frequency_hz: f64,
    },
}

impl PlantModel {
    /// A plant at rest at `position` [m or rad], advanced in ticks of `tick_s`.
    ///
    /// # Errors
    /// When a parameter is outside its range, or the coupling is too stiff for the tick.
    pub fn new(plant: &Plant, tick_s: f64, position: f64) -> Result<Self, PlantError> {
        let require = |parameter, value: f64, ok: bool| {
            if ok && value.is_finite() { Ok(()) } else { Err(PlantError::Parameter { parameter, value }) }
        };
        require("control_tick_s", tick_s, tick_s > 0.0)?;
        require("inertia", plant.inertia, plant.inertia > 0.0)?;
        require("viscous", plant.viscous, plant.viscous >= 0.0)?;
        require("coulomb", plant.coulomb, plant.coulomb >= 0.0)?;
        require("effort_limit", plant.effort_limit, plant.effort_limit > 0.0)?;
        let lines = plant.encoder_counts_per_count;
        require("encoder_counts_per_count", lines, lines > 0.0)?;
        let Some(two) = plant.two_mass else {
            return Ok(Self(Kind::Rigid(RigidBody::new(plant, tick_s, position))));
        };
        require("load_share", two.load_share, two.load_share > 0.0 && two.load_share < 1.0)?;
        require("frequency_hz", two.frequency_hz, two.frequency_hz > 0.0)?;
        require("damping", two.damping, two.damping >= 0.0)?;
        ElasticPair::new(plant, &two, tick_s, position)
            .map(|pair| Self(Kind::Elastic(pair)))
            .ok_or(PlantError::TooStiff { frequency_hz: two.frequency_hz })
    }

    /// Moves on by one tick under a constant effort [N or N m].
    pub fn advance(&mut self, effort: f64) {
        match &mut self.0 {
            Kind::Rigid(body) => body.advance(effort),
            Kind::Elastic(pair) => pair.advance(effort),
        }
    }

    /// Position of the motor, which the encoder sees [m or rad].
    pub fn motor_position(&self) -> f64 {
        match &self.0 {
            Kind::Rigid(body) => body.position,
            Kind::Elastic(pair) => pair.position,
        }
    }

    /// Position of the load, where the tool is [m or rad].
    pub fn load_position(&self) -> f64 {
        match &self.0 {
            Kind::Rigid(body) => body.position,
            Kind::Elastic(pair) => pair.position - pair.state.twist,
        }
    }

    /// Velocity of the motor [m/s or rad/s].
    pub fn motor_velocity(&self) -> f64 {
        match &self.0 {
            Kind::Rigid(body) => body.velocity,
            Kind::Elastic(pair) => pair.state.velocity,
        }
    }
}

/// Direction of Coulomb friction on a mass with `velocity` under `force` from elsewhere: `None` when it sticks.
fn slip_direction(velocity: f64, force: f64, coulomb: f64) -> Option<f64> {
    if velocity != 0.0 {
        Some(velocity.signum())
    } else if force.abs() > coulomb {
        Some(force.signum())
    } else {
        None
    }
}
