//! Rows of one cell in blocks of eight lanes, and the passes over them.

use super::super::rows::{CellRows, dot};

/// Rows side by side.
pub(super) const LANES: usize = 8;
/// One number per lane.
pub(super) type Lanes = [f64; LANES];

/// Rows a.c <= 1.
#[derive(Clone, Debug)]
pub(super) struct Upper {
    a: [Lanes; 3],
    z: Lanes,
    step: Lanes,
}

/// Pairs of rows |F.c| <= 1 (acceleration) or +-F.c/(1.5 s) + phi/(1.5 s) + (s^2/3) (x.c + xi) <= 1 (jerk).
#[derive(Clone, Debug)]
pub(super) struct Pair {
    f: [Lanes; 3],
    phi: Lanes,
    z: [Lanes; 2],
    step: [Lanes; 2],
}

/// One cell: where its blocks are, and its tangent.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    /// First of the three control values, local.
    pub(super) at: u32,
    upper: [u32; 2],
    acceleration: [u32; 2],
    jerk: [u32; 2],
    /// The tangent number.
    s: f64,
    /// Bernstein coefficients of x, and their rounding.
    x: [[f64; 3]; 3],
    xi: [f64; 3],
    /// Right-hand side: 1 - eps.
    rhs: f64,
}

/// All rows of a window.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    pub(super) cells: Vec<Cell>,
    upper: Vec<Upper>,
    pairs: Vec<Pair>,
}

/// What a cell adds to the Newton system.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Normal {
    /// Sum of z/slack a a^T, upper triangle by rows.
    pub(super) m: [f64; 6],
    /// Sum of a/slack.
    pub(super) g: [f64; 3],
    /// Sum of z slack.
    pub(super) gap: f64,
}

/// What the second pass finds: how far the affine step may go, and what it would do to the gap.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Affine {
    /// Sum of z a.dc.
    pub(super) s1: f64,
    /// Sum of z (a.dc)^2/slack.
    pub(super) s2: f64,
    /// Largest of a.dc/slack.
    pub(super) rise: f64,
    /// Least of a.dc/slack.
    pub(super) fall: f64,
}

/// The two gradients of a cell the corrector needs.
pub(super) type Correction = [f64; 3];

fn splat(v: f64) -> Lanes {
    [v; LANES]
}

fn lanes(f: impl Fn(usize) -> f64) -> Lanes {
    std::array::from_fn(f)
}

#[inline(always)]
fn product(a: &[Lanes; 3], c: &[f64; 3]) -> Lanes {
    lanes(|l| a[0][l] * c[0] + a[1][l] * c[1] + a[2][l] * c[2])
}

#[inline(always)]
fn total(v: &Lanes) -> f64 {
    ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]))
}

#[inline(always)]
fn grow(sum: &mut Lanes, v: impl Fn(usize) -> f64) {
    for (l, s) in sum.iter_mut().enumerate() {
        *s += v(l);
    }
}

impl Rows {
    pub(super) fn clear(&mut self) {
        self.cells.clear();
        self.upper.clear();
        self.pairs.clear();
    }

    /// Number of rows, duplicates that fill up blocks included.
    pub(super) fn count(&self) -> f64 {
        (LANES * (self.upper.len() + 2 * self.pairs.len())) as f64
    }

    /// Packs the rows of a cell on the controls `at..at + 3`, whose rounding errors are at most `half`.
    ///
    /// A row a.c <= 1 that must survive rounding reads a.c <= 1 - |a|.half. Blocks are filled up with copies of
    /// their first row: a copy bounds nothing new, and unlike an empty row it has an honest slack.
    pub(super) fn push(&mut self, at: usize, rows: &CellRows, half: &[f64; 3], rhs: f64) {
        let loss = |a: &[f64; 3]| a[0].abs() * half[0] + a[1].abs() * half[1] + a[2].abs() * half[2];
        let tightened = |a: &[f64; 3]| {
            // Where rounding alone would use up the limit, the least share is kept: the check of the rounded
            // values decides then.
            let room = (1.0 - loss(a)).max(LEAST_ROOM);
            a.map(|v| v / room)
        };
        let first = self.upper.len() as u32;
        for chunk in rows.upper.chunks(LANES) {
            let row = |l: usize| tightened(&chunk[if l < chunk.len() { l } else { 0 }].0);
            let all: [[f64; 3]; LANES] = std::array::from_fn(row);
            let a = [0, 1, 2].map(|j| lanes(|l| all[l][j]));
            self.upper.push(Upper { a, z: splat(0.0), step: splat(0.0) });
        }
        let upper = [first, self.upper.len() as u32];
        let first = self.pairs.len() as u32;
        for chunk in rows.acceleration.chunks(LANES) {
            let row = |l: usize| tightened(&chunk[if l < chunk.len() { l } else { 0 }].0);
            let all: [[f64; 3]; LANES] = std::array::from_fn(row);
            self.push_pair(&all, splat(0.0));
        }
        let acceleration = [first, self.pairs.len() as u32];
        for start in (0..rows.jerk.len()).step_by(LANES) {
            // Copies must keep the turn of the Bernstein coefficients: 0, 1, 2, 0, ...
            let row = |l: usize| rows.jerk.get(start + l).unwrap_or(&rows.jerk[(start + l) % 3]).0;
            let all: [[f64; 3]; LANES] = std::array::from_fn(row);
            self.push_pair(&all, lanes(|l| loss(&all[l])));
        }
        let jerk = [acceleration[1], self.pairs.len() as u32];
        let xi = [0, 1, 2].map(|k| loss(&rows.x[k]));
        let cell = Cell { at: at as u32, upper, acceleration, jerk, s: 1.0, x: rows.x, xi, rhs };
        self.cells.push(cell);
    }

    fn push_pair(&mut self, all: &[[f64; 3]; LANES], phi: Lanes) {
        let f = [0, 1, 2].map(|j| lanes(|l| all[l][j]));
        self.pairs.push(Pair { f, phi, z: [splat(0.0); 2], step: [splat(0.0); 2] });
    }
}

/// Share of a limit that rounding always leaves to the solver.
const LEAST_ROOM: f64 = 0.05;

/// The jerk rows' common parts at one tangent.
#[derive(Clone, Copy)]
struct Tangent {
    /// 1/(1.5 s)
    alpha: f64,
    /// Right-hand side less beta (x.c + xi), by Bernstein coefficient.
    base: [f64; 3],
    /// beta x, by Bernstein coefficient.
    x: [[f64; 3]; 3],
}

impl Cell {
    fn tangent(&self, s: f64, c: &[f64; 3]) -> Tangent {
        let (alpha, beta) = (1.0 / (1.5 * s), s * s / 3.0);
        let base = [0, 1, 2].map(|k| self.rhs - beta * (dot(&self.x[k], c) + self.xi[k]));
        Tangent { alpha, base, x: self.x.map(|r| r.map(|v| v * beta)) }
    }

    fn range(r: [u32; 2]) -> std::ops::Range<usize> {
        r[0] as usize..r[1] as usize
    }

    fn has_jerk(&self) -> bool {
        self.jerk[0] < self.jerk[1]
    }

    /// Least slack of the jerk rows.
    fn jerk_slack(&self, pairs: &[Pair], s: f64, c: &[f64; 3]) -> f64 {
        let t = self.tangent(s, c);
        let mut least = splat(f64::INFINITY);
        for (b, p) in pairs[Self::range(self.jerk)].iter().enumerate() {
            let f = product(&p.f, c);
            for l in 0..LANES {
                let v = t.base[(LANES * b + l) % 3] - t.alpha * (p.phi[l] + f[l].abs());
                least[l] = least[l].min(v);
            }
        }
        least.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Sets the tangent that makes the least slack largest (concave in s): golden section round 1/sqrt(x).
    fn best_tangent(&mut self, pairs: &[Pair], c: &[f64; 3]) {
        let x = [0, 1, 2].map(|k| dot(&self.x[k], c).max(f64::MIN_POSITIVE));
        let (low, high) =
            (x.iter().copied().fold(f64::INFINITY, f64::min), x.iter().copied().fold(0.0, f64::max));
        let (mut a, mut b) = (0.5 / high.sqrt(), 2.0 / low.sqrt());
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let at = |s: f64| self.jerk_slack(pairs, s, c);
        let (mut p, mut q) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
        let (mut fp, mut fq) = (at(p), at(q));
        for _ in 0..24 {
            if fp > fq {
                (b, q, fq) = (q, p, fp);
                p = b - GOLDEN * (b - a);
                fp = at(p);
            } else {
                (a, p, fp) = (p, q, fq);
                q = a + GOLDEN * (b - a);
                fq = at(q);
            }
        }
        self.s = if fp > fq { p } else { q };
    }
}

/// Controls of a cell.
#[inline(always)]
fn controls(cell: &Cell, c: &[f64]) -> [f64; 3] {
    let i = cell.at as usize;
    [c[i], c[i + 1], c[i + 2]]
}

impl Rows {
    /// Sets every tangent from scratch and returns the least slack of all rows.
    pub(super) fn set_tangents(&mut self, c: &[f64]) -> f64 {
        let mut least = f64::INFINITY;
        for cell in &mut self.cells {
            let c = controls(cell, c);
            for u in &self.upper[Cell::range(cell.upper)] {
                let a = product(&u.a, &c);
                least = a.into_iter().fold(least, |m, a| m.min(cell.rhs - a));
            }
            for p in &self.pairs[Cell::range(cell.acceleration)] {
                let f = product(&p.f, &c);
                least = f.into_iter().fold(least, |m, f| m.min(cell.rhs - f.abs()));
            }
            if cell.has_jerk() {
                cell.best_tangent(&self.pairs, &c);
                least = least.min(cell.jerk_slack(&self.pairs, cell.s, &c));
            }
        }
        least
    }

    /// Moves every tangent towards the weighted mean of x that the barrier asks for.
    ///
    /// d/ds of the sum of ln(1.5 s rhs - (s^3/2) (x + xi) -+ F - phi) vanishes at s^2 = rhs sum w / sum w (x + xi)
    /// with w one over the slack; as the barrier vanishes this is the exact optimum. Every slack keeps at least
    /// 0.3 of its value: the slack is concave in s, so halving the step ends.
    pub(super) fn move_tangents(&mut self, c: &[f64]) {
        const KEPT: f64 = 0.3;
        for cell in self.cells.iter_mut().filter(|c| c.has_jerk()) {
            let c = controls(cell, c);
            let x = [0, 1, 2].map(|k| dot(&cell.x[k], &c) + cell.xi[k]);
            let t = cell.tangent(cell.s, &c);
            let (mut weight, mut moment) = (splat(0.0), splat(0.0));
            let pairs = &self.pairs[Cell::range(cell.jerk)];
            for (b, p) in pairs.iter().enumerate() {
                let f = product(&p.f, &c);
                for l in 0..LANES {
                    let k = (LANES * b + l) % 3;
                    let base = t.base[k] - t.alpha * p.phi[l];
                    let w = 1.0 / (base - t.alpha * f[l]) + 1.0 / (base + t.alpha * f[l]);
                    weight[l] += w;
                    moment[l] += w * x[k];
                }
            }
            let wanted = (cell.rhs * total(&weight) / total(&moment)).sqrt();
            if !wanted.is_finite() {
                continue;
            }
            let mut change = wanted - cell.s;
            for _ in 0..12 {
                let s = cell.s + change;
                let n = cell.tangent(s, &c);
                let mut worst = splat(f64::INFINITY);
                for (b, p) in pairs.iter().enumerate() {
                    let f = product(&p.f, &c);
                    for l in 0..LANES {
                        let k = (LANES * b + l) % 3;
                        let before = t.base[k] - t.alpha * p.phi[l];
                        let after = n.base[k] - n.alpha * p.phi[l];
                        let (down, up) = (before - t.alpha * f[l], before + t.alpha * f[l]);
                        let keep =
                            (after - n.alpha * f[l] - KEPT * down).min(after + n.alpha * f[l] - KEPT * up);
                        worst[l] = worst[l].min(keep);
                    }
                }
                if worst.into_iter().fold(f64::INFINITY, f64::min) >= 0.0 {
                    cell.s = s;
                    break;
                }
                change *= 0.5;
            }
        }
    }

    /// Sets z = mu/slack.
    pub(super) fn set_multipliers(&mut self, c: &[f64], mu: f64) {
        self.for_each_slack(c, |slack, z| *z = mu / slack);
    }

    /// Sum of max(a.c, 0)/slack: what the barrier pushes back with per unit of mu when x is scaled up.
    pub(super) fn push_back(&mut self, c: &[f64]) -> f64 {
        let mut sum = 0.0;
        self.for_each_slack(c, |slack, _| sum += (1.0 - slack).max(0.0) / slack);
        sum
    }

    fn for_each_slack(&mut self, c: &[f64], mut f: impl FnMut(f64, &mut f64)) {
        for cell in &self.cells {
            let c = controls(cell, c);
            for u in &mut self.upper[Cell::range(cell.upper)] {
                let a = product(&u.a, &c);
                (0..LANES).for_each(|l| f(cell.rhs - a[l], &mut u.z[l]));
            }
            let t = cell.tangent(cell.s, &c);
            for (p, b, jerk) in numbered(&mut self.pairs, cell) {
                let v = product(&p.f, &c);
                for (l, v) in v.into_iter().enumerate() {
                    let (base, alpha) = if jerk {
                        (t.base[(LANES * b + l) % 3] - t.alpha * p.phi[l], t.alpha)
                    } else {
                        (cell.rhs, 1.0)
                    };
                    f(base - alpha * v, &mut p.z[0][l]);
                    f(base + alpha * v, &mut p.z[1][l]);
                }
            }
        }
    }

    /// First pass over cell `i`: z takes its step, and the cell's part of the Newton matrix is summed.
    pub(super) fn normal(&mut self, i: usize, c: &[f64], step: f64) -> Normal {
        let cell = &self.cells[i];
        let c = controls(cell, c);
        let mut sum = Sums::default();
        for u in &mut self.upper[Cell::range(cell.upper)] {
            let a = product(&u.a, &c);
            for l in 0..LANES {
                u.z[l] += step * u.step[l];
            }
            let slack = lanes(|l| cell.rhs - a[l]);
            sum.add(&u.a, &u.z, &slack);
        }
        let t = cell.tangent(cell.s, &c);
        for (p, b, jerk) in numbered(&mut self.pairs, cell) {
            for side in 0..2 {
                for l in 0..LANES {
                    p.z[side][l] += step * p.step[side][l];
                }
            }
            let f = product(&p.f, &c);
            let (rows, slack) = p.sides(&f, &t, cell.rhs, b, jerk);
            sum.add(&rows[0], &p.z[0], &slack[0]);
            sum.add(&rows[1], &p.z[1], &slack[1]);
        }
        sum.finish()
    }

    /// Second pass over cell `i`: the affine step `dc` against the slacks; stores the second-order terms and adds
    /// them, as a gradient, to `correction`.
    pub(super) fn affine(&mut self, i: usize, c: &[f64], dc: &[f64], out: &mut Affine) -> Correction {
        let cell = &self.cells[i];
        let (c, dc) = (controls(cell, c), controls(cell, dc));
        let mut sum = AffineSums::default();
        for u in &mut self.upper[Cell::range(cell.upper)] {
            let a = product(&u.a, &c);
            let slack = lanes(|l| cell.rhs - a[l]);
            u.step = sum.add(&u.a, &u.z, &slack, &dc);
        }
        let t = cell.tangent(cell.s, &c);
        for (p, b, jerk) in numbered(&mut self.pairs, cell) {
            let f = product(&p.f, &c);
            let (rows, slack) = p.sides(&f, &t, cell.rhs, b, jerk);
            p.step[0] = sum.add(&rows[0], &p.z[0], &slack[0], &dc);
            p.step[1] = sum.add(&rows[1], &p.z[1], &slack[1], &dc);
        }
        sum.finish(out)
    }

    /// Third pass over cell `i`: the steps of z, and how far primal and dual may go: returns the largest of
    /// a.dc/slack and of -dz/z.
    pub(super) fn combined(&mut self, i: usize, c: &[f64], dc: &[f64], mu: f64) -> [f64; 2] {
        let cell = &self.cells[i];
        let (c, dc) = (controls(cell, c), controls(cell, dc));
        let (mut primal, mut dual) = (splat(0.0), splat(0.0));
        let mut row = |a: &[Lanes; 3], z: &Lanes, slack: &Lanes, step: &mut Lanes| {
            let d = product(a, &dc);
            for l in 0..LANES {
                let inverse = 1.0 / slack[l];
                let r = d[l] * inverse;
                let dz = (mu - step[l]) * inverse - z[l] + z[l] * r;
                step[l] = dz;
                primal[l] = if r > primal[l] { r } else { primal[l] };
                let q = -dz / z[l];
                dual[l] = if q > dual[l] { q } else { dual[l] };
            }
        };
        for u in &mut self.upper[Cell::range(cell.upper)] {
            let a = product(&u.a, &c);
            let slack = lanes(|l| cell.rhs - a[l]);
            row(&u.a, &u.z, &slack, &mut u.step);
        }
        let t = cell.tangent(cell.s, &c);
        for (p, b, jerk) in numbered(&mut self.pairs, cell) {
            let f = product(&p.f, &c);
            let (rows, slack) = p.sides(&f, &t, cell.rhs, b, jerk);
            row(&rows[0], &p.z[0], &slack[0], &mut p.step[0]);
            row(&rows[1], &p.z[1], &slack[1], &mut p.step[1]);
        }
        [primal, dual].map(|v| v.into_iter().fold(0.0, f64::max))
    }
}

/// The pairs of a cell with their number within their kind, and whether they are jerk rows.
fn numbered<'a>(pairs: &'a mut [Pair], cell: &Cell) -> impl Iterator<Item = (&'a mut Pair, usize, bool)> {
    let split = (cell.acceleration[1] - cell.acceleration[0]) as usize;
    let range = cell.acceleration[0] as usize..cell.jerk[1] as usize;
    pairs[range].iter_mut().enumerate().map(move |(i, p)| {
        let jerk = i >= split;
        (p, if jerk { i - split } else { i }, jerk)
    })
}

impl Pair {
    /// Both rows of each pair and their slacks.
    #[inline(always)]
    fn sides(
        &self,
        f: &Lanes,
        t: &Tangent,
        rhs: f64,
        block: usize,
        jerk: bool,
    ) -> ([[Lanes; 3]; 2], [Lanes; 2]) {
        if !jerk {
            let minus = self.f.map(|a| a.map(|v| -v));
            return ([self.f, minus], [lanes(|l| rhs - f[l]), lanes(|l| rhs + f[l])]);
        }
        let turn = (LANES * block) % 3;
        let pattern = |v: [f64; 3]| match turn {
            0 => [v[0], v[1], v[2], v[0], v[1], v[2], v[0], v[1]],
            1 => [v[1], v[2], v[0], v[1], v[2], v[0], v[1], v[2]],
            _ => [v[2], v[0], v[1], v[2], v[0], v[1], v[2], v[0]],
        };
        let x = [0, 1, 2].map(|j| pattern([t.x[0][j], t.x[1][j], t.x[2][j]]));
        let base = pattern(t.base);
        let alpha = t.alpha;
        let base = lanes(|l| base[l] - alpha * self.phi[l]);
        let plus = [0, 1, 2].map(|j| lanes(|l| x[j][l] + alpha * self.f[j][l]));
        let minus = [0, 1, 2].map(|j| lanes(|l| x[j][l] - alpha * self.f[j][l]));
        ([plus, minus], [lanes(|l| base[l] - alpha * f[l]), lanes(|l| base[l] + alpha * f[l])])
    }
}

#[derive(Default)]
struct Sums {
    m: [Lanes; 6],
    g: [Lanes; 3],
    gap: Lanes,
}

impl Sums {
    #[inline(always)]
    fn add(&mut self, a: &[Lanes; 3], z: &Lanes, slack: &Lanes) {
        let inverse = lanes(|l| 1.0 / slack[l]);
        let w = lanes(|l| z[l] * inverse[l]);
        let b = [0, 1, 2].map(|j| lanes(|l| w[l] * a[j][l]));
        grow(&mut self.m[0], |l| b[0][l] * a[0][l]);
        grow(&mut self.m[1], |l| b[0][l] * a[1][l]);
        grow(&mut self.m[2], |l| b[0][l] * a[2][l]);
        grow(&mut self.m[3], |l| b[1][l] * a[1][l]);
        grow(&mut self.m[4], |l| b[1][l] * a[2][l]);
        grow(&mut self.m[5], |l| b[2][l] * a[2][l]);
        for (g, a) in self.g.iter_mut().zip(a) {
            grow(g, |l| inverse[l] * a[l]);
        }
        grow(&mut self.gap, |l| z[l] * slack[l]);
    }

    fn finish(&self) -> Normal {
        Normal { m: self.m.map(|v| total(&v)), g: self.g.map(|v| total(&v)), gap: total(&self.gap) }
    }
}

#[derive(Default)]
struct AffineSums {
    g: [Lanes; 3],
    s1: Lanes,
    s2: Lanes,
    rise: Lanes,
    fall: Lanes,
}

impl AffineSums {
    #[inline(always)]
    fn add(&mut self, a: &[Lanes; 3], z: &Lanes, slack: &Lanes, dc: &[f64; 3]) -> Lanes {
        let d = product(a, dc);
        let inverse = lanes(|l| 1.0 / slack[l]);
        let r = lanes(|l| d[l] * inverse[l]);
        let t = lanes(|l| z[l] * d[l]);
        let correction = lanes(|l| t[l] * (1.0 - r[l]));
        grow(&mut self.s1, |l| t[l]);
        grow(&mut self.s2, |l| t[l] * r[l]);
        self.rise = lanes(|l| if r[l] > self.rise[l] { r[l] } else { self.rise[l] });
        self.fall = lanes(|l| if r[l] < self.fall[l] { r[l] } else { self.fall[l] });
        for (g, a) in self.g.iter_mut().zip(a) {
            grow(g, |l| correction[l] * inverse[l] * a[l]);
        }
        correction
    }

    fn finish(&self, out: &mut Affine) -> Correction {
        out.s1 += total(&self.s1);
        out.s2 += total(&self.s2);
        out.rise = self.rise.into_iter().fold(out.rise, f64::max);
        out.fall = self.fall.into_iter().fold(out.fall, f64::min);
        self.g.map(|v| total(&v))
    }
}
