"""The report as one file that needs no other: Markdown to HTML with every picture inside."""

from __future__ import annotations

import base64
from collections.abc import Mapping

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; color: #1b1b1b; background: #fff; }}
body {{ max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }}
h1, h2, h3 {{ line-height: 1.25; margin-top: 2.2rem; }}
h1 {{ margin-top: 0; }}
h2 {{ border-bottom: 2px solid #0072b2; padding-bottom: .2rem; }}
table {{ border-collapse: collapse; margin: 1rem 0; font-size: .9rem; display: block; overflow-x: auto; }}
th, td {{ border: 1px solid #d0d0d0; padding: .3rem .6rem; vertical-align: top; }}
th {{ background: #eef3f7; text-align: left; }}
tr:nth-child(even) td {{ background: #fafafa; }}
code {{ background: #f3f3f3; padding: .1rem .25rem; font-size: .88em; overflow-wrap: anywhere; }}
img {{ max-width: 100%; height: auto; display: block; margin: .5rem 0; }}
a {{ color: #0072b2; }}
</style>
</head>
<body>
{body}
</body>
</html>
"""


def to_html(markdown: str, title: str, pictures: Mapping[str, bytes]) -> str:
    """A page from Markdown text; ``pictures`` are the PNG files that it shows, by file name."""
    from markdown import markdown as convert

    body = convert(markdown, extensions=["tables", "toc"], output_format="html")
    for name, content in pictures.items():
        inside = base64.b64encode(content).decode("ascii")
        body = body.replace(f'src="{name}"', f'src="data:image/png;base64,{inside}"')
    return _PAGE.format(title=title, body=body)
