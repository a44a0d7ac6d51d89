// Sliders with numbers and units for every parameter.
import { element, panel, short } from "./ink.js";

export class Parameters {
  constructor(app) {
    this.app = app;
    this.rows = {};
    this.panel = panel("parameters", "Parameters", { lines: false });
    this.panel.tools.append(element("button", { onclick: () => this.reset(Object.keys(app.about.parameters)) }, "reset all"));
    for (const [name, about] of Object.entries(app.about.parameters)) this.add(name, about);
    this.show();
  }
  add(name, about) {
    const unit = about.unit === "1" ? "" : about.unit, label = `${name}: ${about.about}${unit && ` [${unit}]`}`;
    const range = element("input", { type: "range", min: about.low, max: about.high, step: (about.high - about.low) / 1000, "aria-label": label });
    const number = element("input", { type: "number", step: "any", "aria-label": `${label}, value` });
    range.addEventListener("input", () => this.set(name, Number(range.value)));
    // The first press of a double click has moved it: back to where it was.
    let before, pressed = -1e9;
    range.addEventListener("pointerdown", (e) => { if (e.timeStamp - pressed > 600) before = this.app.state.parameters[name]; pressed = e.timeStamp; });
    range.addEventListener("dblclick", () => { this.set(name, before); number.focus(); number.select(); });
    number.addEventListener("change", () => { if (number.value !== "") this.set(name, Number(number.value)); });
    const back = element("button", { title: `back to ${about.reset}`, "aria-label": `reset ${name} to ${about.reset}`, onclick: () => this.reset([name]) }, "↺");
    this.rows[name] = { range, number };
    this.panel.body.append(element("div", { class: "parameter", title: label }, element("span", {}, name), range, number, element("span", {}, unit), back));
  }
  set(name, value) {
    this.app.change({ parameters: { ...this.app.state.parameters, [name]: value } }, "parameters");
  }
  // To the first values, with the first ranges.
  reset(names) {
    const { parameters } = this.app.about, values = Object.fromEntries(names.map((n) => [n, parameters[n].reset]));
    this.app.narrow(names);
    this.app.change({ parameters: { ...this.app.state.parameters, ...values } }, "parameters");
  }
  show() {
    for (const [name, { range, number }] of Object.entries(this.rows)) {
      const value = this.app.state.parameters[name], about = this.app.about.parameters[name];
      range.max = Math.max(about.high, value);
      range.min = Math.min(about.low, value);
      range.value = value;
      range.setAttribute("aria-valuetext", `${short(value)} ${about.unit}`);
      if (document.activeElement !== number) number.value = Number(value.toPrecision(12));
    }
  }
}
