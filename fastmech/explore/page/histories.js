// Time histories, phase portrait and energies of the motion that was started.
import { Plane, canvas, choice, css, element, panel, short } from "./ink.js";

const COLORS = ["blue", "vermillion", "green", "purple"], DASHES = [[], [7, 4], [2, 4], [9, 3, 2, 3]];

const NONE = "Press on the landscape or the basin map to start a motion.";

export class Histories {
  constructor(app) {
    this.app = app;
    const { coordinates } = app.about, over = (p) => this.cursor(p);
    const view = (label, draw, low, more = { over, top: 26 }) => new Plane(canvas(label, low), draw, more);
    const history = view("coordinates against time", (p) => this.history(p), false);
    const energies = view("energies against time", (p) => this.energies(p), true);
    const works = view("works of loads and of dampers against time", (p) => this.works(p), true);
    const portrait = view("phase portrait: rate against coordinate", (p) => this.portrait(p), false, { over: (p) => this.point(p) });
    this.views = [history, energies, works, portrait];
    this.panels = [["motion", "Time histories", [history]], ["energies", "Energy and works", [energies, works]], ["portrait", "Phase portrait", [portrait]]].map(([id, title, planes]) => {
      const made = panel(id, title, { planes: () => planes });
      made.body.append(...planes.map((p) => p.canvas));
      return made;
    });
    [this.note, this.sums, this.rates] = this.panels.map(() => element("p", { class: "note" }, NONE));
    const until = this.until = element("input", { type: "number", class: "number", min: 0.1, step: "any", max: 300, value: app.state.t_end, "aria-label": "length of the motion [s]" });
    until.addEventListener("change", () => {
      app.change({ t_end: Math.min(300, Math.max(0.1, Number(until.value) || 20)) }, "t_end");
      until.value = app.state.t_end; // what counts
    });
    this.panels[0].tools.append(until, " s");
    this.panels[0].body.append(this.note);
    this.panels[1].body.append(this.sums);
    this.panels[2].body.append(this.rates);
    this.of = choice("coordinate of the phase portrait", coordinates, app.state.portrait, (name) => app.change({ portrait: name }, "portrait"));
    this.panels[2].tools.append(this.of);
  }
  take(header, arrays) {
    Object.assign(this, { header, arrays });
    const last = arrays.curve_times.data.length - 1, { brought, lost } = arrays;
    this.note.textContent = header.status || Object.entries(this.app.state.start ?? {}).map(([n, v]) => `${n} = ${short(v)}`).join(", ").replace(/^/, "From ");
    this.sums.textContent = `Kinetic and potential energy: ${short(this.total(0))} J at first, ${short(this.total(last))} J at the end. Loads bring ${short(brought.data[last])} J, dampers take ${short(lost.data[last])} J.`;
    this.rates.textContent = "";
    this.set();
  }
  // No motion is there any more.
  clear() {
    Object.assign(this, { header: null, arrays: null, columns: null, pair: null });
    for (const one of this.panels) { one.filled = false; one.put("", ""); }
    for (const note of [this.note, this.sums, this.rates]) note.textContent = NONE;
    this.later();
  }
  total(k) { return this.arrays.kinetic.data[k] + this.arrays.potential.data[k]; }
  column(k) {
    const [n, width] = this.arrays.curve.shape, { data } = this.arrays.curve;
    return Float32Array.from({ length: n }, (_, t) => data[t * width + k]);
  }
  // What is shown, over the coordinate that is chosen.
  set() {
    const { coordinates, states } = this.app.about, of = this.of.value = this.app.state.portrait;
    if (!this.arrays) return;
    for (const one of this.panels) one.tell(this.app.about, one.section.id, { ...this.header.asked, outputs: this.header.outputs, dt: this.header.dt, of });
    const n = coordinates.length, units = [...new Set(coordinates.map((c) => states[c].unit))];
    const span = (arrays) => {
      let a = Infinity, b = -Infinity;
      for (const array of arrays) for (const v of array) { if (v < a) a = v; if (v > b) b = v; }
      const edge = 0.06 * (b - a) || 0.5;
      return [a - edge, b + edge];
    };
    const times = [0, Math.max(this.header.t_end, 1e-6)], { kinetic, potential } = this.arrays;
    this.columns = coordinates.map((_, k) => this.column(k));
    const k = coordinates.indexOf(of);
    this.pair = [this.columns[k], this.column(n + k)];
    Object.assign(this.views[0], { range: [times, span(this.columns)], labels: ["time [s]", `coordinates [${units.join(", ")}]`] });
    Object.assign(this.views[1], { range: [times, span([kinetic.data, potential.data, [this.total(0)]])], labels: ["time [s]", "energy [J]"] });
    Object.assign(this.views[2], { range: [times, span([this.arrays.brought.data, this.arrays.lost.data, [0]])], labels: ["time [s]", "work [J]"] });
    Object.assign(this.views[3], { range: this.pair.map((c) => span([c])), labels: [`${of} [${states[of].unit}]`, `${of}' [${states[of].unit}/s]`] });
    this.later();
  }
  later() { this.views.forEach((v) => v.later()); }
  moved() { this.views.forEach((v) => v.moved()); }
  // Every curve with a colour, a dash and a word in the legend.
  curves(p, columns, words) {
    if (!this.arrays) return;
    columns.forEach((c, k) => p.curve(this.arrays.curve_times.data, c, { color: css(COLORS[k]), dash: DASHES[k], width: 1.8 }));
    let x = p.box.left;
    words.forEach((word, k) => {
      p.above.push([[x, 12], [x + 26, 12], css(COLORS[k]), DASHES[k], word]);
      x += 44 + 7.4 * word.length;
    });
  }
  cursor(p) {
    if (!this.arrays) return;
    const t = this.arrays.times.data[Math.min(this.app.frame, this.arrays.times.data.length - 1)];
    p.ink.line([[p.x(t), p.box.top], [p.x(t), p.box.bottom]], { color: css("orange"), width: 1.5 });
  }
  history(p) { this.curves(p, this.columns ?? [], this.app.about.coordinates); }
  energies(p) {
    const { kinetic, potential } = this.arrays ?? {};
    if (kinetic) this.curves(p, [kinetic.data, potential.data, kinetic.data.map((_, k) => this.total(k))], ["kinetic", "potential", "sum, without loads"]);
  }
  works(p) { if (this.arrays) this.curves(p, [this.arrays.brought.data, this.arrays.lost.data], ["brought by loads", "taken by dampers"]); }
  portrait(p) { if (this.arrays) p.curve(...this.pair, { color: css("blue") }); }
  point(p) {
    if (!this.arrays) return;
    const k = Math.min(this.header.per * this.app.frame, this.pair[0].length - 1);
    p.ink.circle(p.x(this.pair[0][k]), p.y(this.pair[1][k]), 6, { fill: css("vermillion"), color: css("paper") });
  }
}
