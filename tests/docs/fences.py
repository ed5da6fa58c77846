"""The code blocks ("fences") of README and of the site's pages, with the comments before them.

<!-- file: NAME -->          the block is this file; it equals scenes/examples/NAME if that exists
<!-- part of: NAME -->       all lines of the block are lines of scenes/examples/NAME, in order
<!-- not run: REASON -->     a block of commands or Python that no test runs
"""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "scenes" / "examples"
COMMENT = re.compile(r"<!-- (file|part of|not run): (.+?) -->$")
FENCE = re.compile(r"( *)```(\w*)")


@dataclass(frozen=True)
class Fence:
    """A code block of a page.

    page: path below the repository's root. line: number of its first line of text. text: its lines.
    mark, value: kind and text of the comment before it; empty if there is none.
    """

    page: str
    line: int
    language: str
    text: str
    mark: str = ""
    value: str = ""

    @property
    def place(self) -> str:
        return f"{self.page}:{self.line}"

    @property
    def sample(self) -> Path | None:
        """The sample file that the comment names; None if there is none."""
        places = (EXAMPLES, (ROOT / self.page).parent)
        return next(
            (place / self.value for place in places if (place / self.value).is_file()), None
        )

    @property
    def is_run(self) -> bool:
        return self.language in ("sh", "python") and self.mark != "not run"


def pages() -> list[str]:
    """README and the site's pages; templates are not pages."""
    site = (file.relative_to(ROOT).as_posix() for file in (ROOT / "docs").rglob("*.md"))
    return ["README.md", *sorted(p for p in site if "template" not in p)]


def fences(page: str) -> list[Fence]:
    """All fences of a page, in order."""
    lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
    found, number, comment = [], 0, ("", "")
    while number < len(lines):
        line = lines[number]
        number += 1
        if mark := COMMENT.match(line.strip()):
            comment = (mark[1], mark[2])
        elif opening := FENCE.match(line):
            indent = len(opening[1])
            end = next(n for n in range(number, len(lines)) if lines[n].strip() == "```")
            text = "".join(f"{text[indent:]}\n" for text in lines[number:end])
            found.append(Fence(page, number + 1, opening[2], text, *comment))
            number, comment = end + 1, ("", "")
        elif line.strip():
            comment = ("", "")
    return found


def all_fences() -> list[Fence]:
    return [fence for page in pages() for fence in fences(page)]
