(() => {
  for (const m of D.methods) {
    m.time = unpack(m.time);
    m.speed = unpackBand(m.speed);
    m.axes = m.axes.map(([v, a, j]) => ({ v: unpackBand(v), a: unpackBand(a), j: unpackBand(j) }));
    m.end = m.time[m.time.length - 1];
  }
  const boxes = [...document.querySelectorAll("input[name=method]")], plots = [];
  const shown = () => D.methods.filter((m, k) => boxes[k].checked);
  const whole = () => [0, Math.max(1e-9, ...shown().map(m => m.end))];
  // All plots share one window; null is everything.
  let view = null;

  class Plot {
    constructor(figure) {
      [this.canvas, this.output] = [figure.querySelector("canvas"), figure.querySelector("output")];
      this.kind = figure.dataset.plot;
      this.axis = figure.dataset.axis;
      this.limit = this.axis === undefined ? null : D.axes[+this.axis][this.kind];
      [this.cursor, this.box] = [overlay(figure, "cursor"), overlay(figure, "band")];
      dragging(this.canvas, (a, b) => {
        const x = Math.max(Math.min(a[0], b[0]), this.left), end = Math.min(Math.max(a[0], b[0]), this.w - this.right);
        place(this.box, x, this.canvas.offsetTop + this.top, Math.max(end - x, 0), this.h - this.top - this.bottom);
      }, (a, b) => {
        hide(this.box);
        if (Math.abs(a[0] - b[0]) > 4) magnify([a[0], b[0]].sort((p, q) => p - q).map(px => this.toX(px)));
      });
      this.canvas.addEventListener("dblclick", () => { view = null; drawAll(); });
      this.canvas.addEventListener("mousemove", e => point(this.toX(e.clientX - this.canvas.getBoundingClientRect().left)));
      this.canvas.addEventListener("mouseleave", () => point(null));
    }
    toX(px) {
      const [a, b] = view || whole();
      return a + (px - this.left) / Math.max(this.w - this.left - this.right, 1) * (b - a);
    }
    band(m) { return this.axis === undefined ? m.speed : m.axes[+this.axis][this.kind]; }
    draw() {
      const { g, w, h } = sized(this.canvas), [x0, x1] = view || whole(), methods = shown();
      Object.assign(this, { w, h, left: 58, right: 8, top: 6, bottom: 20 });
      const wide = w - this.left - this.right, high = h - this.top - this.bottom;
      const sx = v => this.left + (v - x0) / (x1 - x0) * wide;
      let [lo, hi] = this.limit ? [-this.limit, this.limit] : [0, 0];
      const ranges = methods.map(m => [m, seek(m.time, x0), Math.min(seek(m.time, x1) + 1, m.time.length - 1)]);
      for (const [m, a, b] of ranges) {
        const { lo: low, hi: high } = this.band(m);
        for (let i = a; i <= b; i++) { if (low[i] < lo) lo = low[i]; if (high[i] > hi) hi = high[i]; }
      }
      if (hi - lo <= 0) hi = lo + 1;
      const pad = (hi - lo) * 0.07;
      const y1 = hi + pad, y0 = this.axis === undefined ? 0 : lo - pad;
      const sy = v => this.top + (y1 - v) / (y1 - y0) * high;
      Object.assign(g, { fillStyle: css("--dim"), strokeStyle: css("--grid"), lineWidth: 1, textBaseline: "top", textAlign: "left" });
      const xt = ticks(x0, x1, wide / 80);
      for (const [k, v] of xt.at.entries()) {
        const x = Math.round(sx(v)) + 0.5, text = xt.text(v) + (k === xt.at.length - 1 ? " s" : "");
        const half = g.measureText(text).width / 2;
        g.fillText(text, Math.min(Math.max(x - half, 0), w - 2 * half), h - this.bottom + 5);
        g.beginPath(); g.moveTo(x, this.top); g.lineTo(x, h - this.bottom); g.stroke();
      }
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
      if (this.limit) {
        Object.assign(g, { strokeStyle: css("--limit"), lineWidth: 1 }).setLineDash([5, 4]);
        for (const sign of [1, -1]) {
          g.beginPath(); g.moveTo(this.left, sy(sign * this.limit)); g.lineTo(w - this.right, sy(sign * this.limit)); g.stroke();
        }
        g.setLineDash([]);
      }
      Object.assign(g, { lineJoin: "round", lineWidth: 1.2, globalAlpha: methods.length > 1 ? 0.8 : 1 });
      for (const [m, a, b] of ranges) {
        const { lo: low, hi: high } = this.band(m);
        g.strokeStyle = m.colour;
        g.beginPath();
        for (let i = a; i <= b; i++) {
          const x = sx(m.time[i]);
          if (i > a) g.lineTo(x, sy(high[i])); else g.moveTo(x, sy(high[i]));
          if (high[i] !== low[i]) g.lineTo(x, sy(low[i]));
        }
        g.stroke();
      }
      g.restore();
    }
    mark(time) {
      if (time === null) { hide(this.cursor); this.output.textContent = ""; return; }
      const [x0, x1] = view || whole(), x = this.left + (time - x0) / (x1 - x0) * (this.w - this.left - this.right);
      place(this.cursor, x, this.canvas.offsetTop + this.top, undefined, this.h - this.top - this.bottom);
      const at = m => { const i = seek(m.time, time), b = this.band(m); return show((b.lo[i] + b.hi[i]) / 2); };
      const values = shown().filter(m => time <= m.end).map(m => `${m.name} ${at(m)}`);
      this.output.textContent = `${show(time)} s: ${values.join(", ")}`;
    }
  }

  const magnify = window => {
    const all = whole(), next = [Math.max(window[0], all[0]), Math.min(window[1], all[1])];
    if (next[1] - next[0] > (all[1] - all[0]) * 1e-6) view = next;
    drawAll();
  };
  const point = time => { for (const p of plots) p.mark(time === null || time < 0 ? null : time); };
  const drawAll = () => { for (const p of plots) p.draw(); };
  for (const f of document.querySelectorAll("figure.plot")) plots.push(new Plot(f));
  for (const b of boxes) b.addEventListener("change", () => { view = null; drawAll(); });
  let waiting = 0;
  const later = () => { cancelAnimationFrame(waiting); waiting = requestAnimationFrame(drawAll); };
  window.addEventListener("resize", later);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", later);
  window.addEventListener("beforeprint", () => { root.classList.add("paper"); drawAll(); });
  window.addEventListener("afterprint", () => { root.classList.remove("paper"); drawAll(); });
  drawAll();
})();
