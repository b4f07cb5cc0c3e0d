//! Motor and load behind a spring and a damper; friction acts on the motor side.
//!
//! With d = x1 - x2 and w = v1 - v2, shaft force s = k d + c w:
//! m1 v1' = F - b v1 - Fc sign(v1) - s,   m2 v2' = s,   d' = w.
//! k and c follow from the natural frequency and damping ratio of both masses free: with the reduced mass
//! mu = m1 m2/(m1 + m2), k = mu omega^2 and c = 2 zeta omega mu.

use core::f64::consts::PI;

use planner::job::machine::{Plant, TwoMass};

use super::{MAX_SUBSTEPS, slip_direction};

/// Fewest substeps of a tick: friction events are looked for in each of them.
const MIN_SUBSTEPS: u32 = 8;
/// Largest product of the fastest rate and a substep; with it the Taylor series below ends at 1e-15.
const RATE_PER_SUBSTEP: f64 = 0.5;
/// Terms of the Taylor series of the flow: 0.5^13/13! < 1e-13 of what changes in a substep.
const TAYLOR_TERMS: u32 = 13;
/// Halvings that locate a reversal of the motor: a substep is split into 2^40 parts.
const HALVINGS: u32 = 40;
/// Most reversals followed within one substep; more would need forces that change faster than the coupling.
const REVERSALS: u32 = 4;

/// The state that the linear equations act on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct State {
    /// Way of the motor since the step began.
    travelled: f64,
    /// Velocity of the motor.
    pub(super) velocity: f64,
    /// Motor position minus load position.
    pub(super) twist: f64,
    /// Motor velocity minus load velocity.
    slip: f64,
}

/// Motor and load.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ElasticPair {
    /// Position of the motor.
    pub(super) position: f64,
    pub(super) state: State,
    inverse_motor: f64,
    inverse_load: f64,
    viscous: f64,
    coulomb: f64,
    stiffness: f64,
    damper: f64,
    substeps: u32,
    substep_s: f64,
}

impl ElasticPair {
    /// `None` when the coupling would need more than [`MAX_SUBSTEPS`].
    pub(super) fn new(plant: &Plant, two: &TwoMass, tick_s: f64, position: f64) -> Option<Self> {
        let load = plant.inertia * two.load_share;
        let motor = plant.inertia - load;
        let reduced = motor * load / plant.inertia;
        let omega = 2.0 * PI * two.frequency_hz;
        let rate = omega * (2.0 * two.damping).max(1.0) + plant.viscous / motor;
        let needed = (rate * tick_s / RATE_PER_SUBSTEP).ceil();
        if needed.is_nan() || needed > f64::from(MAX_SUBSTEPS) {
            return None;
        }
        let substeps = (needed as u32).max(MIN_SUBSTEPS);
        Some(Self {
            position,
            state: State { travelled: 0.0, velocity: 0.0, twist: 0.0, slip: 0.0 },
            inverse_motor: 1.0 / motor,
            inverse_load: 1.0 / load,
            viscous: plant.viscous,
            coulomb: plant.coulomb,
            stiffness: reduced * omega * omega,
            damper: 2.0 * two.damping * omega * reduced,
            substeps,
            substep_s: tick_s / f64::from(substeps),
        })
    }

    pub(super) fn advance(&mut self, effort: f64) {
        for _ in 0..self.substeps {
            self.substep(effort);
        }
    }

    fn shaft(&self, s: &State) -> f64 {
        self.stiffness * s.twist + self.damper * s.slip
    }

    fn substep(&mut self, effort: f64) {
        let mut left = self.substep_s;
        let mut state = State { travelled: 0.0, ..self.state };
        for _ in 0..REVERSALS {
            let direction = slip_direction(state.velocity, effort - self.shaft(&state), self.coulomb);
            let end = self.flow(&state, effort, direction, left);
            let reversed = self.coulomb > 0.0 && direction.is_some_and(|d| end.velocity * d < 0.0);
            if !reversed {
                state = end;
                break;
            }
            let (mut early, mut late) = (0.0, left);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (early + late);
                let there = self.flow(&state, effort, direction, middle);
                if direction.is_some_and(|d| there.velocity * d < 0.0) {
                    late = middle
                } else {
                    early = middle
                }
            }
            state = self.flow(&state, effort, direction, early);
            // The load keeps its own velocity while the motor's is set to the zero it has reached.
            state.slip -= state.velocity;
            state.velocity = 0.0;
            left -= early;
        }
        self.position += state.travelled;
        self.state = state;
    }

    /// The state after `t`, friction acting along `direction`, or the motor held when `None`: Taylor series of
    /// the exact solution.
    fn flow(&self, from: &State, effort: f64, direction: Option<f64>, t: f64) -> State {
        let mut sum = *from;
        let mut term = *from;
        for k in 1..=TAYLOR_TERMS {
            let input = match direction {
                Some(d) if k == 1 => effort - self.coulomb * d,
                _ => 0.0,
            };
            term = self.derivative(&term, input, direction.is_some()).scaled(t / f64::from(k));
            sum.travelled += term.travelled;
            sum.velocity += term.velocity;
            sum.twist += term.twist;
            sum.slip += term.slip;
        }
        sum
    }

    fn derivative(&self, s: &State, input: f64, motor_free: bool) -> State {
        let shaft = self.shaft(s);
        let motor =
            if motor_free { (input - self.viscous * s.velocity - shaft) * self.inverse_motor } else { 0.0 };
        State {
            travelled: s.velocity,
            velocity: motor,
            twist: s.slip,
            slip: motor - shaft * self.inverse_load,
        }
    }
}

impl State {
    fn scaled(self, f: f64) -> Self {
        Self {
            travelled: self.travelled * f,
            velocity: self.velocity * f,
            twist: self.twist * f,
            slip: self.slip * f,
        }
    }
}
