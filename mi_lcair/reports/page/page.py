"""The page itself: its skeleton, and the file, which is written completely or not at all."""

from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from mi_lcair.errors import InputError, printable
from mi_lcair.extras import optional
from mi_lcair.files import check_writable, replacing
from mi_lcair.reports.page.arrays import Arrays, packed

FOLDER = Path(__file__).parent
STYLE = "page.css"
SCRIPTS = ("page.js", "colours.js", "image_panel.js", "model_panel.js", "tables.js", "start.js")
# The page may run its own scripts and nothing else. It cannot ask a network for anything.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:"
)
LONGEST = 200  # characters of a title or label


@dataclass(frozen=True)
class Panel:
    """A part of a page that a script draws.

    kind: name of the script's function, such as "image". data: what the function gets; arrays may
    lie at any depth. height: height before the script has run, pixels.
    """

    kind: str
    data: dict
    height: int = 480


@dataclass(frozen=True)
class Section:
    """A section of a page.

    title: heading, as plain text. parts: panels, and pieces of HTML whose text is escaped.
    """

    title: str
    parts: list = field(default_factory=list)


def check_output(path) -> None:
    """Raise InputError for a path that is no .html file that can be written, or without plotly."""
    if Path(path).suffix.lower() not in (".html", ".htm"):
        raise InputError(f"output '{path}' does not end in .html; report writes HTML pages")
    check_writable(path)
    optional("plotly", "a report page")


def write(path, result, **options) -> None:
    """Write the page of a result in memory.

    Parameters
    ----------
    path : path-like
        File to write, FILE.html.
    result : Render, Signature, Trend, Contrast, Image, Fit, Plan or Audit
        Result of the function of the same name.
    **options
        Options of `sections.of_result`, such as `scene`, which shows the facets of a signature.

    Raises
    ------
    InputError
        If the file cannot be written, or if there is no page for such a result.
    """
    from mi_lcair.reports.page.sections import of_result

    check_output(path)
    title, sections = of_result(result, **options)
    save(path, title, sections)


def save(path, title: str, sections: list[Section]) -> None:
    """Write a page with a title and sections, completely or not at all."""
    text = page(title, sections)
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")


def page(title: str, sections: list[Section]) -> str:
    """The HTML of a page."""
    arrays = Arrays()
    names = [f"section-{number}" for number in range(1, len(sections) + 1)]
    contents = "".join(
        f'<li><a href="#{name}">{label(section.title)}</a></li>'
        for name, section in zip(names, sections)
    )
    body = "".join(
        f'<section id="{name}"><h2>{label(section.title)}</h2>'
        f"{''.join(part_html(part, arrays) for part in section.parts)}</section>\n"
        for name, section in zip(names, sections)
    )
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{label(title)}</title><link rel="icon" href="data:,">
<style>{own_file(STYLE)}</style></head>
<body><header><h1>{label(title)}</h1><nav><ul>{contents}</ul></nav></header>
<noscript><p class="note">The pictures of this page need JavaScript.</p></noscript>
<main>{body}</main>
<div id="tip" role="status" hidden></div>
<script type="text/plain" id="arrays">{arrays.packed()}</script>
<script type="text/plain" id="plotly">{plotly_for(sections)}</script>
<script>{"".join(map(own_file, SCRIPTS))}</script>
</body></html>
"""


def part_html(part, arrays: Arrays) -> str:
    """HTML of a part of a section: text as it is, a panel as a place with its data."""
    if isinstance(part, str):
        return part
    return (
        f'<div class="panel" data-kind="{part.kind}" style="min-height:{part.height}px">'
        f'<script type="application/json">{arrays.as_json(part.data)}</script></div>'
    )


def label(text: object) -> str:
    """Text for HTML: one line, with no character that means markup."""
    return escape(printable(text, LONGEST))


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph of plain text; kind: its class, such as "note"."""
    return f'<p class="{kind}">{escape(text)}</p>'


def own_file(name: str) -> str:
    """Text of a style sheet or script beside this module."""
    return (FOLDER / name).read_text(encoding="utf-8")


def plotly_for(sections: list[Section]) -> str:
    """The script of plotly.js, which the Python package brings, as compressed text.

    A page without pictures does not need it, and gets an empty one.
    """
    panels = [part for section in sections for part in section.parts if isinstance(part, Panel)]
    if all(panel.kind == "table" for panel in panels):
        return packed(b"")
    return packed(optional("plotly.offline", "a report page").get_plotlyjs().encode())
