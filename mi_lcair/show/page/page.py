"""The page itself: its skeleton, and the file, which is written completely or not at all."""

import base64
import gzip
import json
from html import escape
from pathlib import Path

import numpy as np

from mi_lcair.errors import printable
from mi_lcair.extras import optional
from mi_lcair.files import check_suffix, check_writable, replacing
from mi_lcair.sections import Drawing, LongTable, Picture, Section
from mi_lcair.sections import part_html as plain_part_html
from mi_lcair.show.page.line_panel import LONGEST, Panel, table_panel

# Numbers and scripts of a page as compressed text, which the browser unpacks
# ---------------------------------------------------------------------------
# All arrays of a page lie one behind the other in one block of Float32.


class Arrays:
    """The arrays of a page, each held once.

    `as_json` writes data in which arrays may lie at any depth, and puts references in their place.
    """

    def __init__(self):
        self._blocks: list[np.ndarray] = []
        self._first: dict[bytes, int] = {}  # content of each block: its first number
        self._count = 0

    def reference(self, values) -> object:
        """What stands for an array in the JSON: the place of its first number, and its shape.

        NumPy's scalars become Python's.
        """
        if isinstance(values, np.generic):
            return values.item()
        if not isinstance(values, np.ndarray):
            raise TypeError(f"a page cannot contain {type(values).__name__}")
        with np.errstate(over="ignore"):
            block = values.astype("<f4").ravel()
        key = block.tobytes()
        if key not in self._first:
            self._first[key] = self._count
            self._blocks.append(block)
            self._count += block.size
        return {"first": self._first[key], "shape": list(values.shape)}

    def as_json(self, data) -> str:
        """The data as JSON for a script element; no text in it can end the element.

        Numbers that are not finite become null. Arrays keep them.
        """
        text = json.dumps(finite(data), default=self.reference, allow_nan=False, ensure_ascii=False)
        return text.replace("<", "\\u003c")

    def packed(self) -> str:
        """All arrays as compressed text."""
        return packed(np.concatenate([np.empty(0, "<f4"), *self._blocks]).tobytes())


def finite(data):
    """The data with None for every float that is not finite."""
    if isinstance(data, dict):
        return {key: finite(value) for key, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [finite(value) for value in data]
    if isinstance(data, (float, np.floating)) and not np.isfinite(data):
        return None
    return data


def packed(content: bytes) -> str:
    """Compressed bytes as text of 64 characters; the same bytes give the same text."""
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()


FOLDER = Path(__file__).parent
STYLE = "page.css"
SCRIPTS = ("page.js", "colours.js", "image_panel.js", "model_panel.js", "tables.js", "start.js")
# The page may run its own scripts and nothing else. It cannot ask a network for anything.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:"
)


def check_output(path) -> None:
    """Raise InputError for a path that is no .html file that can be written, or without plotly."""
    check_suffix(path, (".html", ".htm"))
    check_writable(path)
    optional("plotly", "a report page")


def save(path, title: str, sections: list[Section]) -> None:
    """Write a page with a title and sections, completely or not at all."""
    text = page(title, sections)
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")


def page(title: str, sections: list[Section]) -> str:
    """The HTML of a page."""
    arrays, kinds = Arrays(), set()
    contents, body = "", ""
    for number, section in enumerate(sections, 1):
        heading = label(section.title)
        parts = [drawn(part) for part in section.parts]
        kinds |= {part.kind for part in parts if isinstance(part, Panel)}
        contents += f'<li><a href="#section-{number}">{heading}</a></li>'
        content = "".join(part_html(part, arrays) for part in parts)
        body += f'<section id="section-{number}"><h2>{heading}</h2>{content}</section>\n'
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{label(title)}</title><link rel="icon" href="data:,">
<style>{beside(STYLE)}</style></head>
<body><header><h1>{label(title)}</h1><nav><ul>{contents}</ul></nav></header>
<noscript><p class="note">The pictures of this page need JavaScript.</p></noscript>
<main>{body}</main>
<div id="tip" role="status" hidden></div>
<script type="text/plain" id="arrays">{arrays.packed()}</script>
<script type="text/plain" id="plotly">{plotly_for(kinds)}</script>
<script>{"".join(map(beside, SCRIPTS))}</script>
</body></html>
"""


def drawn(part):
    """A part of a section, or the panel that a script makes of it."""
    match part:
        case Drawing(panel):
            return panel()
        case Picture() if hasattr(part, "panel"):
            return part.panel()
        case LongTable():
            return table_panel(part)
    return part


def part_html(part, arrays: Arrays) -> str:
    """HTML of a part of a section; a panel is a place with its data."""
    if not isinstance(part, Panel):
        return plain_part_html(part)
    return (
        f'<div class="panel" data-kind="{part.kind}" style="min-height:{part.height}px">'
        f'<script type="application/json">{arrays.as_json(part.data)}</script></div>'
    )


def label(text: object) -> str:
    """Text for HTML: one line, with no character that means markup."""
    return escape(printable(text, LONGEST))


def beside(name: str) -> str:
    """Text of a style sheet or script beside this module."""
    return (FOLDER / name).read_text(encoding="utf-8")


def plotly_for(kinds: set[str]) -> str:
    """The script of plotly.js, which the Python package brings, as compressed text.

    It is empty for a page whose panels are all tables.
    """
    if kinds <= {"table"}:
        return packed(b"")
    return packed(optional("plotly.offline", "a report page").get_plotlyjs().encode())
