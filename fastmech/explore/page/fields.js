// Views over two states or two parameters: the landscape, the basin map and the atlas.
import { Plane, canvas, choice, css, draggable, element, panel, short } from "./ink.js";

const NAMED = 40; // classes of starts in a legend at most

// Okabe and Ito's colours and further ones as in the package's pictures; told apart by colour-blind readers.
const COLORS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442", "#a7d8ba", "#6200ff", "#4e89ff", "#3b766c", "#a7ffb1", "#62d8ff", "#a7450a", "#76c480", "#ce00a7", "#c4d880", "#62c4c4"];
const CIVIDIS = [[0, 34, 78], [53, 69, 108], [102, 105, 112], [148, 142, 119], [200, 184, 102], [254, 232, 56]];

// What happens on curves of the atlas, and their dashes in the order in which kinds come.
const MEANS = { fold: "two equilibria meet", pitchfork: "three become one", Hopf: "a swing grows", coalescence: "two modes meet and one grows", "flutter-divergence": "growth with a swing or without", transcritical: "two exchange stability" };
const DASHES = [[], [7, 4], [2, 4], [9, 3, 2, 3], [1, 2]];

const STEPS = 15, LOWER = 9; // of height in the landscape; up to the highest equilibrium where most lies above it

const GREY = [120, 120, 120]; // not decided
// Starts without a label, and what else has gone wrong.
const UNLABELLED = { undecided: "#787878", at_saddle: "#000000", out_of_range: "#d0b8a0", unsure: "#e6e6e6", escaped: "#404040" }, FAILED = "#b3a2c7";
const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));
function cividis(s) {
  const t = Math.min(0.9999, Math.max(0, s)) * 5, k = Math.floor(t);
  return CIVIDIS[k].map((v, j) => v + (t - k) * (CIVIDIS[k + 1][j] - v));
}

// A picture with one pixel for each point (i along x, j along y), colour by `of(i, j)`.
function picture(nx, ny, of) {
  const c = document.createElement("canvas");
  c.width = nx; c.height = ny;
  const image = new ImageData(nx, ny);
  for (let i = 0; i < nx; i++) for (let j = 0; j < ny; j++) {
    const color = of(i, j), p = 4 * ((ny - 1 - j) * nx + i);
    if (color) image.data.set([...color, 255], p);
  }
  c.getContext("2d").putImageData(image, 0, 0);
  return c;
}

// Steps of height with lines between them, two pixels a value; `step` gives a height's.
function heights(data, nx, ny, step) {
  const w = 2 * nx - 1, h = 2 * ny - 1, levels = new Uint8Array(w * h);
  for (let j = 0; j < h; j++) for (let i = 0; i < w; i++) {
    const a = Math.min(nx - 2, i >> 1), b = Math.min(ny - 2, j >> 1), x = i / 2 - a, y = j / 2 - b, p = b * nx + a;
    const v = (1 - y) * ((1 - x) * data[p] + x * data[p + 1]) + y * ((1 - x) * data[p + nx] + x * data[p + nx + 1]);
    levels[j * w + i] = Math.min(STEPS - 1, step(v));
  }
  const shades = Array.from({ length: STEPS }, (_, k) => cividis((k + 0.5) / STEPS)), c = document.createElement("canvas");
  c.width = w; c.height = h;
  const image = new ImageData(w, h);
  for (let j = 0; j < h; j++) for (let i = 0; i < w; i++) {
    const p = j * w + i, q = 4 * ((h - 1 - j) * w + i), line = (i + 1 < w && levels[p] !== levels[p + 1]) || (j + 1 < h && levels[p] !== levels[p + w]), s = shades[levels[p]];
    for (let k = 0; k < 3; k++) image.data[q + k] = line ? 0.7 * s[k] : s[k];
    image.data[q + 3] = 255;
  }
  c.getContext("2d").putImageData(image, 0, 0);
  return c;
}

function swatch(color) {
  const made = element("span", { class: "swatch" });
  made.style.background = `rgb(${color.join(",")})`;
  return made;
}

class Field {
  constructor(app, id, title, key, about, label) {
    Object.assign(this, { app, id, key, about });
    this.canvas = canvas(label);
    this.plane = new Plane(this.canvas, (p) => this.draw(p), { over: (p) => this.over(p), edge: 10, top: 12 });
    this.panel = panel(id, title, { planes: () => [this.plane] });
    const names = Object.keys(about);
    this.selects = [0, 1].map((k) => choice(`${title}, ${k ? "vertical" : "horizontal"} axis`, names, app.state[key][k], (name) => {
      const axes = [...app.state[key]];
      if (axes[1 - k] === name) axes[1 - k] = axes[k];
      axes[k] = name;
      app.change({ [key]: axes }, id);
    }));
    this.note = element("p", { class: "note", "aria-live": "polite" });
    this.panel.tools.append(...this.selects);
    this.panel.body.append(this.canvas, this.note);
  }
  axes() { return Object.fromEntries(this.app.state[this.key].map((n) => [n, [this.about[n].low, this.about[n].high]])); }
  // Whether what was answered is over the axes that are chosen.
  get current() { return Boolean(this.shown) && Object.keys(this.shown).join() === this.app.state[this.key].join(); }
  set() {
    const names = this.app.state[this.key], labels = names.map((n) => `${n} [${this.about[n].unit}]`);
    if (labels.join() !== this.plane.labels.join()) this.plane.later();
    this.selects.forEach((s, k) => { s.value = names[k]; });
    this.plane.range = names.map((n) => [this.about[n].low, this.about[n].high]);
    this.plane.labels = labels;
  }
  put(image) {
    const p = this.plane, [nx, ny] = [image.width - 1, image.height - 1], names = Object.keys(this.shown);
    const [a, b] = names.map((n) => this.shown[n]);
    const hx = (p.x(a[1]) - p.x(a[0])) / nx, hy = (p.y(b[0]) - p.y(b[1])) / ny;
    p.ink.image(image, p.x(a[0]) - hx / 2, p.y(b[1]) - hy / 2, hx * (nx + 1), hy * (ny + 1));
  }
  // What the picture is a slice at, and which equilibria lie in it.
  slice() {
    const names = this.app.state[this.key], { coordinates, states } = this.app.about, held = coordinates.filter((n) => !names.includes(n));
    return held.length ? ` Held: ${held.map((n) => `${n} = 0 ${states[n].unit}`).join(", ")}; equilibria elsewhere are pale.` : "";
  }
  within(row) {
    const { coordinates, states } = this.app.about, names = this.app.state[this.key];
    return coordinates.every((n, k) => names.includes(n) || Math.abs(row.position[k] - (states[n].periodic ? 2 * Math.PI * Math.round(row.position[k] / (2 * Math.PI)) : 0)) < 1e-6);
  }
  // The equilibria and the motion's path, over the states that are the axes.
  marks() {
    const p = this.plane, { coordinates } = this.app.about, names = this.app.state[this.key];
    this.wrapped();
    if (this.path) {
      const { left, right, top, bottom } = p.box;
      p.ink.clip(left, top, right - left, bottom - top); // marks may lie on the edge, the path ends there
      for (const look of [{ color: "#000000", width: 3 }, { color: "#ffffff", width: 1.4 }]) p.curve(...this.path, look);
      p.ink.unclip();
    }
    (this.app.rows ?? []).forEach((row, k) => {
      const [x, y] = names.map((n) => (coordinates.includes(n) ? row.position[coordinates.indexOf(n)] : 0));
      if (!this.within(row)) {
        for (const [color, width] of [["#ffffff", 4], ["#000000", 1.2]]) p.ink.circle(p.x(x), p.y(y), 8, { color, width, fill: width < 2 ? "rgba(255, 255, 255, 0.6)" : null });
        p.ink.text(p.x(x), p.y(y), `${k}`, { color: "#000000", size: 10 });
        return;
      }
      const stable = row.verdict.includes("stable") && !row.verdict.includes("unstable"), chosen = k === this.app.state.chosen;
      if (chosen) p.ink.circle(p.x(x), p.y(y), 12, { color: "#ffffff", width: 3 });
      p.ink.circle(p.x(x), p.y(y), 8, { fill: stable ? "#000000" : "#ffffff", color: stable ? "#ffffff" : "#000000", width: 1.5 });
      p.ink.text(p.x(x), p.y(y), `${k}`, { color: stable ? "#ffffff" : "#000000", size: 11 });
    });
  }
  // Said until the first answer is there.
  waits(words) { if (!this.shown) this.note.textContent = words; }
  // The path within one turn, broken where it leaves at one side and comes back at the other.
  wrapped() {
    const motion = this.app.motion, names = this.app.state[this.key], key = names.join();
    if (this.wrappedOf === motion && this.wrappedKey === key) return;
    Object.assign(this, { wrappedOf: motion, wrappedKey: key, path: null, at: null });
    if (!motion) return;
    const { states } = this.app.about, all = Object.keys(states), [ts] = motion.shape, xs = [], ys = [];
    const k = names.map((n) => all.indexOf(n));
    this.at = (t) => k.map((c, j) => {
      const { periodic, low, high } = states[names[j]], v = motion.data[t * all.length + c];
      return periodic ? v - Math.floor((v - low) / (high - low)) * (high - low) : v;
    });
    for (let t = 0, before = null; t < ts; t++) {
      const at = this.at(t);
      if (before && at.some((v, j) => Math.abs(v - before[j]) > 0.5 * (states[names[j]].high - states[names[j]].low))) { xs.push(NaN); ys.push(NaN); }
      xs.push(at[0]); ys.push(at[1]);
      before = at;
    }
    this.path = [xs, ys];
  }
  over(p) {
    const { motion, frame, per } = this.app;
    if (!motion || !this.at) return;
    const [x, y] = this.at(Math.min(per * frame, motion.shape[0] - 1));
    p.ink.circle(p.x(x), p.y(y), 7, { fill: "#D55E00", color: "#ffffff", width: 2 });
  }
  starts() {
    const from = (at) => this.app.startAt(Object.fromEntries(this.app.state[this.key].map((n, k) => [n, at[k]])));
    draggable(this.plane, {
      move: from,
      end: () => this.app.letGo(),
      keys: (step) => from(this.app.state[this.key].map((n, k) => (this.app.state.start?.[n] ?? 0) + step[k])),
    });
  }
}

export class Landscape extends Field {
  constructor(app) {
    super(app, "landscape", "Potential and equilibria", "landscape", app.about.states, "energy at rest over two states with all equilibria; press or drag to start a motion there");
    this.starts();
  }
  take(header, arrays) {
    this.shown = header.axes;
    this.proof = header.certificate;
    this.complete = header.complete;
    this.image = null;
    this.note.textContent = `${header.complete ? "Proved: " : "Not decided everywhere: "}${header.certificate}.`;
    if (arrays.landscape) {
      const { data, shape } = arrays.landscape, [ny, nx] = shape;
      let low = Infinity, high = -Infinity;
      for (const v of data) { if (v < low) low = v; if (v > high) high = v; }
      // Wells that are shallow beside their surroundings have steps of their own.
      const top = Math.max(low, ...this.app.rows.filter((row) => row.energy !== null && row.energy < high && this.within(row)).map((row) => row.energy)), deep = top - low;
      this.knee = deep > 1e-6 * (high - low) && deep < 0.4 * (high - low) ? top : null;
      const [one, two] = this.knee === null ? [(high - low) / STEPS || 1, 1] : [deep / LOWER, (high - top) / (STEPS - LOWER)];
      this.note.textContent += ` Energy from ${short(low)} J (dark) to ${short(high)} J (bright)${high > low ? `, lines every ${short(one)} J` : ""}${this.knee === null ? "" : ` up to the highest equilibrium at ${short(top)} J, every ${short(two)} J above`}.`;
      this.image = heights(data, nx, ny, this.knee === null ? (v) => (v - low) / one : (v) => (v < top ? (v - low) / one : LOWER + (v - top) / two));
      this.span = [low, high];
    } else { this.span = [0, 0]; this.note.textContent += " The forces are not known to have a potential."; }
    this.note.textContent += this.slice();
    this.panel.tell(this.app.about, "landscape", { ...header.asked, divisions: header.divisions, potential: Boolean(arrays.landscape), knee: this.knee, steps: this.knee === null ? [STEPS] : [LOWER, STEPS - LOWER] });
    this.plane.later();
  }
  draw() { if (this.image && this.current) this.put(this.image); this.marks(); }
}

export class Basins extends Field {
  constructor(app) {
    super(app, "basins", "Basins", "basins", app.about.states, "where starts over two states end; press or drag to start a motion there");
    this.starts();
    this.colors = new Map();
  }
  color(well, turns) {
    const name = `${well}:${turns.join(",")}`, plain = !turns.some((t) => t);
    if (!this.colors.has(name)) {
      // Unturned wells have the first colours, whatever else is in the picture.
      const place = plain ? this.wells.indexOf(well) : this.wells.length + this.turned++;
      // What comes after the last colour has paler ones: none is another's.
      const pale = 1 - 0.6 ** Math.floor(place / COLORS.length);
      this.colors.set(name, { color: rgb(COLORS[place % COLORS.length]).map((v) => v + pale * (255 - v)), well, turns });
    }
    return this.colors.get(name).color;
  }
  take(header, arrays) {
    const n = header.divisions + 1, rows = arrays.well.shape[0], q = arrays.turns.shape[2];
    if (this.shownId !== header.id) { this.colors.clear(); this.turned = 0; this.wells = header.attractors ? header.attractors.map((_, k) => k) : header.wells; this.shownId = header.id; this.grid = null; }
    this.shown = header.axes;
    if (!this.grid || this.grid.n !== n) {
      const before = this.grid;
      this.grid = { n, image: document.createElement("canvas"), well: new Int8Array(n * n).fill(-2), status: new Int8Array(n * n) };
      this.grid.image.width = this.grid.image.height = n;
      if (before) this.grid.image.getContext("2d").drawImage(before.image, 0, 0, n, n);
    }
    const { image, well, status } = this.grid, ends = header.statuses.map((name) => rgb(UNLABELLED[name] ?? FAILED));
    for (const [field, { data }] of [[well, arrays.well], [status, arrays.status]]) field.set(data, header.from * n);
    const strip = new ImageData(rows, n);
    for (let r = 0; r < rows; r++) for (let j = 0; j < n; j++) {
      const at = r * n + j, w = arrays.well.data[at], p = 4 * ((n - 1 - j) * rows + r);
      if (w === -2) continue;
      const t = arrays.time.data[at];
      const base = w < 0 ? ends[arrays.status.data[at]] : this.color(w, Array.from(arrays.turns.data.subarray(at * q, at * q + q)));
      const shade = w < 0 ? 1 : 1 - 0.35 * Math.min(1, (Number.isFinite(t) ? t : 0) / 10);
      strip.data.set([...base.map((v) => v * shade), 255], p);
    }
    const c = document.createElement("canvas");
    c.width = rows; c.height = n;
    c.getContext("2d").putImageData(strip, 0, 0);
    image.getContext("2d").drawImage(c, header.from, 0);
    if (header.last) {
      this.panel.tell(this.app.about, "basins", { ...header, ...header.asked });
      const shown = [...this.colors.values()].slice(0, NAMED).flatMap(({ color, well: w, turns }) => [swatch(color), `${header.attractors ? header.attractors[w] : w}${turns.some((t) => t) ? ` after ${turns.join(", ")} turns` : ""}   `]);
      // As the library calls them.
      const counts = ends.map(() => 0);
      status.forEach((s, i) => { if (well[i] === -1) counts[s]++; });
      const none = header.statuses.map((name, k) => [name, ends[k], counts[k]]).filter(([, , count]) => count);
      this.note.replaceChildren(`${n} × ${n} starts${header.final ? "" : ", refining"}. ${header.attractors ? "They come to " : "Proved to end at equilibrium "}`, ...shown, this.colors.size > NAMED ? `and ${this.colors.size - NAMED} more. ` : "", "Darker: later. ", ...none.flatMap(([name, color, count], k) => [swatch(color), `${name}: ${count.toLocaleString("en")}${k < none.length - 1 ? "   " : "."}`]), this.slice());
      this.levels = { ...(this.levels ?? {}), [n]: header.waited };
      this.canvas.dataset.divisions = header.divisions;
    }
    this.plane.later();
  }
  draw() { if (this.grid && this.current) this.put(this.grid.image); this.marks(); }
}

export class Atlas extends Field {
  constructor(app) {
    super(app, "atlas", "Atlas of parameters", "atlas", app.about.parameters, "numbers of equilibria over two parameters with folds; drag the point");
    const move = (at) => app.change({ parameters: { ...app.state.parameters, ...Object.fromEntries(app.state.atlas.map((n, k) => [n, at[k]])) } }, "atlas point");
    draggable(this.plane, {
      move,
      keys: (step) => move(app.state.atlas.map((n, k) => Math.min(this.about[n].high, Math.max(this.about[n].low, app.state.parameters[n] + step[k])))),
    });
  }
  take(header, arrays) {
    this.panel.tell(this.app.about, "atlas", { ...header.asked, divisions: header.divisions });
    this.shown = header.axes;
    const { data, shape } = arrays.count, [nx, ny] = shape, stable = arrays.stable.data, decided = arrays.decided.data;
    const seen = new Map(), undecided = decided.filter((one) => !one).length;
    for (let k = 0; k < data.length; k++) if (decided[k]) seen.set(100 * data[k] + stable[k], [data[k], stable[k]]);
    const kinds = [...seen.keys()].sort((a, b) => a - b);
    const color = (i, j) => (decided[i * ny + j] ? rgb(COLORS[kinds.indexOf(100 * data[i * ny + j] + stable[i * ny + j]) % COLORS.length]) : GREY);
    this.image = picture(nx, ny, color);
    const legend = kinds.map((k, index) => ({ color: COLORS[index % COLORS.length], words: `${seen.get(k)[0]} equilibri${seen.get(k)[0] === 1 ? "um" : "a"}, ${seen.get(k)[1]} stable` }));
    if (undecided) legend.push({ color: `rgb(${GREY})`, words: `not decided: ${undecided} points` });
    this.curves = header.curves.map((kind, k) => ({ kind, xy: arrays[`curve${k}`] }));
    this.kinds = [...new Set(header.curves)];
    this.plane.legend = [...legend, ...this.kinds.map((words, k) => ({ words, dash: DASHES[k % DASHES.length] }))];
    const told = this.kinds.map((kind) => `${header.curves.filter((k) => k === kind).length} of kind ${kind} (${MEANS[kind] ?? "several at once"})`).join(", ");
    this.note.textContent = `${nx} × ${ny} points.${told ? ` Curves: ${told}${header.curves_complete ? "; proved to be all" : ""}.` : ""}${header.changes ? ` Of ${header.changes} changes between neighbouring points ${header.unexplained} lie on no curve.` : ""} The cross is the present point.${this.app.held() ? " The force is held at its first value." : ""}`;
    this.canvas.dataset.divisions = header.divisions;
    this.plane.later();
  }
  draw(p) {
    if (!this.image || !this.current) return;
    this.put(this.image);
    for (const { kind, xy } of this.curves) {
      const n = xy.shape[1];
      p.curve(xy.data.subarray(0, n), xy.data.subarray(n), { color: "#000000", width: 1.8, dash: DASHES[this.kinds.indexOf(kind) % DASHES.length] });
    }
  }
  over(p) {
    const [x, y] = this.app.state.atlas.map((n) => this.app.state.parameters[n]);
    for (const [color, width] of [["#ffffff", 5], ["#000000", 2]]) {
      p.ink.line([[p.x(x) - 9, p.y(y)], [p.x(x) + 9, p.y(y)]], { color, width });
      p.ink.line([[p.x(x), p.y(y) - 9], [p.x(x), p.y(y) + 9]], { color, width });
    }
  }
}
