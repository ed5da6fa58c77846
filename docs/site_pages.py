"""What `mkdocs build` does beside its plugins: manuals of plugins, MathML, links of tutorials.

A line `::: keys MODULE.CLASS` becomes the keys of a table of a TOML file: defaults and bounds from
its fields, and meanings from the docstring of its class.

Manuals and equations are made by docutils, without JavaScript and without a network. A line
`::: plugin NAME` on a page becomes the manual of the plugin in plugins/KINDs/NAME.py. The manual is
the docstring of the class that has the plugin's name in CamelCase. The file is parsed and not
imported, because plugins exist once for each Mitsuba variant. Tutorials name pages by
their source files, as Markdown does, and mkdocs-jupyter leaves these links as they are.
"""

import ast
import html
import inspect
import json
import posixpath
import re
from dataclasses import MISSING, fields
from importlib import import_module
from pathlib import Path

from docutils.core import publish_parts
from mkdocs.exceptions import PluginError

PLUGINS = Path(__file__).parents[1] / "plugins"
MANUAL = re.compile(r"^::: plugin (\w+)$", re.MULTILINE)
KEYS = re.compile(r"^::: keys ([\w.]+)$", re.MULTILINE)
MEANING = re.compile(r"^(\w+(?:, \w+)*)(?: : .+)?\n((?: {4}.+(?:\n|$))+)", re.MULTILINE)
LINK = re.compile(r'href="(?!\w+:)([^"#]+\.(?:md|py))(?=["#])')  # to a source file on this site
EQUATION = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_markdown(markdown: str, **_) -> str:
    """Return the page with the manuals and the tables of keys that it names."""
    markdown = KEYS.sub(lambda line: keys(line[1]), markdown)
    return MANUAL.sub(lambda line: manual(line[1]), markdown)


def keys(place: str) -> str:
    """Return the keys of the table that the class MODULE.CLASS declares, as Markdown."""
    module, _, name = place.rpartition(".")
    table = getattr(import_module(module), name)
    text = "\n".join(inspect.getdoc(kind) or "" for kind in reversed(table.__mro__[:-1]))
    meanings = {
        key: " ".join(words.split())
        for names, words in MEANING.findall(text)
        for key in names.split(", ")
    }
    lines = ["| key | default | what it is |", "|---|---|---|"]
    for entry in fields(table):
        default = "" if entry.default is None else shown(entry)
        bounds, meaning = entry.metadata.get("bounds"), meanings[entry.name]
        limits = f" It must {bounds}." if bounds and str(bounds) != "be finite" else ""
        lines.append(f"| `{entry.name}` | {default} | {meaning}{limits} |")
    return "\n".join(lines)


def shown(entry) -> str:
    """Return the default of a field as TOML has it; "needed" if there is none."""
    if entry.default is MISSING:
        return "needed" if entry.default_factory is MISSING else ""
    value = list(entry.default) if isinstance(entry.default, tuple) else entry.default
    return f"`{str(value).lower() if isinstance(value, bool) else json.dumps(value)}`"


def on_page_content(content: str, page=None, files=None, **_) -> str:
    """Return the page's HTML with MathML in place of the equations between dollar signs.

    Links to source files become links to their pages. Raises PluginError if a file is no page.
    """
    content = LINK.sub(lambda found: f'href="{address(found[1], page, files)}', content)
    return EQUATION.sub(lambda found: mathml(html.unescape(found[2]), found[1] == "div"), content)


def address(source: str, page, files) -> str:
    """Return the address, relative to a page, of the page whose source file it names."""
    path = posixpath.join(posixpath.dirname(page.file.src_uri), source)
    linked = files.get_file_from_path(posixpath.normpath(path))
    if linked is None:
        raise PluginError(f"{page.file.src_uri}: links to '{source}', which is no page")
    return linked.url_relative_to(page.file)


def manual(plugin: str) -> str:
    """Return heading and manual of the plugin in plugins/KIND/NAME.py, as Markdown and HTML."""
    (file,) = PLUGINS.glob(f"*s/{plugin}.py")
    tree = ast.parse(file.read_text(encoding="utf-8"))
    owner = plugin.title().replace("_", "")
    text = next(
        ast.get_docstring(node)
        for node in tree.body
        if isinstance(node, ast.ClassDef) and node.name == owner
    )
    return f"## {file.parent.name.removesuffix('s')} `{plugin}`\n\n<div>{converted(text)}</div>\n"


def mathml(equation: str, as_block: bool) -> str:
    """Return an equation in LaTeX as MathML."""
    if as_block:
        body = "\n    ".join(equation.strip().splitlines())
        return converted(f".. math::\n\n    {body}")
    return converted(f":math:`{equation}`").removeprefix("<p>").removesuffix("</p>")


def converted(text: str) -> str:
    """Return reStructuredText as HTML; raises docutils' SystemMessage if it has a fault."""
    settings = {"math_output": "MathML", "syntax_highlight": "short", "halt_level": 2}
    source = f".. default-role:: literal\n\n{text}"
    body = publish_parts(source, writer="html5", settings_overrides=settings)["body"]
    body = re.sub(r'<span class="docutils literal">(.*?)</span>', r"<code>\1</code>", body)
    body = body.replace('<pre class="code', '<pre class="highlight code')
    return body.strip()
