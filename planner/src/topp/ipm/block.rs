//! Rows of the cells, lanes side by side, and the passes over them.

use super::super::lanes::{LANES, Lanes, product};
use super::super::rows::{CellRows, Row, dot};

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
        let base = Lanes::splat(self.base[k]) + room * self.alpha;
        let force = f * self.alpha;
        [base - force, base + force]
    }

    /// Both rows of a block.
    #[inline(always)]
    fn rows(&self, k: usize, f: &[Lanes; 3]) -> [[Lanes; 3]; 2] {
        let force = f.map(|f| f * self.alpha);
        let x = self.x[k].map(Lanes::splat);
        [
            [x[0] + force[0], x[1] + force[1], x[2] + force[2]],
            [x[0] - force[0], x[1] - force[1], x[2] - force[2]],
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
        let base = [0, 1, 2].map(|k| self.rhs - beta * (dot(&self.x[k], c) + self.xi[k]) - alpha);
        Tangent { alpha, base, x: self.x.map(|r| r.map(|v| v * beta)) }
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
                p.z = t.slacks(cell.coefficient(b), p.room, product(&p.f, &c)).map(|slack| mu / slack);
                p.dz = [Lanes::ZERO; 2];
            }
        }
    }

    /// First pass: z takes its step, tangents move, and every cell's part of the Newton matrix goes to `add`.
    #[inline(always)]
    pub(super) fn normal(&mut self, c: &[f64], step: f64, mut add: impl FnMut(usize, &Normal)) {
        let (cells, mut blocks) = self.split();
        for cell in cells {
            let (uppers, bends, jerks) = blocks.next(cell);
            let at = cell.at as usize;
            let c = cell.controls(c);
            let mut sum = Sums::default();
            for u in uppers {
                u.z += u.dz * step;
                let slack = u.room - product(&u.a, &c);
                let inverse = Lanes::splat(1.0) / slack;
                sum.matrix(&u.a, u.z * inverse);
                sum.push(&u.a, inverse);
                sum.gap += u.z * slack;
            }
            for p in bends {
                p.z[0] += p.dz[0] * step;
                p.z[1] += p.dz[1] * step;
                let f = product(&p.f, &c);
                let slack = [p.room - f, p.room + f];
                let inverse = inverses(&slack);
                sum.matrix(&p.f, p.z[0] * inverse[0] + p.z[1] * inverse[1]);
                sum.push(&p.f, inverse[0] - inverse[1]);
                sum.gap += p.z[0] * slack[0] + p.z[1] * slack[1];
            }
            if !jerks.is_empty() {
                cell.move_tangent(jerks, &c);
            }
            let t = cell.tangent(cell.s, &c);
            for (b, p) in jerks.iter_mut().enumerate() {
                p.z[0] += p.dz[0] * step;
                p.z[1] += p.dz[1] * step;
                let k = cell.coefficient(b);
                let slack = t.slacks(k, p.room, product(&p.f, &c));
                let rows = t.rows(k, &p.f);
                let inverse = inverses(&slack);
                for side in 0..2 {
                    sum.matrix(&rows[side], p.z[side] * inverse[side]);
                    sum.push(&rows[side], inverse[side]);
                    sum.gap += p.z[side] * slack[side];
                }
            }
            add(at, &sum.finish());
        }
    }

    /// Second pass: the affine step `dc` against the slacks; its second-order terms go, as gradients, to `add`.
    #[inline(always)]
    pub(super) fn affine(&mut self, c: &[f64], dc: &[f64], mut add: impl FnMut(usize, &[f64; 3])) -> Affine {
        let mut all = AffineSums::default();
        let (cells, mut blocks) = self.split();
        for cell in cells {
            let (uppers, bends, jerks) = blocks.next(cell);
            let (c, dc) = (cell.controls(c), cell.controls(dc));
            let mut sum = [Lanes::ZERO; 3];
            let mut grow = |a: &[Lanes; 3], w: Lanes| (0..3).for_each(|j| sum[j] += a[j] * w);
            for u in uppers {
                let inverse = Lanes::splat(1.0) / (u.room - product(&u.a, &c));
                grow(&u.a, all.row(product(&u.a, &dc), u.z, inverse) * inverse);
            }
            for p in bends {
                let f = product(&p.f, &c);
                let inverse = inverses(&[p.room - f, p.room + f]);
                let d = product(&p.f, &dc);
                let up = all.row(d, p.z[0], inverse[0]) * inverse[0];
                let down = all.row(Lanes::ZERO - d, p.z[1], inverse[1]) * inverse[1];
                grow(&p.f, up - down);
            }
            let t = cell.tangent(cell.s, &c);
            for (b, p) in jerks.iter().enumerate() {
                let k = cell.coefficient(b);
                let inverse = inverses(&t.slacks(k, p.room, product(&p.f, &c)));
                let rows = t.rows(k, &p.f);
                for side in 0..2 {
                    let d = product(&rows[side], &dc);
                    grow(&rows[side], all.row(d, p.z[side], inverse[side]) * inverse[side]);
                }
            }
            add(cell.at as usize, &sum.map(|v| v.total()));
        }
        all.finish()
    }

    /// Third pass: the steps of z for the combined step `dc`, corrected by what the affine step `da` left out; returns
    /// the largest of a.dc/slack and of -dz/z.
    #[inline(always)]
    pub(super) fn combined(&mut self, c: &[f64], da: &[f64], dc: &[f64], mu: f64) -> [f64; 2] {
        let mut most = [Lanes::ZERO; 2];
        let mu = Lanes::splat(mu);
        let mut row = |da: Lanes, dc: Lanes, z: Lanes, inverse: Lanes| {
            let (ra, r) = (da * inverse, dc * inverse);
            let correction = z * da * (Lanes::splat(1.0) - ra);
            most[0] = most[0].max(r);
            (mu - correction) * inverse - z + z * r
        };
        let mut dual = Lanes::ZERO;
        let (cells, mut blocks) = self.split();
        for cell in cells {
            let (uppers, bends, jerks) = blocks.next(cell);
            let (c, da, dc) = (cell.controls(c), cell.controls(da), cell.controls(dc));
            for u in uppers {
                let inverse = Lanes::splat(1.0) / (u.room - product(&u.a, &c));
                u.dz = row(product(&u.a, &da), product(&u.a, &dc), u.z, inverse);
                dual = dual.max(Lanes::ZERO - u.dz / u.z);
            }
            for p in bends {
                let f = product(&p.f, &c);
                let inverse = inverses(&[p.room - f, p.room + f]);
                let (a, d) = (product(&p.f, &da), product(&p.f, &dc));
                p.dz[0] = row(a, d, p.z[0], inverse[0]);
                p.dz[1] = row(Lanes::ZERO - a, Lanes::ZERO - d, p.z[1], inverse[1]);
                dual = fastest_fall(p, dual);
            }
            let t = cell.tangent(cell.s, &c);
            for (b, p) in jerks.iter_mut().enumerate() {
                let k = cell.coefficient(b);
                let inverse = inverses(&t.slacks(k, p.room, product(&p.f, &c)));
                let rows = t.rows(k, &p.f);
                for side in 0..2 {
                    let (a, d) = (product(&rows[side], &da), product(&rows[side], &dc));
                    p.dz[side] = row(a, d, p.z[side], inverse[side]);
                }
                dual = fastest_fall(p, dual);
            }
        }
        [most[0].largest(0.0), dual.largest(0.0)]
    }
}

/// The larger of `most` and both -dz/z, by one division.
#[inline(always)]
fn fastest_fall(p: &Pair, most: Lanes) -> Lanes {
    let inverse = inverses(&p.z);
    let fall = (p.dz[0] * inverse[0]).min(p.dz[1] * inverse[1]);
    most.max(Lanes::ZERO - fall)
}

#[derive(Default)]
struct Sums {
    m: [Lanes; 6],
    g: [Lanes; 3],
    gap: Lanes,
}

impl Sums {
    /// Adds w a a^T.
    #[inline(always)]
    fn matrix(&mut self, a: &[Lanes; 3], w: Lanes) {
        let b = [a[0] * w, a[1] * w, a[2] * w];
        self.m[0] += b[0] * a[0];
        self.m[1] += b[0] * a[1];
        self.m[2] += b[0] * a[2];
        self.m[3] += b[1] * a[1];
        self.m[4] += b[1] * a[2];
        self.m[5] += b[2] * a[2];
    }

    #[inline(always)]
    fn push(&mut self, a: &[Lanes; 3], w: Lanes) {
        (0..3).for_each(|j| self.g[j] += a[j] * w);
    }

    #[inline(always)]
    fn finish(&self) -> Normal {
        Normal { m: self.m.map(|v| v.total()), g: self.g.map(|v| v.total()), gap: self.gap.total() }
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
        self.s2 += t * r;
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
