"use strict";
// What the plots of every page share: numbers, ticks, canvases.
const D = JSON.parse(document.getElementById("data").textContent);
const root = document.documentElement;
const css = name => getComputedStyle(root).getPropertyValue(name).trim();

// Series come as integers with an origin and a step; an envelope adds highest minus lowest.
const unpack = s => Float64Array.from(s.d, v => v === null ? NaN : s.o + s.s * v);
const unpackBand = s => {
  const lo = unpack(s);
  return { lo, hi: s.e ? lo.map((v, i) => v + s.s * s.e[i]) : lo };
};
const span = values => {
  let lo = Infinity, hi = -Infinity;
  for (const v of values) { if (v < lo) lo = v; if (v > hi) hi = v; }
  return lo <= hi ? [lo, hi] : [0, 0];
};
// Numbers and ticks.
const niceStep = raw => {
  const p = 10 ** Math.floor(Math.log10(raw)), m = raw / p;
  return (m <= 1 ? 1 : m <= 2 ? 2 : m <= 5 ? 5 : 10) * p;
};
const group = text => text.replace(/\B(?=(\d{3})+(?!\d))/g, "\u202f").replace("-", "\u2212");
const fixed = (v, decimals) => {
  const [whole, part] = v.toFixed(Math.min(Math.max(decimals, 0), 8)).split(".");
  return group(+v.toFixed(8) === 0 ? "0" : whole) + (part ? "." + part : "");
};
const digits = step => Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
const show = v => {
  if (!v) return v === 0 ? "0" : "\u2013";
  return fixed(v, 3 - Math.floor(Math.log10(Math.abs(v))));
};
const ticks = (lo, hi, n) => {
  const step = niceStep((hi - lo) / Math.max(n, 1)), out = [];
  for (let k = Math.ceil(lo / step - 1e-9); k * step <= hi + step * 1e-9; k++) out.push(k * step);
  return { at: out, text: v => fixed(v, digits(step)) };
};

const sized = canvas => {
  const scale = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  canvas.width = Math.max(1, Math.round(box.width * scale));
  canvas.height = Math.max(1, Math.round(box.height * scale));
  const g = canvas.getContext("2d");
  g.setTransform(scale, 0, 0, scale, 0, 0);
  g.font = "11px system-ui, 'DejaVu Sans', sans-serif";
  return { g, w: box.width, h: box.height };
};
const overlay = (figure, name) => figure.appendChild(Object.assign(document.createElement("div"), { className: name }));
const place = (e, x, y, w, h) => Object.assign(e.style, {
  display: "block", left: x + "px", top: y + "px",
  ...(w === undefined ? {} : { width: w + "px" }), ...(h === undefined ? {} : { height: h + "px" }),
});
const hide = e => { e.style.display = "none"; };
// Last index whose value is not above v, in a rising series.
const seek = (series, v) => {
  let lo = 0, hi = series.length - 1;
  while (lo < hi) { const mid = (lo + hi + 1) >> 1; if (series[mid] <= v) lo = mid; else hi = mid - 1; }
  return lo;
};
// Drag along or across a canvas; a click without a drag does nothing.
const dragging = (canvas, move, done) => {
  let from = null;
  const at = e => { const b = canvas.getBoundingClientRect(); return [e.clientX - b.left, e.clientY - b.top]; };
  canvas.addEventListener("pointerdown", e => { from = at(e); canvas.setPointerCapture(e.pointerId); });
  canvas.addEventListener("pointermove", e => { if (from) move(from, at(e)); });
  canvas.addEventListener("pointerup", e => { if (from) done(from, at(e)); from = null; });
  canvas.addEventListener("pointercancel", () => { if (from) done(from, from); from = null; });
};
