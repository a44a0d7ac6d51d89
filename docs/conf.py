"""Sphinx: pages from Markdown, the reference from docstrings, mathematics as MathML (no network needed)."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path
from typing import Any

import click
from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

project, author, copyright = "fastmech", "the fastmech developers", "the fastmech developers"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
html_theme = "pydata_sphinx_theme"
html_math_renderer = "mathml"
html_theme_options = {
    "show_toc_level": 2,
    "navbar_end": ["theme-switcher"],
    "header_links_before_dropdown": 8,
}
html_static_path, html_css_files = ["_static"], ["formula.css"]
html_show_sourcelink = False
autodoc_typehints = "description"
autodoc_member_order = "bysource"
add_module_names = False
exclude_patterns = ["_build"]
suppress_warnings = ["ref.python", "docutils"]  # attributes of one name in several result types


def _inline(self: Any, node: nodes.math) -> None:
    self.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(self: Any, node: nodes.math_block) -> None:
    text = (
        node.astext().replace(r"\begin{aligned}", r"\begin{align}").replace(r"\end{aligned}", r"\end{align}")
    )
    self.body.append(f'<div class="formula">{convert(text, display="block")}</div>\n')
    raise nodes.SkipNode


def _commands(folder: Path) -> None:
    """The command line's own help as a page."""
    from fastmech.cli import COMMANDS, main

    lines = ["# Command line", "", "Each command has `--help`, which says the same.", ""]
    for name in COMMANDS:
        with click.Context(main, info_name="fastmech") as context:
            command = main.get_command(context, name)
            assert command is not None
            told = command.get_help(click.Context(command, parent=context, info_name=name))
        lines += [f"## fastmech {name}", "", "```text", told, "```", ""]
    (folder / "command_line.md").write_text("\n".join(lines), encoding="utf-8")


def _gallery(folder: Path) -> None:
    """Every shipped request with its title and command."""
    shown = tomllib.loads((ROOT / "docs" / "pictures" / "gallery.toml").read_text(encoding="utf-8"))
    lines = ["# Gallery", "", "Every request in `scans/`, with the command that computes and draws it.", ""]
    for path in sorted((ROOT / "scans").rglob("*.toml")):
        text, where = path.read_text(encoding="utf-8"), path.relative_to(ROOT)
        table = tomllib.loads(text)
        about = [line[1:].strip() for line in text.splitlines() if line.startswith("#")]
        about = [line for line in about if not line.startswith("fastmech run")]
        kinds = ", ".join(f"`{scan['kind']}`" for scan in table["scan"].values())
        own = path.with_suffix(".py")
        name = "mechanism" if own.exists() and "def mechanism" in own.read_text() else "system"
        how = f" --mechanism {own.relative_to(ROOT)}:{name}" if own.exists() else ""
        coarse = " The picture has 400 x 400 points." if "num = 4000" in text else ""
        lines += [
            f"## {table.get('title', path.stem)}",
            "",
            " ".join(about),
            "",
            f"Scans: {kinds}.{coarse}",
            "",
        ]
        section = shown[path.stem]["picture"].partition("/")[0]
        lines += [
            f"![{table.get('title', path.stem)}](../pictures/gallery/{path.stem}.png)",
            "",
            f"{shown[path.stem]['about']} (scan `{section}`; the other pictures are drawn too)",
            "",
        ]
        lines += ["```sh", f"fastmech run {where}{how}", f"fastmech plot results/{path.stem}.h5", "```", ""]
    (folder / "gallery.md").write_text("\n".join(lines), encoding="utf-8")


def _reference(folder: Path) -> None:
    """Every public name, from its docstring."""
    import fastmech

    lines = ["# Python reference", "", "`import fastmech as fm`; SI units, angles in radians.", ""]
    for name in fastmech.__all__:
        kind = "autoclass" if isinstance(getattr(fastmech, name), type) else "autofunction"
        kept = "" if kind == "autofunction" or name == "Scene" else ":members:\n"
        where = getattr(getattr(fastmech, name), "__module__", "fastmech")
        if not callable(getattr(fastmech, name)):
            continue
        lines += [f"## fm.{name}", "", "```{eval-rst}", f".. {kind}:: {where}.{name}"]
        lines += [f"   {kept}" if kept else "", "```", ""]
    (folder / "reference.md").write_text("\n".join(lines), encoding="utf-8")


def setup(app: Sphinx) -> None:
    """Pages that are made, before any is read."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    made = ROOT / "docs" / "made"
    made.mkdir(exist_ok=True)
    for page in (_commands, _gallery, _reference):
        page(made)
