"""The CSV file of a trend.

It is complete after each batch, so that an interrupted run can continue.
"""

import warnings
from hashlib import sha256
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, escaped, printable
from mi_lcair.files import check_writable, read_text, replacing
from mi_lcair.rendering.views import View


class TrendFile:
    """Rows of a trend by view, and the file that holds them.

    A line `# batch NUMBER: CHECKSUM` protects the rows of each finished batch. The checksum is the
    first 16 hexadecimal digits of the SHA-256 of header, columns and rows.

    Parameters
    ----------
    path : path-like or None
        File to write; None for no file.
    header : dict of str to str
        How the rows were made, written as lines `# key: value` before the columns.
    batches : list of (int, tuple of View)
        Numbers and views of the batches that are rendered together.

    Raises
    ------
    InputError
        If the file cannot be written.
    """

    def __init__(self, path, header: dict[str, str], batches):
        self.path = None if path is None else Path(path)
        self.header = {key: escaped(value) for key, value in header.items()}
        self.batches = [views for _, views in batches]
        self.rows: dict[View, dict[str, float]] = {}
        self.lines: dict[View, str] = {}
        if self.path:
            check_writable(self.path)

    @property
    def views(self) -> list[View]:
        """All views of the trend, in their order."""
        return [view for views in self.batches for view in views]

    def resume(self) -> None:
        """Read the batches of an existing file whose rows match their checksum.

        A Python warning states how many batches do not match. They must be rendered again. Raises
        InputError if the file was made with other settings than this trend.
        """
        if self.path is None:
            raise InputError("resume needs a file that holds the views done so far")
        if not self.path.exists():
            return
        lines = read_text(self.path).splitlines()
        made = dict(
            line.removeprefix("# ").split(": ", 1)
            for line in lines
            if line.startswith("# ") and ": " in line
        )
        for key, value in self.header.items():
            if made.get(key) != value:
                raise InputError(
                    f"{self.path}: made with {key} = {printable(made.get(key, 'nothing'), 100)}, "
                    f"and this trend has {printable(value, 100)}; resume with the same, or write "
                    "to another file"
                )
        columns, *rows = [line for line in lines if line and not line.startswith("#")] or [""]
        by_view = {}  # lines that are not yet assigned to a batch
        for line in rows:
            by_view.setdefault(tuple(line.split(",")[:2]), []).append(line)
        damaged = 0
        for number, views in enumerate(self.batches):
            own = [line for view in views for line in by_view.pop(cells(view), ())]
            stated = made.get(f"batch {number}")
            if stated == self.checksum(columns, own):
                for view, line in zip(views, own):
                    self.rows[view] = dict(zip(columns.split(","), map(float, line.split(","))))
            elif own or stated:
                damaged += 1
        if damaged or by_view:
            strange = f"; {len(by_view)} rows of other views are dropped" if by_view else ""
            warnings.warn(
                f"{self.path}: {damaged} of {len(self.batches)} batches do not match their "
                f"checksum and are rendered again{strange}",
                stacklevel=2,
            )

    def checksum(self, columns: str, rows: list[str]) -> str:
        """Checksum of the rows of a batch, together with the header and the line of columns."""
        made = [f"{key}: {value}" for key, value in self.header.items()]
        return sha256("\n".join([*made, columns, *rows]).encode()).hexdigest()[:16]

    def holds(self, views) -> bool:
        """Whether the rows of all these views are known."""
        return all(view in self.rows for view in views)

    def add(self, rows: dict[View, dict[str, float]]) -> None:
        """Add the rows of a batch, and replace the file by one that includes them."""
        self.rows |= rows
        if self.path is None:
            return
        names = list(self.ordered()[0])
        for view, row in self.rows.items():
            if view not in self.lines:
                values = (text(row[name]) for name in names[2:])
                self.lines[view] = ",".join([*cells(view), *values])
        done = [(n, views) for n, views in enumerate(self.batches) if self.holds(views)]
        columns = ",".join(names)
        content = [
            *(f"# {key}: {value}" for key, value in self.header.items()),
            f"# done: {len(self.rows)} of {len(self.views)} views",
            *(
                f"# batch {number}: {self.checksum(columns, [self.lines[view] for view in views])}"
                for number, views in done
            ),
            columns,
            *(self.lines[view] for view in self.views if view in self.rows),
        ]
        with replacing(self.path) as partial:
            partial.write_text("\n".join(content) + "\n", encoding="utf-8")

    def ordered(self) -> list[dict[str, float]]:
        """The known rows, in the order of the views."""
        return [self.rows[view] for view in self.views if view in self.rows]

    def columns(self) -> dict[str, np.ndarray]:
        """The known rows as columns, in the order of the views."""
        rows = self.ordered()
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def cells(view: View) -> tuple[str, str]:
    """The first two cells of a view's row: azimuth and elevation in degrees."""
    return f"{view.azimuth_deg:.12g}", f"{view.elevation_deg:.12g}"


def text(value: float) -> str:
    """A number as the file holds it, with nine digits."""
    return f"{value:.9g}"
