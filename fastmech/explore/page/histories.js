// Time histories, phase portrait and energies of the motion that was started.
import { Plane, canvas, choice, css, element, panel, short } from "./ink.js";

const COLORS = ["blue", "vermillion", "green", "purple"];

export class Histories {
  constructor(app) {
    this.app = app;
    this.views = [
      new Plane(canvas("coordinates against time", true), (p) => this.history(p)),
      new Plane(canvas("energies against time", true), (p) => this.energies(p)),
      new Plane(canvas("phase portrait: rate against coordinate"), (p) => this.portrait(p)),
    ];
    this.panel = panel("motion", "Motion", { planes: () => this.views });
    const { coordinates } = app.about;
    this.of = coordinates[0];
    this.note = element("p", { class: "note" }, "Press on the landscape or the basin map to start a motion.");
    const until = element("input", { type: "number", class: "number", min: 1, max: 300, value: app.state.t_end, "aria-label": "length of the motion [s]" });
    until.addEventListener("change", () => app.change({ t_end: Math.min(300, Math.max(0.1, Number(until.value) || 20)) }, "t_end"));
    this.panel.tools.append(until, " s, portrait of ", choice("coordinate of the phase portrait", coordinates, this.of, (name) => { this.of = name; this.set(); }));
    this.panel.body.append(this.note, ...this.views.map((v) => v.canvas));
  }
  take(header, arrays) {
    this.panel.told(header);
    Object.assign(this, { header, arrays });
    this.note.textContent = header.status || `Energy falls from ${short(this.total(0))} J to ${short(this.total(arrays.times.data.length - 1))} J.`;
    this.set();
  }
  total(k) { return this.arrays.kinetic.data[k] + this.arrays.potential.data[k]; }
  column(k) {
    const [n, width] = this.arrays.y.shape, { data } = this.arrays.y;
    return Float32Array.from({ length: n }, (_, t) => data[t * width + k]);
  }
  set() {
    if (!this.arrays) return;
    const { coordinates, states } = this.app.about, n = coordinates.length, units = [...new Set(coordinates.map((c) => states[c].unit))];
    const span = (arrays) => {
      let a = Infinity, b = -Infinity;
      for (const array of arrays) for (const v of array) { if (v < a) a = v; if (v > b) b = v; }
      const edge = 0.06 * (b - a) || 0.5;
      return [a - edge, b + edge];
    };
    const times = [0, Math.max(this.header.t_end, 1e-6)], { kinetic, potential } = this.arrays;
    this.columns = coordinates.map((_, k) => this.column(k));
    const k = coordinates.indexOf(this.of);
    this.pair = [this.columns[k], this.column(n + k)];
    Object.assign(this.views[0], { range: [times, span(this.columns)], labels: ["time [s]", `coordinates [${units.join(", ")}]`] });
    Object.assign(this.views[1], { range: [times, span([kinetic.data, potential.data, [this.total(0)]])], labels: ["time [s]", "energy [J]"] });
    Object.assign(this.views[2], { range: this.pair.map((c) => span([c])), labels: [`${this.of} [${states[this.of].unit}]`, `${this.of}' [${states[this.of].unit}/s]`] });
    this.later();
  }
  later() { this.views.forEach((v) => v.later()); }
  legend(p, words) {
    words.forEach((word, k) => p.ink.text(p.box.right - 6, p.box.top + 8 + 14 * k, word, { color: css(COLORS[k]), align: "right" }));
  }
  cursor(p) {
    if (!this.arrays) return;
    const t = this.arrays.times.data[Math.min(this.app.frame, this.arrays.times.data.length - 1)];
    p.ink.line([[p.x(t), p.box.top], [p.x(t), p.box.bottom]], { color: css("orange"), width: 1.5 });
  }
  history(p) {
    if (!this.arrays) return;
    this.columns.forEach((c, k) => p.curve(this.arrays.times.data, c, { color: css(COLORS[k]) }));
    this.legend(p, this.app.about.coordinates);
    this.cursor(p);
  }
  energies(p) {
    if (!this.arrays) return;
    const { times, kinetic, potential } = this.arrays;
    p.curve(times.data, kinetic.data, { color: css(COLORS[0]) });
    p.curve(times.data, potential.data, { color: css(COLORS[1]) });
    p.curve(times.data, kinetic.data.map((_, k) => this.total(k)), { color: css(COLORS[2]) });
    this.legend(p, ["kinetic", "potential, without load", "sum"]);
    this.cursor(p);
  }
  portrait(p) {
    if (!this.arrays) return;
    p.curve(...this.pair, { color: css("blue") });
    const k = Math.min(this.app.frame, this.pair[0].length - 1);
    p.ink.circle(p.x(this.pair[0][k]), p.y(this.pair[1][k]), 6, { fill: css("vermillion") });
  }
}
