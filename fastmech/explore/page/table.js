// Equilibria with stability and decay times; and the sections of a result file.
import { element, panel, short } from "./ink.js";

export class Table {
  constructor(app) {
    this.app = app;
    this.panel = panel("equilibria", "Equilibria", { lines: false });
    this.panel.body.setAttribute("aria-live", "off");
  }
  take() {
    const { coordinates, states } = this.app.about;
    const heads = ["", ...coordinates.map((c) => `${c} [${states[c].unit}]`), "energy [J]", "kind", "stability", "decays in [s]"];
    const body = this.app.rows.map((row, k) => {
      const button = element("button", { onclick: () => this.app.choose(k), "aria-label": `show equilibrium ${k + 1}` }, `${k + 1}`);
      const cells = [...row.position.map((v) => v.toFixed(6)), short(row.energy), row.kind, row.verdict, short(row.decay_time)];
      return element("tr", { class: k === this.app.state.chosen ? "chosen" : null, title: row.explanation }, element("th", {}, button), ...cells.map((c) => element("td", {}, c)));
    });
    const table = element("table", {}, element("thead", {}, element("tr", {}, ...heads.map((h) => element("th", { scope: "col" }, h)))), element("tbody", {}, ...body));
    this.panel.body.replaceChildren(table);
  }
}

export async function sections(about) {
  if (!about.results) return;
  const made = panel("sections", `Sections of ${about.results}`, { lines: false });
  made.body.textContent = "drawing";
  const found = await (await fetch("/sections")).json();
  if (found.error) { made.body.textContent = found.error; return; }
  made.body.replaceChildren();
  for (const name of found) made.body.append(element("figure", {}, element("img", { src: `/pictures/${encodeURIComponent(name)}`, alt: name }), element("figcaption", {}, name)));
}
