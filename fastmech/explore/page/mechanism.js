// The mechanism to scale, at an equilibrium or in motion; its masses can be dragged, and it can be struck.
import { Plane, canvas, css, draggable, element, fixed, panel, short } from "./ink.js";

const ARROW = 0.17; // length of the arrow that gives the scale, over the mechanism's

const [FIXED, POINT, GUIDE, ROD, SPRING, DAMPER, LOAD, MASS] = [0, 1, 2, 3, 4, 5, 6, 7];

// Names as in the package's pictures.
const SYMBOLS = { phi: "φ", theta: "θ" };
const named = (name) => name.replace(/^([A-Za-z])(\d+)$/, (_, letter, digits) => letter + digits.replace(/\d/g, (d) => "₀₁₂₃₄₅₆₇₈₉"[d]));

// Words where they cover least: other words above all, then lines; and within the axes.
class Labels {
  constructor({ ink, box }) { Object.assign(this, { ink, bounds: box, words: [], lines: [] }); }
  // A line that words had better not lie on.
  keep(a, b) {
    const n = Math.min(60, Math.ceil(Math.hypot(b[0] - a[0], b[1] - a[1]) / 6));
    for (let j = 0; j <= n; j++) this.lines.push([a[0] + (b[0] - a[0]) * j / (n || 1), a[1] + (b[1] - a[1]) * j / (n || 1)]);
  }
  say(words, at, spots, look) {
    const { align = "center", size = 12 } = look, w = 0.64 * size * words.length, h = 1.25 * size;
    let best = null;
    for (const [k, spot] of spots.entries()) {
      const { left, right, top, bottom } = this.bounds, clamp = (v, a, b) => Math.max(a, Math.min(b, v));
      const x = align === "left" ? at[0] + spot[0] : clamp(at[0] + spot[0], left + w / 2, right - w / 2), y = clamp(at[1] + spot[1], top + h / 2, bottom - h / 2), box = [align === "left" ? x : x - w / 2, y - h / 2];
      const common = (o) => Math.max(0, Math.min(box[0] + w, o[0] + o[2]) - Math.max(box[0], o[0])) * Math.max(0, Math.min(box[1] + h, o[1] + o[3]) - Math.max(box[1], o[1]));
      const cost = 0.01 * k + this.words.reduce((sum, o) => sum + common(o), 0) + this.lines.filter(([p, q]) => p > box[0] - 2 && p < box[0] + w + 2 && q > box[1] - 1 && q < box[1] + h + 1).length;
      if (!best || cost < best.cost) best = { cost, x, y, box: [...box, w, h] };
    }
    this.words.push(best.box);
    this.ink.text(best.x, best.y, words, look);
  }
}

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const HINT = "Drag a mass: another start. Shift and drag: kick it.";

export class MechanismView {
  constructor(app) {
    this.app = app;
    this.frame = app.state.frame;
    this.size = 1;
    this.playing = false;
    const view = canvas("the mechanism; drag a mass to set a start, hold Shift and drag to kick it; arrows move the chosen point");
    this.plane = new Plane(view, () => {}, { equal: true, over: () => this.draw() });
    this.plane.labels = ["x [m]", "y [m]"];
    this.panel = panel("mechanism", "Mechanism", { planes: () => [this.plane] });
    this.play = element("button", { onclick: () => this.toggle() }, "play");
    this.scrub = element("input", { type: "range", min: 0, max: 1, value: 0, "aria-label": "time" });
    this.scrub.addEventListener("input", () => { this.frame = Number(this.scrub.value); this.exact = null; this.pause(); });
    this.speed = element("select", { "aria-label": "speed" }, ...SPEEDS.map((s) => element("option", { value: s }, `${s}×`)));
    this.speed.value = app.state.speed;
    this.speed.addEventListener("change", () => app.change({ speed: Number(this.speed.value) }, "speed"));
    this.time = element("span", { role: "timer" });
    this.kick = element("p", { class: "note", role: "status" }, HINT);
    this.under = element("p", { class: "note" });
    this.points = element("select", { "aria-label": "point that arrow keys move and kicks hit" });
    const [vx, vy] = ["to the right", "upwards"].map((way, k) => element("input", { type: "number", class: "number", step: "any", value: k ? 0 : 1, "aria-label": `velocity of the kick ${way} [m/s]` }));
    const kick = this.kicks = element("button", { onclick: () => {
      const v = [vx, vy].map((one) => Number(one.value));
      if (vx.value === "" || vy.value === "" || !(v[0] || v[1])) { this.kick.textContent = "A kick needs both velocities, and one that is not zero."; return; }
      this.fire = true;
      this.strike(this.points.value, v);
    } }, "kick [m/s]");
    this.panel.tools.append(this.play, this.speed, this.scrub, this.time, element("span", { class: "group" }, this.points, vx, vy, kick));
    this.panel.body.append(view, this.under, this.kick);
    this.enable();
    draggable(this.plane, { begin: (at, e) => this.grab(at, e), move: (at) => this.drag(at), end: (at) => this.release(at), keys: (step) => this.nudge(step) });
    this.last = 0;
    this.frames = [];
    requestAnimationFrame((t) => this.tick(t));
  }
  rest(header, arrays) {
    this.resting = { ...header, ...arrays };
    this.extent();
    this.tell();
    this.enable();
    const movable = this.masses(this.resting).map((m) => m.point), before = this.points.value;
    if (movable.join() !== [...this.points.options].map((o) => o.value).join()) {
      this.points.replaceChildren(...movable.map((name) => element("option", { value: name }, name)));
      this.points.value = movable.includes(before) ? before : movable[1] ?? movable[0] ?? "";
    }
  }
  moves(header, arrays) {
    this.motion = { ...header, ...arrays, times: arrays.times.data };
    this.tell();
    this.enable();
    this.scrub.max = arrays.times.data.length - 1;
    if (this.frame >= arrays.times.data.length) this.frame = 0;
    this.extent();
    this.moved();
  }
  atRest() { this.motion = null; this.struck = null; this.fire = false; this.frame = 0; this.time.textContent = ""; this.pause(); this.extent(); this.tell(); this.enable(); }
  // What has nothing to do cannot be pressed; and under which forces the mechanism rests.
  enable() {
    const { motion, resting } = this;
    this.play.disabled = this.scrub.disabled = !motion;
    this.kick.hidden = this.kicks.disabled = this.points.disabled = !resting?.elements.includes(MASS);
    const others = motion || !resting ? [] : resting.means.map((mean, k) => [mean, resting.forces.data[k]]).filter(([mean, now]) => Math.abs(mean - now) > 1e-6 * Math.abs(now));
    this.under.textContent = others.map(([mean, now]) => `Equilibria are those under the force's mean in the long run, ${short(mean)} N; drawn is its value at 0 s, ${short(now)} N.`).join(" ");
  }
  tell() {
    const of = this.motion ?? this.resting;
    if (of && !of.elements.length) { this.panel.refuse("The mechanism has no points in a plane: nothing of it is drawn"); return; }
    if (this.motion) this.panel.tell(this.app.about, "mechanism", { ...this.motion.asked, dt: this.motion.dt });
    else if (this.resting) this.panel.tell(this.app.about, "rest", { ...this.resting.asked, chosen: this.app.state.chosen, none: !this.app.rows.length, arrow: this.app.arrow });
  }
  extent() {
    const found = [[Infinity, -Infinity], [Infinity, -Infinity]];
    // The motion's whole extent, or that of the chosen equilibrium.
    const of = this.motion ?? this.resting;
    if (!of) return;
    const n = of.elements.length, chosen = 4 * n * Math.min(this.app.state.chosen, of.ends.shape[0] - 1);
    const d = this.motion ? of.ends.data : of.ends.data.subarray(chosen, chosen + 4 * n);
    for (let k = 0; k < d.length; k++) {
      const kind = of.elements[Math.floor(k / 4) % n];
      if (kind === GUIDE || kind === LOAD) continue;
      found[k % 2][0] = Math.min(found[k % 2][0], d[k]);
      found[k % 2][1] = Math.max(found[k % 2][1], d[k]);
    }
    if (!Number.isFinite(found[0][0])) return;
    this.size = Math.max(found[0][1] - found[0][0], found[1][1] - found[1][0], 1e-9);
    if (this.held) return; // what is dragged stays under the hand
    const [rows, count] = of.forces.shape, from = this.motion ? 0 : Math.min(this.app.state.chosen, rows - 1) * count, to = this.motion ? rows * count : from + count;
    for (let at = from; at < to; at++) this.push(of, at)[1].forEach((v, k) => { found[k] = [Math.min(found[k][0], v), Math.max(found[k][1], v)]; });
    this.plane.range = found.map(([a, b]) => [a - 0.16 * this.size, b + 0.16 * this.size]);
    this.plane.later();
  }
  // An arrow's ends [m].
  push({ loads, forces }, at) {
    const [x, y, u, v] = loads.data.subarray(4 * at, 4 * at + 4), long = ARROW * this.size * Math.max(-3, Math.min(3, forces.data[at] / this.app.arrow)) / (Math.hypot(u - x, v - y) || 1);
    return [[x, y], [x + long * (u - x), y + long * (v - y)]];
  }
  toggle() { if (this.playing) this.pause(); else if (this.motion) { this.playing = true; this.play.textContent = "pause"; this.exact = null; } }
  pause() { this.playing = false; this.play.textContent = "play"; this.moved(); }
  start() { this.frame = 0; this.exact = 0; if (!this.playing) this.toggle(); }
  tick(now) {
    const passed = Math.min(0.1, (now - this.last) / 1000);
    this.last = now;
    if (this.playing && this.motion && this.motion.times.length > 1) {
      const { times } = this.motion, step = times[1] - times[0];
      this.exact = (this.exact ?? this.frame) + passed * Number(this.speed.value) / step;
      if (this.exact >= times.length) this.exact = 0;
      this.frame = Math.floor(this.exact);
      this.frames.push(now);
      if (this.frames.length > 600) this.frames.shift();
      this.moved();
    }
    requestAnimationFrame((t) => this.tick(t));
  }
  moved() {
    this.scrub.value = this.frame;
    if (this.motion) this.time.textContent = `${this.motion.times[this.frame].toFixed(2)} s`;
    this.plane.moved();
    this.app.frameMoved(this.frame);
  }
  shown() {
    const of = this.motion ?? this.resting;
    if (!of) return null;
    const n = of.elements.length, which = this.motion ? this.frame : Math.min(this.app.state.chosen, of.ends.shape[0] - 1);
    if (which < 0) return null;
    const d = of.ends.data, at = [];
    for (let k = 0, p = 4 * n * which; k < n; k++, p += 4) at.push([[d[p], d[p + 1]], [d[p + 2], d[p + 3]]]);
    return { ...of, at, which };
  }
  draw() {
    const of = this.shown();
    if (!of) return;
    const { ink } = this.plane, X = (p) => [this.plane.x(p[0]), this.plane.y(p[1])], unit = Math.abs(this.plane.x(this.size) - this.plane.x(0));
    const labels = this.labels = new Labels(this.plane), tied = [SPRING, DAMPER, ROD];
    of.elements.forEach((kind, k) => { if (tied.includes(kind)) labels.keep(...of.at[k].map(X)); });
    of.elements.forEach((kind, k) => { const [x, y] = X(of.at[k][0]); if (kind === MASS) labels.keep([x - 8, y], [x + 8, y]); });
    const heaviest = Math.max(...of.masses.map((m) => m ?? 0), 1e-30);
    const order = [GUIDE, SPRING, DAMPER, ROD, FIXED, MASS, POINT];
    const indices = of.elements.map((_, k) => k).sort((a, b) => order.indexOf(of.elements[a]) - order.indexOf(of.elements[b]));
    for (const k of indices) {
      const kind = of.elements[k], [a, b] = of.at[k].map(X), ax = [b[0] - a[0], b[1] - a[1]], length = Math.hypot(...ax) || 1;
      const along = (s, t) => [a[0] + s * ax[0] - t * ax[1] / length, a[1] + s * ax[1] + t * ax[0] / length];
      if (kind === GUIDE) ink.line([along(-2000 / length, 0), along(2000 / length, 0)], { color: css("soft"), width: 0.9, dash: [7, 4] });
      if (kind === FIXED) ink.line([[-5, -5], [5, -5], [5, 5], [-5, 5]].map((p) => [a[0] + p[0], a[1] + p[1]]), { fill: css("soft"), closed: true });
      if (kind === MASS) ink.circle(...a, 4 + 0.03 * unit * Math.sqrt((of.masses[k] ?? 0) / heaviest), { fill: css("blue") });
      if (kind === ROD) ink.line([a, b], { color: css("ink"), width: 3.2 });
      if (kind === SPRING) {
        const line = [along(0, 0), along(0.1, 0)];
        for (let j = 0; j < 18; j++) line.push(along(0.12 + 0.76 * j / 17, j % 2 ? 6 : -6));
        ink.line([...line, along(0.9, 0), along(1, 0)], { color: css("green"), width: 1.4 });
      }
      if (kind === DAMPER) {
        const look = { color: css("purple"), width: 2 };
        ink.line([along(0, 0), along(0.55, 0)], look); ink.line([along(0.55, -7), along(0.55, 7)], look);
        ink.line([along(0.3, 9), along(0.8, 9), along(0.8, -9), along(0.3, -9)], look); ink.line([along(0.8, 0), along(1, 0)], look);
      }
    }
    const pushes = [];
    for (let k = 0, count = of.forces.shape[1]; k < count; k++) {
      const at = of.which * count + k, force = of.forces.data[at], [a, tip] = this.push(of, at).map(X);
      if (!force) continue;
      this.arrow(a, tip, css("vermillion"));
      labels.keep(a, tip);
      pushes.push([tip, Math.sign(tip[0] - a[0]) || 1, Math.sign(tip[1] - a[1]) || 1, `${Number(force.toPrecision(3))} N`]);
    }
    const { coordinates, states } = this.app.about, y = this.position(), { left, top, bottom } = this.plane.box;
    // What stands in the corners comes first: what follows stands beside it.
    coordinates.forEach((n, k) => {
      const degrees = states[n].unit === "rad" ? ` (${fixed(y[k] * 180 / Math.PI, 1)}°)` : "";
      labels.say(`${SYMBOLS[n] ?? n} = ${fixed(y[k], 3)} ${states[n].unit}${degrees}`, [left + 6, top + 10 + 16 * k], [[0, 0]], { color: css("ink"), align: "left" });
    });
    if (of.forces.shape[1]) {
      const at = [left + 10, bottom - 12], tip = [at[0] + ARROW * unit, at[1]];
      this.arrow(at, tip, css("vermillion"));
      labels.say(`${this.app.arrow} N, arrows are at most three times as long`, [tip[0] + 8, at[1]], [[0, 0]], { color: css("soft"), align: "left", size: 11 });
    }
    of.names.forEach((name, k) => {
      // Names of fixed points stand below them on the left, of others above on the right, where nothing else is.
      const ground = of.elements[k] === FIXED, [u, v] = ground ? [-15, 16] : [15, -16];
      if (name) labels.say(named(name), X(of.at[k][0]), [[u, v], [-u, v], [u, -v], [-u, -v]], { color: css(ground ? "ink" : "blue"), size: 13 });
    });
    for (const [tip, u, v, words] of pushes) labels.say(words, tip, [[12 * u, -12 * v], [12 * u, 14 * v], [38 * u, 0], [0, -26], [0, 26], [44 * u, -20], [44 * u, 20], [-38 * u, -18], [-38 * u, 18]], { color: css("vermillion") });
    for (const [rod, end, k, sign, origin] of of.angles) {
      const [x0, y0] = X(of.at[rod][end]), r = ARROW * unit, q = y[k] - 2 * Math.PI * Math.round(y[k] / (2 * Math.PI));
      const on = (angle, radius) => [x0 + radius * Math.cos(angle), y0 - radius * Math.sin(angle)], color = css("orange");
      const arc = Array.from({ length: 33 }, (_, j) => on(origin + sign * q * j / 32, r));
      ink.line([[x0, y0], on(origin, 1.25 * r)], { color, width: 1, dash: [4, 3] });
      ink.line(arc, { color, width: 2 });
      if (Math.abs(q) > 0.25) this.head(arc[28], arc[32], color);
      const words = SYMBOLS[coordinates[k]] ?? coordinates[k], aside = 12 + 4 * words.length;
      const spots = [[0.5, 1.3], [0.5, 0.7], [0.8, 1.35], [0.2, 1.35]].map(([share, far]) => on(origin + share * sign * q, far * r));
      labels.say(words, [0, 0], [...spots, ...spots.slice(0, 2).flatMap(([u, v]) => [[u + aside, v], [u - aside, v]])], { color: css("ink"), size: 13 });
    }
    if (!this.motion && !this.app.rows.length) ink.text(this.plane.box.right - 6, this.plane.box.top + 10, "no equilibrium is proved: drawn at zero", { color: css("ink"), align: "right" });
    if (this.struck) {
      const [a, b] = [X(this.struck.from), X(this.struck.to)];
      this.arrow(a, b, css("orange"));
      const side = b[1] < a[1] ? -1 : 1;
      labels.keep(a, b);
      labels.say(this.struck.words, b, [14, 30, -14, -30, 46, -46, 62, -62].flatMap((v) => [[0, v * side], [70, v * side], [-70, v * side]]), { color: css("ink"), size: 13 });
    }
  }
  arrow(a, b, color) {
    this.plane.ink.line([a, b], { color, width: 2.6 });
    this.head(a, b, color);
  }
  head(a, b, color) {
    const d = Math.atan2(b[1] - a[1], b[0] - a[0]), size = Math.min(10, Math.hypot(b[0] - a[0], b[1] - a[1])), h = (t) => [b[0] - size * Math.cos(d + t), b[1] - size * Math.sin(d + t)];
    this.plane.ink.line([b, h(0.45), h(-0.45)], { fill: color, closed: true });
  }
  position() {
    const n = this.app.about.coordinates.length;
    if (this.motion) return Array.from({ length: n }, (_, k) => this.motion.y.data[this.frame * 2 * n + k]);
    return this.app.rows?.[this.app.state.chosen]?.position ?? Array(n).fill(0);
  }
  rates() {
    const n = this.app.about.coordinates.length;
    return Array.from({ length: n }, (_, k) => (this.motion ? this.motion.y.data[this.frame * 2 * n + n + k] : 0));
  }
  // Masses at points that have names and move.
  masses(of) {
    const first = (k, c) => of.ends.data[4 * k + c], found = [];
    of.elements.forEach((kind, k) => {
      if (kind !== MASS) return;
      const j = of.names.findIndex((name, i) => name && of.elements[i] === POINT && Math.hypot(first(i, 0) - first(k, 0), first(i, 1) - first(k, 1)) < 1e-5 * this.size);
      if (j >= 0) found.push({ point: of.names[j], element: j, mass: of.masses[k] });
    });
    return found;
  }
  grab(at, event) {
    const of = this.shown();
    if (!of) return false;
    let best = null;
    for (const one of this.masses(of)) {
      const [x, y] = of.at[one.element][0], d = Math.hypot(x - at[0], y - at[1]);
      if (d < 0.1 * this.size && (!best || d < best.d)) best = { ...one, d, from: [x, y] };
    }
    if (!best) return false;
    this.pause();
    this.points.value = best.point;
    this.fire = false;
    this.held = { ...best, strike: event.shiftKey };
    return true;
  }
  drag(at) {
    if (!this.held.strike) { this.app.pull({ point: this.held.point, to: at, q: this.position() }); return; }
    const v = this.velocity(at);
    this.struck = { from: this.held.from, to: at, words: `${Math.hypot(...v).toFixed(2)} m/s` };
    this.strike(this.held.point, v);
    this.plane.moved();
  }
  // Four metres a second for a metre of arrow.
  velocity(at) { return [at[0] - this.held.from[0], at[1] - this.held.from[1]].map((d) => 4 * d); }
  release() {
    if (this.held.strike) {
      if (this.told?.id === this.app.talk.newest.strike) this.go(); else this.fire = true;
    } else this.app.letGo();
    this.held = null;
  }
  hint() { this.kick.textContent = HINT; }
  strike(point, velocity) {
    if (![...this.position(), ...this.rates()].every(Number.isFinite)) { this.kick.textContent = "The motion has no finite place here: begin another before a kick."; this.fire = false; return; }
    const one = this.resting && this.masses(this.resting).find((m) => m.point === point);
    if (one) this.app.strike({ point, mass: one.mass, velocity, q: this.position(), rates: this.rates() });
    this.asked = Math.hypot(...velocity);
  }
  // The server has said what a kick brings: told beside the arrow until it is let go.
  kicked(header) {
    this.told = header;
    const words = `${this.asked.toFixed(2)} m/s, ${header.energy.toPrecision(3)} J`;
    this.kick.textContent = `Kick of ${words}: the point then has ${header.speed.toFixed(2)} m/s.`;
    if (this.struck) this.struck.words = words;
    this.plane.moved();
    if (this.fire) this.go();
  }
  go() {
    this.struck = null;
    this.fire = false;
    const words = this.kick.textContent;
    this.app.from(this.told.state, true);
    this.kick.textContent = words;
    this.app.letGo();
  }
  nudge(step) {
    const of = this.shown(), k = of ? of.names.indexOf(this.points.value) : -1;
    if (k < 0) return;
    const [x, y] = of.at[k][0];
    this.app.pull({ point: this.points.value, to: [x + step[0], y + step[1]], q: this.position() });
  }
}
