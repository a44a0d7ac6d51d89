// Drawing in plane coordinates with axes, onto a canvas or into an SVG text.

import { pythonOf, requestOf } from "./lines.js";

const SVG = "http://www.w3.org/2000/svg";

const scheme = matchMedia("(prefers-color-scheme: dark)"), colors = new Map();
scheme.addEventListener("change", () => colors.clear());
export function css(name) {
  if (!colors.has(name)) colors.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return colors.get(name);
}

class CanvasInk {
  constructor(context) { this.c = context; }
  line(points, { color, width = 1.5, dash = [], closed = false, fill = null }) {
    const c = this.c;
    c.beginPath();
    let pen = false;
    for (const [x, y] of points) {
      if (!Number.isFinite(x + y)) { pen = false; continue; }
      if (pen) c.lineTo(x, y); else c.moveTo(x, y);
      pen = true;
    }
    if (closed) c.closePath();
    if (fill) { c.fillStyle = fill; c.fill(); }
    if (color) { c.strokeStyle = color; c.lineWidth = width; c.setLineDash(dash); c.lineJoin = c.lineCap = "round"; c.stroke(); }
  }
  circle(x, y, r, { color, fill, width = 1.5 }) {
    const c = this.c;
    c.beginPath(); c.arc(x, y, r, 0, 2 * Math.PI);
    if (fill) { c.fillStyle = fill; c.fill(); }
    if (color) { c.setLineDash([]); c.strokeStyle = color; c.lineWidth = width; c.stroke(); }
  }
  text(x, y, words, { color, align = "center", size = 12, turn = 0 }) {
    const c = this.c;
    c.save(); c.translate(x, y); c.rotate(turn);
    c.fillStyle = color; c.font = `${size}px "DejaVu Sans", sans-serif`; c.textAlign = align; c.textBaseline = "middle";
    c.fillText(words, 0, 0); c.restore();
  }
  image(picture, x, y, w, h) { this.c.imageSmoothingEnabled = false; this.c.drawImage(picture, x, y, w, h); }
  clip(x, y, w, h) { this.c.save(); this.c.beginPath(); this.c.rect(x, y, w, h); this.c.clip(); }
  unclip() { this.c.restore(); }
}

class SvgInk {
  constructor(width, height, paper) {
    this.root = document.createElementNS(SVG, "svg");
    for (const [k, v] of Object.entries({ xmlns: SVG, width, height, viewBox: `0 0 ${width} ${height}` })) this.root.setAttribute(k, v);
    this.at = this.root;
    this.clips = 0;
    this.add("rect", { width, height, fill: paper });
  }
  // What follows is drawn from this height on.
  from(y) {
    this.at = this.root;
    this.at = this.add("g", { transform: `translate(0 ${y})` });
  }
  add(tag, attributes, words) {
    const e = document.createElementNS(SVG, tag);
    for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v);
    if (words !== undefined) e.textContent = words;
    this.at.append(e);
    return e;
  }
  line(points, { color, width = 1.5, dash = [], closed = false, fill = null }) {
    let d = "", pen = false;
    for (const [x, y] of points) {
      if (!Number.isFinite(x + y)) { pen = false; continue; }
      d += `${pen ? "L" : "M"}${x.toFixed(2)} ${y.toFixed(2)}`;
      pen = true;
    }
    this.add("path", { d: d + (closed ? "Z" : ""), stroke: color || "none", "stroke-width": width, "stroke-dasharray": dash.join(" "), fill: fill || "none" });
  }
  circle(cx, cy, r, { color, fill, width = 1.5 }) { this.add("circle", { cx, cy, r, stroke: color || "none", fill: fill || "none", "stroke-width": width }); }
  text(x, y, words, { color, align = "center", size = 12, turn = 0 }) {
    const anchor = { center: "middle", left: "start", right: "end" }[align];
    this.add("text", { transform: `translate(${x} ${y}) rotate(${turn * 180 / Math.PI})`, fill: color, "text-anchor": anchor, "dominant-baseline": "central", "font-size": size, "font-family": "DejaVu Sans, sans-serif" }, words);
  }
  image(picture, x, y, width, height) { this.add("image", { x, y, width, height, preserveAspectRatio: "none", "image-rendering": "pixelated", href: picture.toDataURL() }); }
  clip(x, y, width, height) {
    const id = `clip${++this.clips}`;
    const path = this.add("clipPath", { id });
    const outer = this.at;
    this.at = path; this.add("rect", { x, y, width, height }); this.at = outer;
    this.at = this.add("g", { "clip-path": `url(#${id})` });
  }
  unclip() { this.at = this.at.parentNode; }
}

export function ticks(low, high, most) {
  const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found.map((v) => Number(v.toPrecision(10)));
}

export const short = (v) => (v === null || !Number.isFinite(v) ? "–" : Number(v.toPrecision(4)).toString());

// Decimals without a sign before nothing.
export const fixed = (v, digits) => v.toFixed(digits).replace(/^-(0\.?0*)$/, "$1");

// On wide screens all is larger, words too.
const zoom = () => (innerWidth >= 2200 ? 1.3 : 1);

// A canvas with axes. `draw(plane)` paints what stands still and is kept as a picture, `over(plane)` what moves on
// top of it; `plane.x` and `plane.y` give pixels.
export class Plane {
  constructor(canvas, draw, { equal = false, over = () => {}, top = 10, edge = 0 } = {}) {
    Object.assign(this, { top, edge, canvas, drawing: draw, over, equal, range: [[0, 1], [0, 1]], labels: ["", ""], legend: [], due: false, stale: true });
    this.kept = document.createElement("canvas");
    new ResizeObserver(() => this.later()).observe(canvas);
    new IntersectionObserver((seen) => { this.unseen = !seen.at(-1).isIntersecting; this.moved(); }).observe(canvas);
    scheme.addEventListener("change", () => this.later());
  }
  later() { this.stale = true; this.moved(); }
  moved() {
    if (this.due || this.unseen) return; // what is out of sight is drawn when it comes into sight
    this.due = true;
    requestAnimationFrame(() => { this.due = false; this.now(); });
  }
  size() { return [this.canvas.clientWidth, this.canvas.clientHeight].map((v) => v / zoom()); }
  now() {
    const { kept } = this, [w, h] = this.size(), ratio = (devicePixelRatio || 1) * zoom();
    if (!w || !h) return;
    const context = this.canvas.getContext("2d");
    if (this.stale) {
      this.stale = false;
      for (const c of [kept, this.canvas]) if (c.width !== Math.round(w * ratio) || c.height !== Math.round(h * ratio)) [c.width, c.height] = [w, h].map((v) => Math.round(v * ratio));
      const below = kept.getContext("2d");
      below.setTransform(ratio, 0, 0, ratio, 0, 0);
      below.fillStyle = css("paper"); below.fillRect(0, 0, w, h);
      this.paint(new CanvasInk(below), w, h);
    }
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(kept, 0, 0);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.cover(new CanvasInk(context));
  }
  cover(ink) {
    this.ink = ink;
    this.within(ink, () => this.over(this));
  }
  // Nothing is drawn beyond the axes, but marks that lie on them are whole.
  within(ink, paint) {
    const { left, right, top, bottom } = this.box, e = this.edge;
    ink.clip(left - e, top - e, right - left + 2 * e, bottom - top + 2 * e);
    paint();
    ink.unclip();
  }
  paint(ink, w, h) {
    const below = this.placed(58, w - 14), box = { left: 58, right: w - 14, top: this.top, bottom: h - 40 - (below.length ? below.at(-1).y + 20 : 0) };
    let [[x0, x1], [y0, y1]] = this.range;
    if (this.equal) {
      const scale = Math.max((x1 - x0) / (box.right - box.left), (y1 - y0) / (box.bottom - box.top));
      const cx = (x0 + x1) / 2, cy = (y0 + y1) / 2, dx = scale * (box.right - box.left) / 2, dy = scale * (box.bottom - box.top) / 2;
      [x0, x1, y0, y1] = [cx - dx, cx + dx, cy - dy, cy + dy];
    }
    Object.assign(this, { ink, box, view: [[x0, x1], [y0, y1]] });
    this.x = (v) => box.left + (v - x0) / (x1 - x0) * (box.right - box.left);
    this.y = (v) => box.bottom - (v - y0) / (y1 - y0) * (box.bottom - box.top);
    const soft = css("soft"), line = css("line");
    for (const v of ticks(x0, x1, 7)) {
      ink.line([[this.x(v), box.top], [this.x(v), box.bottom]], { color: line, width: 0.6 });
      ink.text(this.x(v), box.bottom + 10, short(v), { color: soft, size: 11 });
    }
    // Three at least: between two nothing is read.
    let heights = [];
    for (let most = Math.max(2, Math.round((box.bottom - box.top) / 45)); heights.length < 3 && most < 9; most++) heights = ticks(y0, y1, most);
    for (const v of heights) {
      ink.line([[box.left, this.y(v)], [box.right, this.y(v)]], { color: line, width: 0.6 });
      ink.text(box.left - 5, this.y(v), short(v), { color: soft, align: "right", size: 11 });
    }
    ink.text((box.left + box.right) / 2, box.bottom + 30, this.labels[0], { color: css("ink") });
    ink.text(11, (box.top + box.bottom) / 2, this.labels[1], { color: css("ink"), turn: -Math.PI / 2 });
    this.above = []; // the legend, above the axes
    this.within(ink, () => this.drawing(this));
    for (const { x, y, color, words, dash } of below) {
      const at = box.bottom + 52 + y;
      // Curves are black in both lights.
      ink.line([[0, -6], [26, -6], [26, 6], [0, 6]].map((d) => [x + d[0], at + d[1]]), { fill: dash ? "#ffffff" : color, color: "#000000", width: 0.5, closed: true });
      if (dash) ink.line([[x + 2, at], [x + 24, at]], { color: "#000000", width: 1.8, dash });
      ink.text(x + 32, at, words, { color: css("ink"), align: "left", size: 11 });
    }
    for (const [a, b, color, dash, word] of this.above) {
      ink.line([a, b], { color, dash, width: 1.8 });
      ink.text(b[0] + 5, b[1], word, { color: css("ink"), align: "left", size: 12 });
    }
  }
  // Entries of the legend below the axes, in as many rows as they need.
  placed(left, right) {
    let x = left, y = 0;
    return this.legend.map((one) => {
      const wide = 46 + 6.1 * one.words.length;
      if (x > left && x + wide > right) { x = left; y += 18; }
      x += wide;
      return { ...one, x: x - wide, y };
    });
  }
  curve(xs, ys, look) { this.ink.line(Array.from(xs, (x, k) => [this.x(x), this.y(ys[k])]), look); }
  at(event) {
    const r = this.canvas.getBoundingClientRect(), [[x0, x1], [y0, y1]] = this.view, b = this.box;
    const share = (v, a, z) => Math.min(1, Math.max(0, (v - a) / (z - a)));
    return [x0 + share((event.clientX - r.left) / zoom(), b.left, b.right) * (x1 - x0), y0 + share((event.clientY - r.top) / zoom(), b.bottom, b.top) * (y1 - y0)];
  }
  // Whether a press is within the axes, or on their edge.
  holds(event) {
    const r = this.canvas.getBoundingClientRect(), b = this.box, e = this.edge;
    const [x, y] = [(event.clientX - r.left) / zoom(), (event.clientY - r.top) / zoom()];
    return b && x >= b.left - e && x <= b.right + e && y >= b.top - e && y <= b.bottom + e;
  }
}

// Drag with the pointer, and arrow keys for who has none.
export function draggable(plane, { begin = () => true, move, end = () => {}, keys = null }) {
  const canvas = plane.canvas;
  let held = false;
  canvas.addEventListener("pointerdown", (e) => {
    held = plane.holds(e) && begin(plane.at(e), e);
    if (held) { canvas.setPointerCapture(e.pointerId); move(plane.at(e), e); }
  });
  canvas.addEventListener("pointermove", (e) => { if (held) move(plane.at(e), e); });
  canvas.addEventListener("pointerup", (e) => { if (held) { held = false; end(plane.at(e), e); } });
  canvas.addEventListener("pointercancel", () => { held = false; });
  if (keys) canvas.addEventListener("keydown", (e) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[e.key];
    if (!step || !plane.view) return;
    e.preventDefault();
    keys(step.map((s, k) => s * (plane.view[k][1] - plane.view[k][0]) * (e.shiftKey ? 0.05 : 0.01)));
  });
}

export function element(tag, attributes = {}, ...children) {
  const e = document.createElement(tag);
  for (const [k, v] of Object.entries(attributes)) {
    if (k.startsWith("on")) e.addEventListener(k.slice(2), v); else if (v !== null && v !== false) e.setAttribute(k, v);
  }
  e.append(...children);
  return e;
}

function download(name, content, type) {
  const url = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

// The canvases of a view as one picture, below each other.
function svg(planes) {
  const sizes = planes.map((p) => p.size()), ink = new SvgInk(Math.max(...sizes.map(([w]) => w)), sizes.reduce((sum, [, h]) => sum + h, 0), css("paper"));
  let y = 0;
  planes.forEach((p, k) => { ink.from(y); p.paint(ink, ...sizes[k]); p.cover(ink); y += sizes[k][1]; });
  return new XMLSerializer().serializeToString(ink.root);
}
function raster(planes) {
  const all = planes.map((p) => { p.now(); return p.canvas; });
  const picture = element("canvas", { width: Math.max(...all.map((c) => c.width)), height: all.reduce((sum, c) => sum + c.height, 0) }), context = picture.getContext("2d");
  let y = 0;
  for (const c of all) { context.drawImage(c, 0, y); y += c.height; }
  return picture;
}

// A picture that the page has as SVG.
export function savePicture(name, image) {
  const c = element("canvas", { width: 2 * image.naturalWidth, height: 2 * image.naturalHeight }), context = c.getContext("2d");
  context.fillStyle = "#ffffff"; context.fillRect(0, 0, c.width, c.height);
  context.drawImage(image, 0, 0, c.width, c.height);
  c.toBlob((b) => download(`${name}.png`, b));
}

// A panel with a heading, tools, and the ways back to work.
export function panel(id, title, { planes = () => [], lines = true } = {}) {
  const tools = element("div", { class: "tools" }), body = element("div"), code = element("pre"), request = element("pre");
  const section = element("section", { id, "aria-label": title });
  const head = element("div", { class: "head" }, element("h2", {}, title)), refusal = element("p", { class: "refusal", role: "status" });
  const told = element("span", { role: "status" });
  section.append(head, tools, refusal, body);
  const made = { section, tools, body, python: "", request: "", ways: [] };
  const button = (words, act) => { const one = element("button", { onclick: act, "aria-label": `${words.length > 3 ? words : `save picture as ${words}`}: ${title}`, title: words.length > 3 ? null : `save picture as ${words}` }, words); head.append(one); return one; };
  if (lines) {
    made.ways.push(button("copy Python", async () => {
      try { await navigator.clipboard.writeText(made.python); told.textContent = "copied"; } catch { download(`${id}.py`, made.python, "text/plain"); told.textContent = "saved as a file"; }
      setTimeout(() => { told.textContent = ""; }, 2000);
    }));
    made.ways.push(button("save request", () => download(`${id}.toml`, made.request, "text/plain")));
    section.append(element("details", {}, element("summary", {}, "Python and request"), code, request));
  }
  if (planes().length) {
    button("PNG", () => raster(planes()).toBlob((b) => download(`${id}.png`, b)));
    button("SVG", () => download(`${id}.svg`, svg(planes()), "image/svg+xml"));
  }
  // Without lines and a request the ways back to work are closed.
  made.put = (python, text, line = "") => {
    made.python = code.textContent = python;
    made.request = request.textContent = text;
    made.ways.forEach((one) => { one.disabled = !python; });
    section.classList.toggle("stale", line !== "" && made.filled === true);
    refusal.textContent = line;
  };
  made.tell = (about, view, asked) => { made.filled = true; made.put(pythonOf(about, view, asked), requestOf(about, view, asked)); };
  made.refuse = (line) => made.put("", "", `${line}${/[.!]$/.test(line) ? "" : "."}${made.filled ? " Shown is the answer to the last valid parameters." : ""}`);
  // A refusal of values that are no more; the answer is to come.
  made.again = () => { if (refusal.textContent) made.put("", "", made.filled ? "Shown is the answer to earlier parameters." : ""); };
  made.put("", "");
  head.append(told);
  document.getElementById("panels").append(section);
  return made;
}

export function canvas(label, low = false) {
  return element("canvas", { tabindex: 0, role: "img", "aria-label": label, class: low ? "low" : null });
}

export function choice(label, names, chosen, act) {
  const select = element("select", { "aria-label": label, onchange: () => act(select.value) },
    ...names.map((n) => element("option", { value: n }, n)));
  select.value = chosen;
  return select;
}
