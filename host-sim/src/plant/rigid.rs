//! One mass with viscous and Coulomb friction.

use planner::job::machine::Plant;

use super::slip_direction;

/// Below this product of friction rate and time the responses are summed as series: their closed forms cancel.
const SERIES_BELOW: f64 = 1e-3;

/// m v' = F - b v - Fc sign(v), solved exactly over each tick.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RigidBody {
    pub(super) position: f64,
    pub(super) velocity: f64,
    inverse_mass: f64,
    /// b / m [1/s].
    rate: f64,
    coulomb: f64,
    tick_s: f64,
    /// Responses over a whole tick, the usual case.
    whole: Response,
}

/// Solution of v' = -rate v + a over a time t: v(t) = v e + a phi, x(t) = x + v phi + a psi.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Response {
    decay: f64,
    phi: f64,
    psi: f64,
}

impl Response {
    fn over(rate: f64, t: f64) -> Self {
        let y = rate * t;
        if y < SERIES_BELOW {
            let phi = t * (1.0 - y / 2.0 * (1.0 - y / 3.0 * (1.0 - y / 4.0 * (1.0 - y / 5.0))));
            let psi = t * t / 2.0 * (1.0 - y / 3.0 * (1.0 - y / 4.0 * (1.0 - y / 5.0)));
            Self { decay: 1.0 - rate * phi, phi, psi }
        } else {
            let phi = -(-y).exp_m1() / rate;
            Self { decay: (-y).exp(), phi, psi: (t - phi) / rate }
        }
    }
}

impl RigidBody {
    pub(super) fn new(plant: &Plant, tick_s: f64, position: f64) -> Self {
        let rate = plant.viscous / plant.inertia;
        Self {
            position,
            velocity: 0.0,
            inverse_mass: 1.0 / plant.inertia,
            rate,
            coulomb: plant.coulomb,
            tick_s,
            whole: Response::over(rate, tick_s),
        }
    }

    pub(super) fn advance(&mut self, effort: f64) {
        let Some(direction) = slip_direction(self.velocity, effort, self.coulomb) else { return };
        let acceleration = (effort - self.coulomb * direction) * self.inverse_mass;
        let velocity = self.velocity * self.whole.decay + acceleration * self.whole.phi;
        if velocity * direction >= 0.0 {
            self.position += self.velocity * self.whole.phi + acceleration * self.whole.psi;
            self.velocity = velocity;
            return;
        }
        // The mass comes to a halt inside the tick: v + (a - rate v) t + ... = 0 at t = ln(1 + rate r)/rate.
        let undamped = -self.velocity / acceleration;
        let y = self.rate * undamped;
        let halt =
            if y < SERIES_BELOW { undamped * (1.0 - y / 2.0 + y * y / 3.0) } else { y.ln_1p() / self.rate };
        let until = Response::over(self.rate, halt);
        self.position += self.velocity * until.phi + acceleration * until.psi;
        self.velocity = 0.0;
        // From rest under a constant effort it either stays or moves off one way for good.
        if let Some(direction) = slip_direction(0.0, effort, self.coulomb) {
            let acceleration = (effort - self.coulomb * direction) * self.inverse_mass;
            let rest = Response::over(self.rate, (self.tick_s - halt).max(0.0));
            self.position += acceleration * rest.psi;
            self.velocity = acceleration * rest.phi;
        }
    }
}
