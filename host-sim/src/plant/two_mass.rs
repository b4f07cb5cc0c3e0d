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
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
    /// The flow over a whole substep, motor held and motor free.
    whole: [Transition; 2],
}

/// What a substep makes of a unit of velocity, twist, slip and input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Transition([State; 4]);

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
        let mut pair = Self {
            position,
            state: State::default(),
            inverse_motor: 1.0 / motor,
            inverse_load: 1.0 / load,
            viscous: plant.viscous,
            coulomb: plant.coulomb,
            stiffness: reduced * omega * omega,
            damper: 2.0 * two.damping * omega * reduced,
            substeps,
            substep_s: tick_s / f64::from(substeps),
            whole: [Transition::default(); 2],
        };
        pair.whole = [pair.transition(None), pair.transition(Some(0.0))];
        Some(pair)
    }

    /// The flow over a whole substep, `free` as the input of [`Self::flow`].
    fn transition(&self, free: Option<f64>) -> Transition {
        let zero = State::default();
        let over = |from: State| self.flow(&from, free, self.substep_s);
        let input = if free.is_some() { self.flow(&zero, Some(1.0), self.substep_s) } else { zero };
        Transition([
            over(State { velocity: 1.0, ..zero }),
            over(State { twist: 1.0, ..zero }),
            over(State { slip: 1.0, ..zero }),
            input,
        ])
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
            let input = direction.map(|d| effort - self.coulomb * d);
            let end = if left == self.substep_s {
                self.whole[usize::from(input.is_some())].apply(&state, input.unwrap_or(0.0))
            } else {
                self.flow(&state, input, left)
            };
            let reversed = self.coulomb > 0.0 && direction.is_some_and(|d| end.velocity * d < 0.0);
            if !reversed {
                state = end;
                break;
            }
            let (mut early, mut late) = (0.0, left);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (early + late);
                let there = self.flow(&state, input, middle);
                if direction.is_some_and(|d| there.velocity * d < 0.0) {
                    late = middle
                } else {
                    early = middle
                }
            }
            state = self.flow(&state, input, early);
            // The load keeps its own velocity while the motor's is set to the zero it has reached.
            state.slip -= state.velocity;
            state.velocity = 0.0;
            left -= early;
        }
        self.position += state.travelled;
        self.state = state;
    }

    /// The state after `t` under `input`, effort less friction, or with the motor held when `None`: Taylor series
    /// of the exact solution.
    fn flow(&self, from: &State, input: Option<f64>, t: f64) -> State {
        let mut sum = *from;
        let mut term = *from;
        for k in 1..=TAYLOR_TERMS {
            // A constant input drives the first derivative only.
            let driven = if k == 1 { input.unwrap_or(0.0) } else { 0.0 };
            term = State::default().plus(&self.derivative(&term, driven, input.is_some()), t / f64::from(k));
            sum = sum.plus(&term, 1.0);
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
    /// This state and `factor` times another.
    fn plus(self, other: &Self, factor: f64) -> Self {
        Self {
            travelled: self.travelled + factor * other.travelled,
            velocity: self.velocity + factor * other.velocity,
            twist: self.twist + factor * other.twist,
            slip: self.slip + factor * other.slip,
        }
    }
}

impl Transition {
    /// The state after the substep; what was travelled is counted from its start.
    fn apply(&self, from: &State, input: f64) -> State {
        let [velocity, twist, slip, driven] = &self.0;
        State::default()
            .plus(velocity, from.velocity)
            .plus(twist, from.twist)
            .plus(slip, from.slip)
            .plus(driven, input)
    }
}
