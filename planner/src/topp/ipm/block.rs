//! Rows of the cells, lanes side by side, and the passes over them.

use super::super::lanes::{LANES, Lanes, product, scaled, totals};
use super::super::rows::{CellRows, Row, dot};
use super::band::Band;

/// Share of a limit that rounding always leaves to the solver.
const LEAST_ROOM: f64 = 0.05;

/// Rows a.c <= room.
#[derive(Clone, Debug)]
struct Upper {
    a: [Lanes; 3],
    room: Lanes,
    z: Lanes,
    dz: Lanes,
}

impl Upper {
    /// Slacks; of relations that hold, infinity: scaling does not help them.
    #[inline(always)]
    fn tried(&self, c: &[f64; 3]) -> Lanes {
        let mut slack = self.room - product(&self.a, c);
        for l in 0..LANES {
            if self.room.0[l] == 0.0 && slack.0[l] > 0.0 {
                slack.0[l] = f64::INFINITY;
            }
        }
        slack
    }
}

/// Pairs of rows: |f.c| <= room (acceleration), or +-f.c/(1.5 s) - (room - 1)/(1.5 s) + (s^2/3) (x.c + xi) <= 1
/// (jerk); room is 1 less what rounding may take.
#[derive(Clone, Debug)]
struct Pair {
    f: [Lanes; 3],
    room: Lanes,
    z: [Lanes; 2],
    dz: [Lanes; 2],
}

/// One cell: how many blocks are its own, and its tangent.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    /// First of the three control values, local.
    pub(super) at: u32,
    uppers: u16,
    bends: u8,
    jerks: u8,
    /// Blocks of one jerk coefficient.
    groups: u8,
    /// The tangent number.
    s: f64,
    /// Bernstein coefficients of x, and their rounding.
    x: [[f64; 3]; 3],
    xi: [f64; 3],
    /// Right-hand side of the jerk rows: 1 - eps.
    rhs: f64,
}

/// All rows of a window.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    pub(super) cells: Vec<Cell>,
    uppers: Vec<Upper>,
    pairs: Vec<Pair>,
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

impl Affine {
    /// Both together.
    pub(super) fn with(&self, other: &Affine) -> Affine {
        Affine {
            s1: self.s1 + other.s1,
            s2: self.s2 + other.s2,
            rise: self.rise.max(other.rise),
            fall: self.fall.min(other.fall),
        }
    }
}

/// The jerk rows' common parts at one tangent.
#[derive(Clone, Copy)]
struct Tangent {
    /// 1/(1.5 s)
    alpha: f64,
    /// Right-hand side less beta (x.c + xi), plus alpha, by Bernstein coefficient: less alpha room is what is left.
    base: [f64; 3],
    /// beta x, by Bernstein coefficient.
    x: [[f64; 3]; 3],
}

impl Tangent {
    /// Both slacks of a block with the jerks f.c.
    #[inline(always)]
    fn slacks(&self, k: usize, room: Lanes, f: Lanes) -> [Lanes; 2] {
        let base = Lanes::splat(self.base[k]).plus(room, Lanes::splat(self.alpha));
        [base.plus(f, Lanes::splat(-self.alpha)), base.plus(f, Lanes::splat(self.alpha))]
    }

    /// Both rows of a block.
    #[inline(always)]
    fn rows(&self, k: usize, f: &[Lanes; 3]) -> [[Lanes; 3]; 2] {
        let (up, down) = (Lanes::splat(self.alpha), Lanes::splat(-self.alpha));
        let x = &self.x[k];
        let (x0, x1, x2) = (Lanes::splat(x[0]), Lanes::splat(x[1]), Lanes::splat(x[2]));
        [
            [x0.plus(f[0], up), x1.plus(f[1], up), x2.plus(f[2], up)],
            [x0.plus(f[0], down), x1.plus(f[1], down), x2.plus(f[2], down)],
        ]
    }
}

/// 1/a and 1/b by one division.
#[inline(always)]
fn inverses(slack: &[Lanes; 2]) -> [Lanes; 2] {
    let inverse = Lanes::splat(1.0) / (slack[0] * slack[1]);
    [inverse * slack[1], inverse * slack[0]]
}

impl Cell {
    #[inline(always)]
    fn tangent(&self, s: f64, c: &[f64; 3]) -> Tangent {
        let (alpha, beta) = (1.0 / (1.5 * s), s * s / 3.0);
        let mut out = Tangent { alpha, base: [0.0; 3], x: [[0.0; 3]; 3] };
        for k in 0..3 {
            out.base[k] = self.rhs - beta * (dot(&self.x[k], c) + self.xi[k]) - alpha;
            for j in 0..3 {
                out.x[k][j] = self.x[k][j] * beta;
            }
        }
        out
    }

    /// The Bernstein coefficient of jerk block `b`.
    #[inline(always)]
    fn coefficient(&self, b: usize) -> usize {
        b / usize::from(self.groups)
    }

    #[inline(always)]
    fn controls(&self, c: &[f64]) -> [f64; 3] {
        let i = self.at as usize;
        [c[i], c[i + 1], c[i + 2]]
    }

    /// Least slack of the jerk rows.
    #[inline(always)]
    fn jerk_slack(&self, jerks: &[Pair], s: f64, c: &[f64; 3]) -> f64 {
        let t = self.tangent(s, c);
        let mut least = Lanes::splat(f64::INFINITY);
        for (b, p) in jerks.iter().enumerate() {
            let [up, down] = t.slacks(self.coefficient(b), p.room, product(&p.f, c));
            least = least.min(up).min(down);
        }
        least.smallest(f64::INFINITY)
    }

    /// Sets a tangent whose least slack is at least `enough`, or else as large as can be (it is concave in s): golden
    /// section round 1/sqrt(x).
    #[inline(always)]
    fn best_tangent(&mut self, jerks: &[Pair], c: &[f64; 3], enough: f64) -> f64 {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let x = [0, 1, 2].map(|k| dot(&self.x[k], c).max(f64::MIN_POSITIVE));
        let (low, high) = (x[0].min(x[1]).min(x[2]), x[0].max(x[1]).max(x[2]));
        let middle = (3.0 / (x[0] + x[1] + x[2])).sqrt();
        let slack = self.jerk_slack(jerks, middle, c);
        self.s = middle;
        if slack >= enough {
            return slack;
        }
        let (mut a, mut b) = (0.5 / high.sqrt(), 2.0 / low.sqrt());
        let at = |s: f64| self.jerk_slack(jerks, s, c);
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
        let (s, least) = if fp > fq { (p, fp) } else { (q, fq) };
        if least > slack {
            self.s = s;
        }
        least.max(slack)
    }

    /// Moves the tangent towards the weighted mean of x that the barrier asks for.
    ///
    /// d/ds of the sum of ln(1.5 s rhs - (s^3/2) (x + xi) -+ F - phi) vanishes at s^2 = rhs sum w / sum w (x + xi)
    /// with w one over the slack; as the barrier vanishes this is the exact optimum. Every slack keeps at least
    /// 0.3 of its value: the slack is concave in s, so halving the step ends.
    #[inline(always)]
    fn move_tangent(&mut self, jerks: &[Pair], c: &[f64; 3]) {
        const KEPT: f64 = 0.3;
        const HALVINGS: usize = 12;
        let t = self.tangent(self.s, c);
        let mut weights = [Lanes::ZERO; 3];
        for (b, p) in jerks.iter().enumerate() {
            let k = self.coefficient(b);
            let slack = t.slacks(k, p.room, product(&p.f, c));
            weights[k] += (slack[0] + slack[1]) / (slack[0] * slack[1]);
        }
        let (mut weight, mut moment) = (0.0, 0.0);
        for (k, w) in weights.iter().enumerate() {
            let w = w.total();
            weight += w;
            moment += w * (dot(&self.x[k], c) + self.xi[k]);
        }
        let wanted = (self.rhs * weight / moment).sqrt();
        if !wanted.is_finite() {
            return;
        }
        let mut change = wanted - self.s;
        for _ in 0..HALVINGS {
            let s = self.s + change;
            let n = self.tangent(s, c);
            let mut worst = Lanes::splat(f64::INFINITY);
            for (b, p) in jerks.iter().enumerate() {
                let k = self.coefficient(b);
                let f = product(&p.f, c);
                let (before, after) = (t.slacks(k, p.room, f), n.slacks(k, p.room, f));
                worst = worst.min(after[0] - before[0] * KEPT).min(after[1] - before[1] * KEPT);
            }
            if worst.smallest(f64::INFINITY) >= 0.0 {
                self.s = s;
                return;
            }
            change *= 0.5;
        }
    }
}

/// The blocks of one cell after another.
struct Blocks<'a> {
    uppers: &'a mut [Upper],
    pairs: &'a mut [Pair],
}

impl<'a> Blocks<'a> {
    /// Splits off the blocks of `cell`: upper, acceleration, jerk.
    #[inline(always)]
    fn next(&mut self, cell: &Cell) -> (&'a mut [Upper], &'a mut [Pair], &'a mut [Pair]) {
        let (uppers, rest) = std::mem::take(&mut self.uppers).split_at_mut(usize::from(cell.uppers));
        self.uppers = rest;
        let (bends, rest) = std::mem::take(&mut self.pairs).split_at_mut(usize::from(cell.bends));
        let (jerks, rest) = rest.split_at_mut(usize::from(cell.jerks));
        self.pairs = rest;
        (uppers, bends, jerks)
    }
}

impl Rows {
    pub(super) fn clear(&mut self) {
        self.cells.clear();
        self.uppers.clear();
        self.pairs.clear();
    }

    /// Number of rows, those that fill up blocks included.
    pub(super) fn count(&self) -> f64 {
        (LANES * (self.uppers.len() + 2 * self.pairs.len())) as f64
    }

    /// Packs the rows of a cell on the controls `at..at + 3`, whose rounding errors are at most `half`; `margin` is
    /// left below every limit.
    ///
    /// A row a.c <= 1 that must survive rounding reads a.c <= 1 - |a|.half. Blocks of upper rows are filled up with
    /// copies of their first row: a copy bounds nothing new, and unlike an empty row it has an honest slack.
    #[inline(always)]
    pub(super) fn push(&mut self, at: usize, rows: &CellRows, half: &[f64; 3], margin: f64) {
        let loss = |a: &[f64; 3]| a[0].abs() * half[0] + a[1].abs() * half[1] + a[2].abs() * half[2];
        let before = self.uppers.len();
        for chunk in rows.upper.chunks(LANES) {
            let mut block = Upper { a: [Lanes::ZERO; 3], room: Lanes::ZERO, z: Lanes::ZERO, dz: Lanes::ZERO };
            for l in 0..LANES {
                let Row { a, bound, .. } = &chunk[if l < chunk.len() { l } else { 0 }];
                // Where rounding alone would use up the limit, the least share is kept: the check of the rounded
                // values decides then. Rows without a bound are relations, which rounding does not touch.
                let room = if *bound > 0.0 { (bound - loss(a)).max(LEAST_ROOM) - margin } else { 0.0 };
                (0..3).for_each(|j| block.a[j].0[l] = a[j]);
                block.room.0[l] = room;
            }
            self.uppers.push(block);
        }
        let pair = |f: &[Lanes; 3], least: f64, margin: f64| {
            let loss = f[0].abs() * half[0] + f[1].abs() * half[1] + f[2].abs() * half[2];
            let room = (Lanes::splat(1.0) - loss).max(Lanes::splat(least)) - Lanes::splat(margin);
            Pair { f: *f, room, z: [Lanes::ZERO; 2], dz: [Lanes::ZERO; 2] }
        };
        let groups = rows.groups();
        for wide in &rows.bends {
            (0..groups).for_each(|g| self.pairs.push(pair(&wide.map(|w| w[g]), LEAST_ROOM, margin)));
        }
        for wide in &rows.jerks {
            (0..groups).for_each(|g| self.pairs.push(pair(&wide.map(|w| w[g]), f64::NEG_INFINITY, 0.0)));
        }
        self.cells.push(Cell {
            at: at as u32,
            uppers: (self.uppers.len() - before) as u16,
            bends: (rows.bends.len() * groups) as u8,
            jerks: (rows.jerks.len() * groups) as u8,
            groups: groups as u8,
            s: 1.0,
            x: rows.x,
            xi: [0, 1, 2].map(|k| loss(&rows.x[k])),
            rhs: 1.0 - margin,
        });
    }

    /// The cells with their blocks.
    #[inline(always)]
    fn split(&mut self) -> (&mut [Cell], Blocks<'_>) {
        (&mut self.cells, Blocks { uppers: &mut self.uppers, pairs: &mut self.pairs })
    }

    /// Sets every tangent from scratch and returns the least slack of all rows; below `enough` it is the largest
    /// there is.
    #[inline(always)]
    pub(super) fn set_tangents(&mut self, c: &[f64], enough: f64) -> f64 {
        let mut least = Lanes::splat(f64::INFINITY);
        let (cells, mut blocks) = self.split();
        for cell in cells {
            let (uppers, bends, jerks) = blocks.next(cell);
            let c = cell.controls(c);
            for u in uppers {
                least = least.min(u.tried(&c));
            }
            for p in bends {
                least = least.min(p.room - product(&p.f, &c).abs());
            }
            if !jerks.is_empty() {
                least = least.min(Lanes::splat(cell.best_tangent(jerks, &c, enough)));
            }
        }
        least.smallest(f64::INFINITY)
    }

    /// Sum of max(a.c, 0)/slack: what the barrier pushes back with per unit of mu when x is scaled up.
    #[inline(always)]
    pub(super) fn push_back(&mut self, c: &[f64]) -> f64 {
        let mut sum = Lanes::ZERO;
        let (cells, mut blocks) = self.split();
        for cell in cells {
            let (uppers, bends, jerks) = blocks.next(cell);
            let c = cell.controls(c);
            for u in uppers {
                let a = product(&u.a, &c);
                sum += a.max(Lanes::ZERO) / (u.room - a);
            }
            for p in bends {
                let f = product(&p.f, &c).abs();
                sum += f / (p.room - f);
            }
            let t = cell.tangent(cell.s, &c);
            for (b, p) in jerks.iter().enumerate() {
                for slack in t.slacks(cell.coefficient(b), p.room, product(&p.f, &c)) {
                    sum += (Lanes::splat(1.0) - slack).max(Lanes::ZERO) / slack;
                }
            }
        }
        sum.total()
    }

    /// Sets z = mu/slack.
    #[inline(always)]
    pub(super) fn set_multipliers(&mut self, c: &[f64], mu: f64) {
        let mu = Lanes::splat(mu);
        let (cells, mut blocks) = self.split();
        for cell in cells {
            let (uppers, bends, jerks) = blocks.next(cell);
            let c = cell.controls(c);
            for u in uppers {
                u.z = mu / (u.room - product(&u.a, &c));
                u.dz = Lanes::ZERO;
            }
            for p in bends {
                let f = product(&p.f, &c);
                p.z = [mu / (p.room - f), mu / (p.room + f)];
                p.dz = [Lanes::ZERO; 2];
            }
            let t = cell.tangent(cell.s, &c);
            for (b, p) in jerks.iter_mut().enumerate() {
                let slack = t.slacks(cell.coefficient(b), p.room, product(&p.f, &c));
                p.z = [mu / slack[0], mu / slack[1]];
                p.dz = [Lanes::ZERO; 2];
            }
        }
    }

    /// First pass: z takes its step, tangents move, and every cell adds to the Newton matrix and, per unit of mu, to
    /// `push`; returns the gap.
    #[inline(always)]
    pub(super) fn normal(&mut self, c: &[f64], step: f64, band: &mut Band, push: &mut [f64]) -> f64 {
        let step = Lanes::splat(step);
        let mut gap = Lanes::ZERO;
        let (cells, mut blocks) = self.split();
        for cell in cells {
            let (uppers, bends, jerks) = blocks.next(cell);
            let c = cell.controls(c);
            let mut sum = Sums::default();
            for u in uppers {
                u.z = u.z.plus(u.dz, step);
                let slack = u.room - product(&u.a, &c);
                let inverse = Lanes::splat(1.0) / slack;
                sum.matrix(&u.a, u.z * inverse);
                grow(&mut sum.g, &u.a, inverse);
                gap = gap.plus(u.z, slack);
            }
            for p in bends {
                p.z[0] = p.z[0].plus(p.dz[0], step);
                p.z[1] = p.z[1].plus(p.dz[1], step);
                let f = product(&p.f, &c);
                let slack = [p.room - f, p.room + f];
                let inverse = inverses(&slack);
                sum.matrix(&p.f, p.z[0] * inverse[0] + p.z[1] * inverse[1]);
                grow(&mut sum.g, &p.f, inverse[0] - inverse[1]);
                gap = gap.plus(p.z[0], slack[0]).plus(p.z[1], slack[1]);
            }
            if !jerks.is_empty() {
                cell.move_tangent(jerks, &c);
                let t = cell.tangent(cell.s, &c);
                for (b, p) in jerks.iter_mut().enumerate() {
                    p.z[0] = p.z[0].plus(p.dz[0], step);
                    p.z[1] = p.z[1].plus(p.dz[1], step);
                    let k = cell.coefficient(b);
                    let slack = t.slacks(k, p.room, product(&p.f, &c));
                    let [up, down] = t.rows(k, &p.f);
                    let inverse = inverses(&slack);
                    sum.matrix(&up, p.z[0] * inverse[0]);
                    sum.matrix(&down, p.z[1] * inverse[1]);
                    grow(&mut sum.g, &up, inverse[0]);
                    grow(&mut sum.g, &down, inverse[1]);
                    gap = gap.plus(p.z[0], slack[0]).plus(p.z[1], slack[1]);
                }
            }
            let at = cell.at as usize;
            let m = &sum.m;
            let m = [m[0].total(), m[1].total(), m[2].total(), m[3].total(), m[4].total(), m[5].total()];
            band.add(at, &m);
            add(push, at, &sum.g);
        }
        gap.total()
    }

    /// Second pass: the affine step `dc` against the slacks; its second-order terms, as gradients, go to
    /// `correction`.
    #[inline(always)]
    pub(super) fn affine(&mut self, c: &[f64], dc: &[f64], correction: &mut [f64]) -> Affine {
        let mut all = AffineSums::default();
        let (cells, mut blocks) = self.split();
        for cell in cells {
            let (uppers, bends, jerks) = blocks.next(cell);
            let (c, dc) = (cell.controls(c), cell.controls(dc));
            let mut sum = [Lanes::ZERO; 3];
            for u in uppers {
                let inverse = Lanes::splat(1.0) / (u.room - product(&u.a, &c));
                let w = all.row(product(&u.a, &dc), u.z, inverse) * inverse;
                grow(&mut sum, &u.a, w);
            }
            for p in bends {
                let f = product(&p.f, &c);
                let inverse = inverses(&[p.room - f, p.room + f]);
                let d = product(&p.f, &dc);
                let up = all.row(d, p.z[0], inverse[0]) * inverse[0];
                let down = all.row(Lanes::ZERO - d, p.z[1], inverse[1]) * inverse[1];
                grow(&mut sum, &p.f, up - down);
            }
            if !jerks.is_empty() {
                let t = cell.tangent(cell.s, &c);
                for (b, p) in jerks.iter().enumerate() {
                    let k = cell.coefficient(b);
                    let inverse = inverses(&t.slacks(k, p.room, product(&p.f, &c)));
                    let [up, down] = t.rows(k, &p.f);
                    let w = all.row(product(&up, &dc), p.z[0], inverse[0]) * inverse[0];
                    grow(&mut sum, &up, w);
                    let w = all.row(product(&down, &dc), p.z[1], inverse[1]) * inverse[1];
                    grow(&mut sum, &down, w);
                }
            }
            add(correction, cell.at as usize, &sum);
        }
        all.finish()
    }

    /// Third pass: the steps of z for the combined step `dc`, corrected by what the affine step `da` left out; returns
    /// the largest of a.dc/slack and of -dz/z.
    #[inline(always)]
    pub(super) fn combined(&mut self, c: &[f64], da: &[f64], dc: &[f64], mu: f64) -> [f64; 2] {
        let mut all = Combined { mu: Lanes::splat(mu), rise: Lanes::ZERO, fall: Lanes::ZERO };
        let (cells, mut blocks) = self.split();
        for cell in cells {
            let (uppers, bends, jerks) = blocks.next(cell);
            let (c, da, dc) = (cell.controls(c), cell.controls(da), cell.controls(dc));
            for u in uppers {
                let inverse = Lanes::splat(1.0) / (u.room - product(&u.a, &c));
                u.dz = all.row(product(&u.a, &da), product(&u.a, &dc), u.z, inverse);
                all.fall = all.fall.max(Lanes::ZERO - u.dz / u.z);
            }
            for p in bends {
                let f = product(&p.f, &c);
                let inverse = inverses(&[p.room - f, p.room + f]);
                let (a, d) = (product(&p.f, &da), product(&p.f, &dc));
                p.dz[0] = all.row(a, d, p.z[0], inverse[0]);
                p.dz[1] = all.row(Lanes::ZERO - a, Lanes::ZERO - d, p.z[1], inverse[1]);
                all.fastest_fall(p);
            }
            if !jerks.is_empty() {
                let t = cell.tangent(cell.s, &c);
                for (b, p) in jerks.iter_mut().enumerate() {
                    let k = cell.coefficient(b);
                    let inverse = inverses(&t.slacks(k, p.room, product(&p.f, &c)));
                    let [up, down] = t.rows(k, &p.f);
                    p.dz[0] = all.row(product(&up, &da), product(&up, &dc), p.z[0], inverse[0]);
                    p.dz[1] = all.row(product(&down, &da), product(&down, &dc), p.z[1], inverse[1]);
                    all.fastest_fall(p);
                }
            }
        }
        [all.rise.largest(0.0), all.fall.largest(0.0)]
    }
}

/// sum += w a.
#[inline(always)]
fn grow(sum: &mut [Lanes; 3], a: &[Lanes; 3], w: Lanes) {
    sum[0] = sum[0].plus(a[0], w);
    sum[1] = sum[1].plus(a[1], w);
    sum[2] = sum[2].plus(a[2], w);
}

/// Adds sums over lanes to three neighbours from `at` on.
#[inline(always)]
fn add(to: &mut [f64], at: usize, sum: &[Lanes; 3]) {
    let sum = totals(sum);
    to[at] += sum[0];
    to[at + 1] += sum[1];
    to[at + 2] += sum[2];
}

/// What the third pass gathers.
struct Combined {
    mu: Lanes,
    /// Largest of a.dc/slack.
    rise: Lanes,
    /// Largest of -dz/z.
    fall: Lanes,
}

impl Combined {
    /// The steps of z of rows with a.da and a.dc.
    #[inline(always)]
    fn row(&mut self, da: Lanes, dc: Lanes, z: Lanes, inverse: Lanes) -> Lanes {
        let r = dc * inverse;
        let correction = z * da * (Lanes::splat(1.0) - da * inverse);
        self.rise = self.rise.max(r);
        ((self.mu - correction) * inverse - z).plus(z, r)
    }

    /// Takes in both -dz/z by one division.
    #[inline(always)]
    fn fastest_fall(&mut self, p: &Pair) {
        let inverse = inverses(&p.z);
        let fall = (p.dz[0] * inverse[0]).min(p.dz[1] * inverse[1]);
        self.fall = self.fall.max(Lanes::ZERO - fall);
    }
}

#[derive(Default)]
struct Sums {
    m: [Lanes; 6],
    g: [Lanes; 3],
}

impl Sums {
    /// Adds w a a^T.
    #[inline(always)]
    fn matrix(&mut self, a: &[Lanes; 3], w: Lanes) {
        let b = scaled(a, w);
        self.m[0] = self.m[0].plus(b[0], a[0]);
        self.m[1] = self.m[1].plus(b[0], a[1]);
        self.m[2] = self.m[2].plus(b[0], a[2]);
        self.m[3] = self.m[3].plus(b[1], a[1]);
        self.m[4] = self.m[4].plus(b[1], a[2]);
        self.m[5] = self.m[5].plus(b[2], a[2]);
    }
}

#[derive(Default)]
struct AffineSums {
    s1: Lanes,
    s2: Lanes,
    rise: Lanes,
    fall: Lanes,
}

impl AffineSums {
    /// Takes in rows with a.dc = d; returns their second-order terms.
    #[inline(always)]
    fn row(&mut self, d: Lanes, z: Lanes, inverse: Lanes) -> Lanes {
        let (r, t) = (d * inverse, z * d);
        self.s1 += t;
        self.s2 = self.s2.plus(t, r);
        self.rise = self.rise.max(r);
        self.fall = self.fall.min(r);
        t * (Lanes::splat(1.0) - r)
    }

    fn finish(&self) -> Affine {
        Affine {
            s1: self.s1.total(),
            s2: self.s2.total(),
            rise: self.rise.largest(0.0),
            fall: self.fall.smallest(0.0),
        }
    }
}
