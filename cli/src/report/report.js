(() => {
  const T = D.t, P = D.path;
  for (const key of ["time", "pos", "line", "ceiling"]) T[key] = unpack(T[key]);
  T.speed = unpackBand(T.speed);
  for (const axis of T.axes) for (const key of "vajef") axis[key] = unpackBand(axis[key]);
  for (const key of ["time", "speed", "line"]) P[key] = unpack(P[key]);
  P.at = P.at.map(unpack);
  const topSpeed = span(P.speed.filter((v, i) => P.mode[i] === 1))[1] || span(P.speed)[1] || 1;

  // A map from dark blue over green to yellow with even lightness steps (viridis, nine stops).
  const STOPS = ["#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c", "#28ae80", "#5ec962", "#addc30", "#fde725"]
    .map(c => [1, 3, 5].map(i => parseInt(c.slice(i, i + 2), 16)));
  const heat = x => {
    const from = +css("--map-from"), to = +css("--map-to");
    const p = (from + (to - from) * Math.min(Math.max(x, 0), 1)) * 8, i = Math.min(Math.floor(p), 7);
    return `rgb(${STOPS[i].map((c, k) => Math.round(c + (STOPS[i + 1][k] - c) * (p - i))).join()})`;
  };

  // Everything over time shares one window, everything shares one cursor.
  const whole = T.time.length ? [T.time[0], Math.max(span(P.time)[1], T.time[T.time.length - 1])] : [0, 1];
  // The phase plot leaves rapids out, unless there is nothing else: they are many times faster and tell little.
  const cuts = T.mode.some(m => m === 1), phased = i => !cuts || (T.mode[i] === 1 && T.mode[i + 1] !== 2);
  T.way = new Float64Array(T.pos.length);
  for (let i = 1; i < T.way.length; i++) T.way[i] = T.way[i - 1] + (phased(i - 1) ? T.pos[i] - T.pos[i - 1] : 0);
  const far = [0, T.way[T.way.length - 1] || 1];
  let view = whole.slice(), reach = far.slice();
  const plots = [], pictures = [];

  class Plot {
    constructor(figure) {
      this.figure = figure;
      [this.canvas, this.output] = [figure.querySelector("canvas"), figure.querySelector("output")];
      this.kind = figure.dataset.plot;
      this.overPath = this.kind === "phase";
      this.axis = figure.dataset.axis === undefined ? null : D.axes[+figure.dataset.axis];
      this.x = this.overPath ? T.way : T.time;
      if (this.axis) this.band = T.axes[+figure.dataset.axis][this.kind];
      else if (this.kind !== "strip") this.band = T.speed;
      this.unit = figure.querySelector(".dim")?.textContent ?? "";
      [this.cursor, this.box] = [overlay(figure, "cursor"), overlay(figure, "band")];
      dragging(this.canvas, (a, b) => {
        const x = Math.max(Math.min(a[0], b[0]), this.left), end = Math.min(Math.max(a[0], b[0]), this.w - this.right);
        place(this.box, x, this.canvas.offsetTop + this.top, Math.max(end - x, 0), this.h - this.top - this.bottom);
      }, (a, b) => {
        hide(this.box);
        if (Math.abs(a[0] - b[0]) > 4) this.magnify([a[0], b[0]].sort((p, q) => p - q).map(px => this.toX(px)));
      });
      this.canvas.addEventListener("dblclick", () => this.magnify(this.overPath ? far : whole));
      this.canvas.addEventListener("mousemove", e => {
        point(T.time[seek(this.x, this.toX(e.clientX - this.canvas.getBoundingClientRect().left))]);
      });
      this.canvas.addEventListener("mouseleave", () => point(null));
    }
    get window() { return this.overPath ? reach : view; }
    magnify(window) {
      const all = this.overPath ? far : whole, next = [Math.max(window[0], all[0]), Math.min(window[1], all[1])];
      if (!(next[1] - next[0] > (all[1] - all[0]) * 1e-6)) return;
      if (this.overPath) reach = next; else view = next;
      for (const p of plots) if (p.overPath === this.overPath) p.draw();
    }
    toX(px) {
      const [a, b] = this.window;
      return a + (px - this.left) / Math.max(this.w - this.left - this.right, 1) * (b - a);
    }
    limits(i) {
      if (!this.axis || this.kind === "e") return null;
      return this.kind === "f" ? this.axis.f : this.axis[this.kind][T.mode[i] === 2 ? 1 : 0];
    }
    hidden(i) { return this.overPath && !phased(i); }
    range(a, b) {
      let lo = 0, hi = 0;
      for (let i = a; i <= b; i++) {
        if (this.hidden(i)) continue;
        if (this.band.lo[i] < lo) lo = this.band.lo[i];
        if (this.band.hi[i] > hi) hi = this.band.hi[i];
        const limit = this.limits(i);
        if (limit) { lo = Math.min(lo, -limit); hi = Math.max(hi, limit); }
      }
      if (!this.axis) hi *= 1.12;
      if (hi - lo <= 0) hi = lo + 1;
      const pad = (hi - lo) * 0.07;
      return [this.axis ? lo - pad : 0, hi + pad];
    }
    draw() {
      const { g, w, h } = sized(this.canvas), [x0, x1] = this.window;
      Object.assign(this, { w, h, left: 58, right: 8, top: 6, bottom: 20 });
      const wide = w - this.left - this.right, high = h - this.top - this.bottom;
      const sx = v => this.left + (v - x0) / (x1 - x0) * wide;
      const a = seek(this.x, x0), b = Math.min(seek(this.x, x1) + 1, this.x.length - 1);
      Object.assign(g, { fillStyle: css("--dim"), strokeStyle: css("--grid"), lineWidth: 1, textBaseline: "top" });
      const xt = ticks(x0, x1, wide / 80);
      for (const [k, v] of xt.at.entries()) {
        const x = Math.round(sx(v)) + 0.5, text = xt.text(v) + (k === xt.at.length - 1 ? this.overPath ? " mm" : " s" : "");
        const half = g.measureText(text).width / 2;
        g.textAlign = "left";
        g.fillText(text, Math.min(Math.max(x - half, 0), w - 2 * half), h - this.bottom + 5);
        g.beginPath(); g.moveTo(x, this.top); g.lineTo(x, h - this.bottom); g.stroke();
      }
      if (this.kind === "strip") {
        this.columns(g, sx, a, b, wide, high);
        return;
      }
      const [y0, y1] = this.range(a, b), sy = v => this.top + (y1 - v) / (y1 - y0) * high;
      const yt = ticks(y0, y1, high / 24);
      Object.assign(g, { textAlign: "right", textBaseline: "middle" });
      for (const v of yt.at) {
        const y = Math.round(sy(v)) + 0.5;
        g.strokeStyle = Math.abs(v) < 1e-12 ? css("--rule") : css("--grid");
        g.beginPath(); g.moveTo(this.left, y); g.lineTo(w - this.right, y); g.stroke();
        g.fillText(yt.text(v), this.left - 6, y);
      }
      g.save();
      g.beginPath(); g.rect(this.left, this.top - 1, wide, high + 2); g.clip();
      Object.assign(g, { lineJoin: "round", lineWidth: 1.3, strokeStyle: this.axis ? this.axis.colour : css("--trace") });
      if (!this.axis) this.shade(g, sx, sy, a, b);
      g.beginPath();
      for (let i = a, pen = false; i <= b; i++) {
        if (this.hidden(i)) { pen = false; continue; }
        const x = sx(this.x[i]), lo = this.band.lo[i], hi = this.band.hi[i];
        if (pen) g.lineTo(x, sy(hi)); else g.moveTo(x, sy(hi));
        pen = true;
        if (hi !== lo) g.lineTo(x, sy(lo));
      }
      g.stroke();
      Object.assign(g, { strokeStyle: css("--limit"), lineWidth: 1 });
      g.setLineDash([5, 4]);
      for (const sign of this.axis ? [1, -1] : []) {
        g.beginPath();
        let before = null;
        for (let i = a; i <= b; i++) {
          const limit = this.limits(i);
          if (limit === null) { before = null; continue; }
          const x = sx(this.x[i]), y = sy(sign * limit);
          if (before === null) g.moveTo(Math.max(x, this.left), y);
          else if (y !== before) { g.lineTo(x, before); g.lineTo(x, y); } else if (i === b) g.lineTo(x, y);
          before = y;
        }
        g.stroke();
      }
      g.restore();
    }
    // The speed that feed and axis velocities allow.
    shade(g, sx, sy, a, b) {
      g.save();
      Object.assign(g, { fillStyle: css("--limit"), globalAlpha: 0.16 });
      g.beginPath();
      g.moveTo(sx(this.x[a]), sy(0));
      for (let i = a; i < b; i++) {
        if (this.overPath && this.x[i] === this.x[i + 1]) continue;
        const y = sy(this.hidden(i) || Number.isNaN(T.ceiling[i]) ? 0 : T.ceiling[i]);
        g.lineTo(sx(this.x[i]), y);
        g.lineTo(sx(this.x[i + 1]), y);
      }
      g.lineTo(sx(this.x[b]), sy(0));
      g.fill();
      g.restore();
    }
    // Every column is divided among the limits that rule in its time, in the order of the legend.
    columns(g, sx, a, b, wide, high) {
      const count = Math.max(Math.floor(wide / 3), 1), each = wide / count;
      const share = Array.from(D.legend, () => new Float64Array(count));
      for (let i = a; i <= b && this.x.length; i++) {
        const from = Math.max((sx(this.x[i]) - this.left) / each, 0);
        const to = Math.min(i < b ? (sx(this.x[i + 1]) - this.left) / each : count, count);
        for (let k = Math.floor(from); k < to; k++) share[T.limit[i]][k] += Math.min(to, k + 1) - Math.max(from, k);
      }
      for (let k = 0, y; k < count; k++) {
        y = this.top;
        for (const [limit, parts] of share.entries()) {
          g.fillStyle = D.legend[limit].colour;
          g.fillRect(this.left + k * each, y, each + 0.3, parts[k] * high);
          y += parts[k] * high;
        }
      }
    }
    mark(i) {
      const x = i === null ? NaN : this.left + (this.x[i] - this.window[0]) / (this.window[1] - this.window[0]) * (this.w - this.left - this.right);
      if (!(x >= this.left && x <= this.w - this.right)) { hide(this.cursor); this.output.textContent = ""; return; }
      place(this.cursor, x, this.canvas.offsetTop + this.top, undefined, this.h - this.top - this.bottom);
      if (this.kind === "strip") {
        this.output.textContent = `${show(T.time[i])} s, line ${T.line[i]}: ${D.legend[T.limit[i]].label}`;
        return;
      }
      const lo = this.band.lo[i], hi = this.band.hi[i];
      const value = hi - lo > (Math.abs(hi) + Math.abs(lo)) * 0.01 ? `${show(lo)} to ${show(hi)}` : show(hi);
      this.output.textContent = `${value} ${this.unit}`;
    }
  }

  class Picture {
    constructor(figure) {
      this.figure = figure;
      [this.canvas, this.output] = [figure.querySelector("canvas"), figure.querySelector("output")];
      this.space = figure.dataset.view === "space";
      this.flatTime = P.at.length < 2;
      [this.dot, this.box] = [overlay(figure, "dot"), overlay(figure, "band")];
      this.reset();
      dragging(this.canvas, (a, b) => {
        if (this.space) {
          const from = this.from || (this.from = [this.turn, this.tilt]);
          this.turn = from[0] - (b[0] - a[0]) * 0.008;
          this.tilt = Math.min(Math.max(from[1] + (b[1] - a[1]) * 0.008, 0), Math.PI / 2);
          this.draw();
        } else {
          place(this.box, Math.min(a[0], b[0]), this.canvas.offsetTop + Math.min(a[1], b[1]), Math.abs(a[0] - b[0]), Math.abs(a[1] - b[1]));
        }
      }, (a, b) => {
        this.from = null;
        hide(this.box);
        if (this.space || Math.abs(a[0] - b[0]) < 5 || Math.abs(a[1] - b[1]) < 5) return;
        const [p, q] = [this.back(a), this.back(b)];
        this.frame = [Math.min(p[0], q[0]), Math.max(p[0], q[0]), Math.min(p[1], q[1]), Math.max(p[1], q[1])];
        this.draw();
      });
      this.canvas.addEventListener("dblclick", () => { this.reset(); this.draw(); });
      this.canvas.addEventListener("mousemove", e => {
        const b = this.canvas.getBoundingClientRect(), i = this.nearest(e.clientX - b.left, e.clientY - b.top);
        if (i !== null) point(P.time[i], i);
      });
      this.canvas.addEventListener("mouseleave", () => point(null));
    }
    reset() { this.frame = null; this.turn = -Math.PI / 4; this.tilt = 0.6155; }
    // Picture plane coordinates: the first two axes, or all three seen from above at an angle.
    project(x, y, z) {
      if (!this.space) return [x, y];
      const c = Math.cos(this.turn), s = Math.sin(this.turn);
      return [c * x - s * y, Math.sin(this.tilt) * (s * x + c * y) + Math.cos(this.tilt) * z];
    }
    back([px, py]) { return [this.x0 + (px - this.ox) / this.kx, this.y0 - (py - this.oy) / this.ky]; }
    nearest(px, py) {
      let best = null, least = 900;
      for (let i = 0; i < this.px.length; i++) {
        const d = (this.px[i] - px) ** 2 + (this.py[i] - py) ** 2;
        if (d < least) { least = d; best = i; }
      }
      return best;
    }
    draw() {
      const { g, w, h } = sized(this.canvas), n = P.time.length;
      const X = this.flatTime ? P.time : P.at[0], Y = this.flatTime ? P.at[0] : P.at[1], Z = P.at[2];
      const u = new Float64Array(n), v = new Float64Array(n);
      for (let i = 0; i < n; i++) [u[i], v[i]] = this.project(X[i], Y[i], Z ? Z[i] : 0);
      const [left, bottom, edge] = this.space ? [24, 24, 24] : [58, 26, 24];
      const frame = this.frame || [...span(u), ...span(v)];
      const wu = Math.max(frame[1] - frame[0], 1e-9), wv = Math.max(frame[3] - frame[2], 1e-9);
      let kx = (w - left - edge) / wu, ky = (h - bottom - edge) / wv;
      const alike = !this.flatTime && (this.space || P.axes[0][1] === P.axes[1][1]);
      if (alike) kx = ky = Math.min(kx, ky);
      Object.assign(this, { kx, ky, x0: (frame[0] + frame[1]) / 2, y0: (frame[2] + frame[3]) / 2, ox: (left + w - edge) / 2, oy: (edge + h - bottom) / 2 });
      this.px = u.map(x => this.ox + (x - this.x0) * kx);
      this.py = v.map(y => this.oy - (y - this.y0) * ky);
      if (!this.space) this.rulers(g, w, h, left, bottom); else this.triad(g, h);
      g.save();
      g.beginPath(); g.rect(this.space ? 0 : left, 0, w, this.space ? h : h - bottom); g.clip();
      g.lineCap = g.lineJoin = "round";
      const stroke = (chosen, colour, width, dash) => {
        g.beginPath();
        let any = false, joined = false;
        for (let i = 1; i < n; i++) {
          if (!chosen(i)) { joined = false; continue; }
          if (!joined) g.moveTo(this.px[i - 1], this.py[i - 1]);
          g.lineTo(this.px[i], this.py[i]);
          any = joined = true;
        }
        if (!any) return;
        Object.assign(g, { strokeStyle: colour, lineWidth: width }).setLineDash(dash || []);
        g.stroke();
      };
      const marks = document.getElementById("slow").checked, byLimit = colouring() === "limit", pen = n > 6000 ? 1.2 : 2.2;
      stroke(i => P.mode[i] === 2, css("--rapid"), 1, [4, 5]);
      if (marks) stroke(i => P.mode[i] !== 2 && P.slow[i], css("--halo"), pen * 2.5);
      const bins = byLimit ? D.legend.length : 40;
      const bin = Int16Array.from(P.speed, (s, i) => P.mode[i] === 2 ? -1 : byLimit ? P.limit[i] : Math.min(Math.floor(s / topSpeed * bins), bins - 1));
      for (let k = bins - 1; k >= 0; k--) {
        stroke(i => bin[i] === k, byLimit ? D.legend[k].colour : heat((k + 0.5) / bins), pen);
      }
      if (marks) this.pins(g);
      g.restore();
    }
    pins(g) {
      const taken = [];
      g.setLineDash([]);
      Object.assign(g, { font: "bold 10px system-ui, 'DejaVu Sans', sans-serif", textAlign: "center", textBaseline: "middle", lineWidth: 1 });
      D.pins.forEach((pin, k) => {
        const [u, v] = this.flatTime ? [pin[3], pin[0]] : this.project(pin[0], pin[1], pin[2]);
        const x = this.ox + (u - this.x0) * this.kx, y = this.oy - (v - this.y0) * this.ky;
        // Around its place, the first spot that hides no other number.
        const spots = [[11, -11], [-11, -11], [11, 11], [-11, 11], [20, 0], [-20, 0], [0, 20], [0, -20]];
        const free = spots.find(s => taken.every(t => Math.hypot(t[0] - x - s[0], t[1] - y - s[1]) > 17));
        if (!free) return;
        const cx = x + free[0], cy = y + free[1];
        taken.push([cx, cy]);
        Object.assign(g, { strokeStyle: css("--ink"), fillStyle: css("--panel") });
        g.beginPath(); g.moveTo(x, y); g.lineTo(cx, cy); g.stroke();
        g.beginPath(); g.arc(cx, cy, 8, 0, 7); g.fill(); g.stroke();
        g.fillStyle = css("--ink");
        g.fillText(k + 1, cx, cy + 0.5);
      });
    }
    rulers(g, w, h, left, bottom) {
      const [a, b] = [this.back([left, h - bottom]), this.back([w, 0])];
      Object.assign(g, { fillStyle: css("--dim"), strokeStyle: css("--grid"), lineWidth: 1, textAlign: "center", textBaseline: "top" });
      const names = this.flatTime ? [["t", "s"], P.axes[0]] : P.axes;
      const xt = ticks(a[0], b[0], (w - left) / 80), yt = ticks(a[1], b[1], (h - bottom) / 50);
      for (const v of xt.at) {
        const x = Math.round(this.ox + (v - this.x0) * this.kx) + 0.5;
        g.beginPath(); g.moveTo(x, 0); g.lineTo(x, h - bottom); g.stroke();
        if (x > left + 8 && x < w - 62) g.fillText(xt.text(v), x, h - bottom + 7);
      }
      g.textAlign = "right";
      g.fillText(`${names[0][0]} [${names[0][1]}]`, w - 6, h - bottom + 7);
      g.textBaseline = "middle";
      for (const v of yt.at) {
        const y = Math.round(this.oy - (v - this.y0) * this.ky) + 0.5;
        g.beginPath(); g.moveTo(left, y); g.lineTo(w, y); g.stroke();
        if (y > 24 && y < h - bottom - 4) g.fillText(yt.text(v), left - 6, y);
      }
      g.fillText(`${names[1][0]} [${names[1][1]}]`, left - 6, 12);
    }
    triad(g, h) {
      Object.assign(g, { fillStyle: css("--dim"), strokeStyle: css("--dim"), lineWidth: 1.2, textAlign: "center", textBaseline: "middle" });
      [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((e, k) => {
        const [u, v] = this.project(...e);
        g.beginPath(); g.moveTo(50, h - 46); g.lineTo(50 + u * 26, h - 46 - v * 26); g.stroke();
        if (Math.hypot(u, v) > 0.2) g.fillText(P.axes[k][0], 50 + u * 37, h - 46 - v * 37);
      });
    }
    mark(i) {
      if (i === null || !this.px) { hide(this.dot); this.output.textContent = ""; return; }
      place(this.dot, this.px[i], this.canvas.offsetTop + this.py[i]);
      const kind = P.mode[i] === 2 ? "rapid, " : "";
      this.output.textContent = `line ${P.line[i]}: ${show(P.speed[i])} ${D.unit} at ${show(P.time[i])} s, ${kind}limit: ${D.legend[P.limit[i]].label}`;
    }
  }

  const colouring = () => document.querySelector("input[name=colour]:checked")?.value;
  const point = (time, corner) => {
    const i = time === null || !T.time.length ? null : seek(T.time, time);
    for (const p of plots) p.mark(i);
    const k = time === null || !P.time.length ? null : corner ?? seek(P.time, time);
    for (const p of pictures) p.mark(k);
  };
  const scale = () => {
    const box = document.getElementById("scale");
    if (!box) return;
    box.hidden = colouring() === "limit";
    box.innerHTML = "<span>0</span><i></i><span></span>";
    box.children[1].style.background = `linear-gradient(to right, ${[0, 1, 2, 3, 4, 5, 6, 7, 8].map(k => heat(k / 8)).join()})`;
    box.children[2].textContent = `${show(topSpeed)} ${D.unit}`;
  };
  const drawAll = () => { scale(); for (const p of [...pictures, ...plots]) p.draw(); };

  for (const f of document.querySelectorAll("figure.plot")) plots.push(new Plot(f));
  if (P.time.length) for (const f of document.querySelectorAll("figure.path")) pictures.push(new Picture(f));
  for (const e of document.querySelectorAll(".controls input")) {
    e.addEventListener("change", () => { scale(); for (const p of pictures) p.draw(); });
  }
  let waiting = 0;
  const later = () => { cancelAnimationFrame(waiting); waiting = requestAnimationFrame(drawAll); };
  window.addEventListener("resize", later);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", later);
  window.addEventListener("beforeprint", () => { root.classList.add("paper"); drawAll(); });
  window.addEventListener("afterprint", () => { root.classList.remove("paper"); drawAll(); });
  drawAll();
})();
