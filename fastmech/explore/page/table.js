// Equilibria with stability and decay times; and the sections of a result file.
import { element, fixed, panel, savePicture, short } from "./ink.js";

// Rows are elements, or lists of words.
function tableOf(heads, rows) {
  const made = rows.map((row) => (Array.isArray(row) ? element("tr", {}, ...row.map((words) => element("td", {}, words))) : row));
  return element("table", {}, element("thead", {}, element("tr", {}, ...heads.map((h) => element("th", { scope: "col" }, h)))), element("tbody", {}, ...made));
}

export class Table {
  constructor(app) {
    this.app = app;
    this.panel = panel("equilibria", "Equilibria");
    this.panel.body.setAttribute("aria-live", "off");
  }
  take(header) {
    if (header) this.panel.tell(this.app.about, "equilibria", header.asked);
    const held = this.panel.body.contains(document.activeElement);
    const { coordinates, states } = this.app.about;
    const heads = ["", ...coordinates.map((c) => `${c} [${states[c].unit}]`), "energy [J]", "kind", "stability", "decays in [s]"];
    // Energies that are rounding beside the others' are none.
    const zero = 1e-12 * Math.max(...this.app.rows.map((row) => Math.abs(row.energy)), ...(this.app.landscape.span ?? []).map(Math.abs));
    const body = this.app.rows.map((row, k) => {
      const button = element("button", { onclick: () => this.app.choose(k), "aria-label": `show equilibrium ${k}`, "aria-pressed": k === this.app.state.chosen ? "true" : "false" }, `${k}`);
      const cells = [...row.position.map((v) => fixed(v, 6)), short(row.energy !== null && Math.abs(row.energy) < zero ? 0 : row.energy), row.kind, row.verdict, short(row.decay_time)];
      return element("tr", { class: k === this.app.state.chosen ? "chosen" : null, title: row.explanation }, element("th", {}, button), ...cells.map((c) => element("td", {}, c)));
    });
    if (!body.length) body.push(element("tr", {}, element("td", { colspan: heads.length }, "No equilibrium is proved.")));
    const table = tableOf(heads, body), { explanation } = this.app.rows[this.app.state.chosen] ?? {};
    this.panel.body.replaceChildren(table, element("p", { class: "note" }, explanation ? `${this.app.state.chosen}: ${explanation}.` : ""));
    if (held) table.querySelectorAll("button")[this.app.state.chosen]?.focus();
  }
}

export async function sections(about) {
  if (!about.results) return;
  const waiting = panel("sections", `Sections of ${about.results}`, { lines: false }), told = async (of) => (await fetch(`/sections${of}`)).json();
  waiting.body.textContent = "reading";
  const found = await told("");
  if (found.error) { waiting.body.textContent = found.error; return; }
  waiting.section.remove();
  const panels = found.map(({ name, python, request }) => {
    const made = panel(`section-${name}`, `${name} in ${about.results}`);
    made.put(python, request);
    made.body.textContent = "drawing";
    return made;
  });
  for (const [number, made] of panels.entries()) {
    const { name, python, request } = found[number], { pictures = [], numbers = [], line, error: wrong } = await told(`/${number}`);
    made.put(python, request, line ?? wrong);
    made.body.textContent = "";
    for (const [k, one] of pictures.entries()) {
      const image = element("img", { src: `/pictures/${one.split("/").map(encodeURIComponent).join("/")}`, alt: `${name}, picture ${k + 1} of ${pictures.length}` });
      const save = element("button", { onclick: () => savePicture(`${name}${k || ""}`, image), "aria-label": `save PNG: ${name}, picture ${k + 1}` }, "save PNG");
      made.body.append(element("figure", {}, image, element("figcaption", {}, element("a", { href: image.src, download: one.split("/")[1] }, "save SVG"), " ", save)));
    }
    if (numbers.length) made.body.append(tableOf(["name", "unit", "values", "what it is"], numbers));
  }
}
