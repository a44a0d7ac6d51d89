// The page's state, which its address holds, and who is told of what changes.
import { Talk } from "./talk.js";
import { Parameters } from "./parameters.js";
import { MechanismView, SPEEDS } from "./mechanism.js";
import { Atlas, Basins, Landscape } from "./fields.js";
import { Histories } from "./histories.js";
import { Table, sections } from "./table.js";

const status = document.getElementById("status"), error = document.getElementById("error");

const RATE = 5; // end of the range of a rate [rad/s or m/s]
const VIEWS = { equilibria: "the equilibria", motion: "the motion", basins: "the basin map", atlas: "the atlas", pull: "a start", strike: "a kick" };

// A size that a parameter without one may have: the largest of its unit, or what the others make of it.
function usual(name, parameters) {
  const of = (unit, best = Math.max) => best(...Object.entries(parameters).filter(([n, p]) => n !== name && p.unit === unit && p.reset).map(([, p]) => Math.abs(p.reset)));
  const [m, g, k, kt, long, short] = [of("kg"), of("m/s2"), of("N/m"), of("N m"), of("m"), of("m", Math.min)], { unit } = parameters[name];
  const made = {
    N: [m * g, k * short ** 3 / long ** 2, kt / long], "N/m": [m * g / long, kt / long ** 2], "N m": [m * g * long, k * long ** 2],
    "N s/m": [Math.sqrt(k * m), m * Math.sqrt(g / long)], "N m s": [long * Math.sqrt(kt * m), m * long * Math.sqrt(g * long)],
  };
  return [of(unit), ...(made[unit] ?? []), 1].find((v) => v > 0 && Number.isFinite(v));
}

// Asks for one answer at a time: each that comes is shown, and what changes meanwhile waits for it. An answer that takes
// much longer than the one before is given up for the newest, each time later: in the end one comes.
class Asking {
  constructor(ask, least) { Object.assign(this, { ask, least, patience: least, busy: false, again: false }); }
  want() {
    this.again = this.busy;
    if (this.busy) return;
    this.busy = true;
    this.timer = setTimeout(() => { this.patience *= 2; this.free(); }, this.patience);
    this.ask();
  }
  answered(waited) { this.patience = Math.max(this.least, 2 * waited); this.free(); }
  free() {
    const { again } = this;
    this.drop();
    if (again) this.want();
  }
  drop() { clearTimeout(this.timer); this.busy = this.again = false; }
}

class App {
  constructor() {
    this.frame = this.shown = 0;
    this.waits = { answers: [], equilibria: [], motion: [] };
    this.resting = new Asking(() => this.askEquilibria(), 400);
    this.moving = new Asking(() => this.sendMotion(), 1000);
    this.talk = new Talk({
      about: (message) => this.begin(message),
      equilibria: (header, arrays) => this.equilibria(header, arrays),
      motion: (header, arrays) => this.moves(header, arrays),
      basins: (header, arrays) => { this.clear(header.kind); this.basins.take(header, arrays); },
      atlas: (header, arrays) => { this.clear(header.kind); this.atlas.take(header, arrays); },
      pull: (header) => { this.clear("pull"); this.from(header.state, true); },
      strike: (header) => { this.clear("strike"); this.mechanism.kicked(header); },
      error: (message) => this.refused(message),
      compiling: (told) => this.compiling(told),
      waiting: () => this.waiting(),
      closed: () => this.ended(),
    });
  }
  // Ranges of sliders and of the atlas: from zero, or above where it must be, to some times the usual value.
  ranges(about) {
    for (const [name, p] of Object.entries(about.parameters)) {
      p.high = Number((2.5 * (Math.max(Math.abs(p.reset), Math.abs(p.value)) || usual(name, about.parameters))).toPrecision(1));
      p.low = !p.zero ? p.high / 100 : (p.negative && p.unit === "N") || Math.min(p.reset, p.value) < 0 ? -p.high : 0;
      p.first = { low: p.low, high: p.high };
    }
    // The force of the arrow that says how long the others are.
    const force = Object.values(about.parameters).find((p) => p.unit === "N");
    this.arrow = Number((Math.abs(force?.reset ?? 0) || (force?.high ?? 3) / 3).toPrecision(2));
    about.coordinates = Object.keys(about.states);
    about.rates.forEach((rate, k) => { about.states[rate] = { unit: `${about.states[about.coordinates[k]].unit}/s`, low: -RATE, high: RATE, periodic: false }; });
  }
  narrow(names) {
    const wide = names.map((n) => [n, this.about.parameters[n]]).filter(([, p]) => p.low !== p.first.low || p.high !== p.first.high);
    for (const [, p] of wide) Object.assign(p, p.first);
    this.uncounted ||= wide.some(([n]) => this.state.atlas.includes(n));
  }
  // Ranges hold every value that the mechanism can have and still has.
  widen(parameters) {
    const wider = Object.entries(parameters).filter(([n, v]) => v === this.state.parameters[n] && (v < this.about.parameters[n].low || v > this.about.parameters[n].high));
    for (const [n, v] of wider) { const p = this.about.parameters[n]; p.low = Math.min(p.low, v); p.high = Math.max(p.high, v); }
    if (wider.some(([n]) => this.state.atlas.includes(n))) this.askAtlas();
  }
  begin(about) {
    this.about = about;
    this.ranges(about);
    document.getElementById("name").textContent = about.source?.includes(":") ? about.source.replace(/^.*[/\\]/, "") : about.name;
    const names = Object.keys(about.states), parameters = Object.keys(about.parameters), n = about.coordinates.length;
    const two = n > 1 ? names.slice(0, 2) : [names[0], names[n]];
    const atlas = ["F0", "c2"].every((p) => parameters.includes(p)) ? ["F0", "c2"] : parameters.slice(-2);
    this.state = { parameters: Object.fromEntries(Object.entries(about.parameters).map(([k, v]) => [k, v.value])), landscape: two, basins: two, atlas, chosen: 0, start: null, t_end: 20, portrait: names[0], frame: 0, speed: 1 };
    this.restore();
    this.parameters = new Parameters(this);
    this.mechanism = new MechanismView(this);
    this.landscape = new Landscape(this);
    this.basins = new Basins(this);
    if (atlas.length > 1) this.atlas = new Atlas(this);
    this.histories = new Histories(this);
    this.table = new Table(this);
    addEventListener("hashchange", () => {
      if (location.hash === this.hash) return;
      this.rests();
      this.restore();
      this.mechanism.frame = this.state.frame;
      this.mechanism.speed.value = this.state.speed;
      this.histories.until.value = this.state.t_end;
      this.histories.set();
      this.all();
    });
    performance.mark("usable");
    sections(about);
    this.all();
  }
  restore() {
    if (location.hash.length < 2) return;
    try {
      const kept = JSON.parse(decodeURIComponent(location.hash.slice(1))), known = new Set(Object.keys(this.about.states));
      const pair = (v, names) => Array.isArray(v) && v.length === 2 && v[0] !== v[1] && v.every((n) => names.has(n));
      for (const [name, value] of Object.entries(kept.parameters ?? {})) if (name in this.state.parameters && Number.isFinite(value)) this.state.parameters[name] = value;
      for (const key of ["landscape", "basins"]) if (pair(kept[key], known)) this.state[key] = kept[key];
      if (pair(kept.atlas, new Set(Object.keys(this.about.parameters)))) this.state.atlas = kept.atlas;
      if (Number.isInteger(kept.chosen) && kept.chosen >= 0) this.state.chosen = kept.chosen;
      if (kept.t_end >= 0.1 && kept.t_end <= 300) this.state.t_end = kept.t_end;
      if (SPEEDS.includes(kept.speed)) this.state.speed = kept.speed;
      if (this.about.coordinates.includes(kept.portrait)) this.state.portrait = kept.portrait;
      this.state.frame = Number.isInteger(kept.frame) && kept.frame >= 0 ? kept.frame : 0;
      this.state.start = null;
      if (kept.start && Object.keys(kept.start).length && Object.entries(kept.start).every(([n, v]) => known.has(n) && Number.isFinite(v))) this.state.start = kept.start;
    } catch { this.failed = "address"; error.textContent = "The address holds no state that can be read."; }
  }
  keep() {
    this.keeping ??= setTimeout(() => {
      this.keeping = null;
      this.hash = `#${encodeURIComponent(JSON.stringify(this.state))}`;
      history.replaceState(null, "", this.hash);
    }, 250); // browsers let an address change so often
  }
  // What cannot be answered is said where the answer would be; of what all hangs on, and of a hand, at the top too.
  refused({ line, of }) {
    const { landscape, table, mechanism, basins, atlas, histories } = this, still = this.motion ? [] : [mechanism];
    const views = { equilibria: [landscape, table, ...still], basins: [basins], atlas: [atlas], motion: [...histories.panels.map((one) => ({ panel: one })), mechanism] }[of] ?? [];
    views.forEach((one) => { one.waits?.(""); one.panel.refuse(line); });
    if (of === "equilibria" || !views.length) { this.failed = of; error.textContent = line; mechanism.fire = false; }
    if (of === "strike") mechanism.kick.textContent = line;
    ({ equilibria: this.resting, motion: this.moving })[of]?.free();
  }
  clear(kind) { if (this.failed === kind || this.failed === undefined) error.textContent = ""; }
  // Nothing follows any more: what is shown is marked, and nothing can be moved away from it.
  ended() {
    this.waiting = () => {};
    clearTimeout(this.late);
    clearTimeout(this.told);
    status.textContent = "the server has ended";
    error.textContent = "The server has ended: nothing follows any more. Start it again and reload this page.";
    this.mechanism?.pause();
    const panels = document.getElementById("panels");
    panels.inert = true;
    for (const one of panels.children) one.classList.add("stale");
  }
  // Ready is the page when all that was asked for is there; what waits for long is named.
  waiting() {
    if (this.kernel) return;
    const { pending } = this.talk ?? {};
    if (!pending?.size) { clearTimeout(this.late); this.late = null; status.textContent = "ready"; return; }
    this.late ??= setTimeout(() => { this.late = null; if (!this.kernel) status.textContent = `working on ${[...pending].map((kind) => VIEWS[kind]).join(", ")}`; }, 300);
  }
  compiling({ name, of, number, about }) {
    clearTimeout(this.told);
    this.kernel = true;
    if (name === null) this.told = setTimeout(() => { this.kernel = false; this.waiting(); }, 300);
    else status.textContent = `loading or compiling for ${of.map((kind) => VIEWS[kind]).join(" and ") || "the page"}: ${name}, kernel ${number} of about ${about}`;
  }
  all() {
    this.parameters.show();
    this.askAtlas();
    this.refresh();
    if (this.state.start) this.askMotion();
  }
  change(change, what) {
    const before = this.state;
    this.state = { ...before, ...change };
    if (this.failed === "address") this.clear("address");
    this.keep();
    if (what === "parameters" || what === "atlas point") {
      // All views have refused the values before.
      if (this.failed === "equilibria") for (const one of [this.landscape, this.table, this.mechanism, this.basins, this.atlas, ...this.histories.panels]) (one?.panel ?? one)?.again();
      this.parameters.show();
      this.atlas?.plane.moved();
      const moved = Object.keys(this.state.parameters).some((n) => !this.state.atlas.includes(n) && this.state.parameters[n] !== before.parameters[n]);
      this.uncounted ||= moved || this.talk.pending.has("atlas");
      this.stop();
      if (this.uncounted) { clearTimeout(this.later); this.later = setTimeout(() => this.askAtlas(), 200); }
      this.refresh();
      this.follow();
    } else if (what === "atlas") this.askAtlas();
    else if (what === "basins") this.askBasins();
    else if (what === "t_end") { if (this.state.start) this.askMotion(); } else if (what === "portrait") this.histories.set();
    else if (what === "speed") return;
    else this.refresh();
  }
  // What takes longer leaves the processors to the equilibria, and begins anew when the slider rests.
  stop() {
    for (const kind of ["basins", "atlas"]) if (this.talk.pending.has(kind)) this.talk.drop(kind);
  }
  follow() {
    if (!this.state.start) return;
    clearTimeout(this.following);
    const since = performance.now() - (this.talk.asked.motion ?? 0);
    this.following = setTimeout(() => this.askMotion(), since > 1000 ? 0 : 200);
  }
  refresh() {
    this.resting.want();
    clearTimeout(this.mapping);
    this.mapping = setTimeout(() => this.askBasins(), 200);
  }
  askEquilibria() {
    this.landscape.set();
    this.talk.ask("equilibria", { parameters: this.state.parameters, axes: this.landscape.axes() });
  }
  askBasins() {
    this.basins.set();
    this.basins.waits("Starts are being followed.");
    this.talk.ask("basins", { parameters: this.state.parameters, axes: this.basins.axes() });
  }
  askAtlas() {
    if (!this.atlas) return;
    this.uncounted = false;
    clearTimeout(this.later);
    this.atlas.set();
    this.atlas.waits("Equilibria are being counted.");
    this.talk.ask("atlas", { parameters: this.held() ? { ...this.state.parameters, alpha: 0 } : this.state.parameters, axes: this.atlas.axes() });
  }
  // Over the force of the paper's mechanism the atlas is of one that stays: of one that fades nothing is left at rest.
  held() { return this.about.name === "slider_pendulum" && this.state.parameters.alpha > 0 && this.state.atlas.includes("F0"); }
  askMotion() { if (this.state.start) this.moving.want(); }
  sendMotion() {
    const { t_end } = this.state;
    this.talk.ask("motion", { parameters: this.state.parameters, start: this.state.start, t_end, outputs: Math.min(18001, Math.round(60 * t_end) + 1) });
  }
  equilibria(header, arrays) {
    this.clear("equilibria");
    const asked = performance.now() - header.waited;
    this.waits.answers.push(header.waited);
    this.rows = header.rows;
    this.widen(header.asked.parameters);
    this.state.chosen = Math.min(this.state.chosen, Math.max(0, this.rows.length - 1));
    this.landscape.take(header, arrays);
    this.table.take(header);
    this.mechanism.rest(header, arrays);
    this.basins.plane.later();
    requestAnimationFrame(() => this.waits.equilibria.push(performance.now() - asked)); // when it has been drawn
    this.resting.answered(header.waited);
  }
  moves(header, arrays) {
    this.clear("motion");
    this.waits.motion.push(header.waited);
    Object.assign(this, { motion: arrays.curve, per: header.per });
    this.histories.take(header, arrays);
    this.landscape.plane.later();
    this.basins.plane.later();
    this.mechanism.moves(header, arrays);
    if (this.play && !this.mechanism.playing) { this.play = false; this.mechanism.start(); }
    this.moving.answered(header.waited);
  }
  frameMoved(frame) {
    this.frame = frame;
    if (this.motion && frame !== this.state.frame) { this.state.frame = frame; this.keep(); }
    if (this.mechanism.playing && ++this.shown % 3) return; // often enough to follow
    this.landscape.plane.moved();
    this.basins.plane.moved();
    this.histories.moved();
  }
  choose(k) {
    this.state = { ...this.state, chosen: k, start: null, frame: 0 };
    this.keep();
    this.rests();
    this.table.take();
  }
  // The motion is over, and what is under way of it too.
  rests() {
    clearTimeout(this.following);
    for (const kind of ["motion", "pull", "strike"]) this.talk.drop(kind);
    this.moving.drop();
    Object.assign(this, { motion: null, play: false });
    this.histories.clear();
    this.mechanism.atRest();
    this.landscape.plane.later();
    this.basins.plane.later();
  }
  startAt(values) { this.from(values, true); }
  from(start, still) {
    this.state = { ...this.state, start };
    this.mechanism.hint();
    this.keep();
    if (still) { this.mechanism.frame = 0; this.mechanism.pause(); }
    this.askMotion();
  }
  letGo() { this.play = true; if (!this.moving.busy && this.motion) { this.play = false; this.mechanism.start(); } }
  pull(what) { this.talk.ask("pull", { parameters: this.state.parameters, ...what }); }
  strike(what) { this.talk.ask("strike", { parameters: this.state.parameters, ...what }); }
}

globalThis.explorer = new App();
