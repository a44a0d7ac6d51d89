// The way back to work: Python lines and the request that give what a view shows.

// A number as Python, TOML and this page read it alike, with a point: a whole number is of another type there.
const number = (v) => (Number.isInteger(v) && Math.abs(v) < 1e15 ? `${Object.is(v, -0) ? "-0" : v}.0` : `${v}`);
const list = (values) => `[${values.map(number).join(", ")}]`;
const given = (values) => Object.entries(values).map(([n, v]) => `${n}=${number(v)}`).join(", ");
const space = ([a, b], n) => `np.linspace(${number(a)}, ${number(b)}, ${n + 1})`;
const axesOf = (told) => `axes = {${Object.entries(told.axes).map(([n, ends]) => `"${n}": ${space(ends, told.divisions)}`).join(", ")}}`;
const statesOf = (about) => [...about.coordinates, ...about.rates];

function system({ source, scene }, parameters) {
  const values = given(parameters);
  if (scene) return [`system = fm.Scene(${values})`];
  if (source.includes(":")) {
    const at = source.lastIndexOf(":");
    return ["import runpy", "", `made = runpy.run_path(${JSON.stringify(source.slice(0, at))})[${JSON.stringify(source.slice(at + 1))}]`, `system = (made if isinstance(made, fm.Mechanism) else made()).replace(${values})`];
  }
  const chain = /^(pendulum_chain)_(\d+)$/.exec(source);
  return [`system = fm.mechanisms.${chain ? `${chain[1]}(${chain[2]})` : `${source}()`}.replace(${values})`];
}

// The mechanism that a scene stands for; under a force that fades nothing is left of it at rest.
function mechanism({ scene }, parameters, still) {
  if (!scene) return ["mechanism = system"];
  const values = still && parameters.alpha > 0 ? { ...parameters, F0: 0, alpha: 0 } : parameters;
  return [`mechanism = fm.mechanisms.slider_pendulum().replace(${given(values)})`];
}

function motion(about, { start, t_end, outputs, dt }) {
  const y0 = list(statesOf(about).map((n) => start[n] ?? 0)), end = number(t_end);
  return [`times = np.linspace(0.0, ${end}, ${outputs})`, `run = fm.integrate(system, [${y0}], ${end}, t_eval=times, dt=${number(dt)}, method="dop853")`];
}

const drawn = ["import matplotlib.pyplot as plt"];
const shown = (name) => ["plt.legend()", `plt.savefig("${name}.png")`];

// Each view: what it imports, and its lines of `told`: what was asked for and answered.
const VIEWS = {
  equilibria: [[], () => ["found = fm.find_equilibria(system)", "print(found, [fm.classify(system, e).verdict for e in found])"]],
  landscape: [["import sympy", ...drawn], (about, told) => {
    const [x, y] = Object.keys(told.axes), place = (n) => (about.coordinates.includes(n) ? `place[:, ${about.coordinates.indexOf(n)}]` : "0.0 * place[:, 0]");
    const rest = ["found = fm.find_equilibria(system)", `place = np.reshape(found.position, (-1, ${about.coordinates.length}))`];
    const marks = [`plt.plot(${place(x)}, ${place(y)}, "ko", label="equilibria")`, ...shown("landscape")];
    if (!told.potential) return [...rest, `plt.axis(${list([...told.axes[x], ...told.axes[y]])})`, ...marks];
    return [
      ...rest, ...mechanism(about, told.parameters, true), axesOf(told),
      "x, y = np.meshgrid(*axes.values())",
      "names = [*mechanism.state, *mechanism.parameters]",
      'energy = sympy.lambdify([sympy.Symbol(n, real=True) for n in names], mechanism.energy(), "numpy")',
      `states = dict.fromkeys(mechanism.state, 0.0) | {"${x}": x, "${y}": y}`,
      "heights = energy(*states.values(), *mechanism.parameters.values()) + 0.0 * x",
      ...(told.knee === null ? [`levels = ${told.steps[0]}`] : [
        "low, high = heights.min(), heights.max()",
        `levels = [*np.linspace(low, ${number(told.knee)}, ${told.steps[0]}, endpoint=False), *np.linspace(${number(told.knee)}, high, ${told.steps[1] + 1})]`,
      ]),
      'plt.contourf(x, y, heights, levels, cmap="cividis")', ...marks,
    ];
  }],
  rest: [["from fastmech.plots.animation import draw_moment, moments", ...drawn], (about, told) => [
    "found = fm.find_equilibria(system)", `place = ${told.none ? `np.zeros(${about.coordinates.length})` : `found.position[${told.chosen}]`}`,
    `draw_moment(plt.figure().add_subplot(), moments(system, [place], [0.0]), force=${number(told.arrow)})`, 'plt.savefig("mechanism.png")',
  ]],
  mechanism: [[], (about, told) => [...motion(about, told), 'fm.animate(system, run, "motion.gif", fps=15)']],
  motion: [drawn, (about, told) => [
    ...motion(about, told), ...about.coordinates.map((n, k) => `plt.plot(times, run.y[:, 0, ${k}], label="${n}")`), ...shown("motion"),
  ]],
  energies: [drawn, (about, told) => [
    ...motion(about, told), ...mechanism(about, told.parameters, false), "y = run.y[:, 0]", "kinetic, potential = np.broadcast_arrays(*mechanism.energies(y))",
    "brought, lost = mechanism.works(times, y)",
    'for name in ("kinetic", "potential", "brought", "lost"):', "    plt.plot(times, globals()[name], label=name)", ...shown("energies"),
  ]],
  portrait: [drawn, (about, told) => {
    const k = about.coordinates.indexOf(told.of), n = about.coordinates.length;
    return [...motion(about, told), `plt.plot(run.y[:, 0, ${k}], run.y[:, 0, ${n + k}], label="${told.of}_dot over ${told.of}")`, ...shown("portrait")];
  }],
  basins: [drawn, (about, told) => [axesOf(told), `found = fm.map_basins(system, axes, ${number(told.t_end)})`, "print(found)", "found.plot()", 'plt.savefig("basins.png")']],
  atlas: [drawn, (about, told) => [
    axesOf(told), "found = fm.map_equilibria(system, axes)", `curves = fm.${about.scene ? "trace_folds" : "critical_curves"}(system, *axes.items())`,
    "print(found.count, curves)", "ax = found.plot()", 'for curve in curves.curves:', '    ax.plot(curve.x, curve.y, "k", label=curve.kind)', 'plt.savefig("atlas.png")',
  ]],
};

export function pythonOf(about, view, told) {
  const [imports, lines] = VIEWS[view];
  return ["import numpy as np", ...imports, "import fastmech as fm", "", ...system(about, told.parameters), ...lines(about, told), ""].join("\n");
}

export function requestOf(about, view, told) {
  const { source, scene } = about, made = source?.includes(":"), table = (values) => `{ ${Object.entries(values).map(([n, v]) => `${n} = ${number(v)}`).join(", ")} }`;
  const lines = [`title = "${about.name}, from the explorer"`];
  if (made) lines.push(`# fastmech run THIS.toml --mechanism ${source}`);
  else if (!scene) lines.push(`mechanism = "${source}"`);
  lines.push("", "[scene]", ...Object.entries(told.parameters).map(([n, v]) => `${n} = ${number(v)}`), "");
  const axes = () => Object.entries(told.axes).map(([n, [a, b]]) => `axes.${n} = { start = ${number(a)}, stop = ${number(b)}, num = ${told.divisions + 1} }`);
  if (["equilibria", "landscape", "rest"].includes(view)) lines.push("[scan.rest]", 'kind = "equilibria"');
  else if (view === "basins") lines.push("[scan.basins]", `kind = "${told.attractors ? "attractors" : "basins"}"`, `t_end = ${number(told.t_end)}`, ...axes());
  else if (view === "atlas") lines.push("[scan.atlas]", 'kind = "equilibrium_map"', ...(scene ? ["# with its folds"] : ["# its curves are fm.critical_curves of the Python lines"]), ...axes());
  else {
    const start = Object.fromEntries(statesOf(about).map((n) => [n, told.start[n] ?? 0]));
    lines.push("[scan.swing]", 'kind = "motion"', `start = ${table(start)}`);
    lines.push(`t_end = ${number(told.t_end)}`, `outputs = ${told.outputs}`, `dt = ${number(told.dt)}`);
  }
  return [...lines, ""].join("\n");
}
