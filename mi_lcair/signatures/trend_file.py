"""The CSV of a trend: whole after each batch, so that an interrupted run can go on."""

import csv
import io
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.files import check_writable, replacing
from mi_lcair.rendering.views import View


class TrendFile:
    """Rows by view, and the file that holds them (path None: none). Lines before the columns, `#
    key: value`, say how they were made.

    needed: columns without which a row is none.
    """

    def __init__(self, path, header: dict[str, str], views, needed):
        self.path = None if path is None else Path(path)
        self.header, self.views, self.needed, self.rows = header, views, needed, {}
        if self.path:
            check_writable(self.path)

    def resume(self) -> None:
        """Takes the rows of the file, if there is one, that belong to this trend. InputError where
        it was made otherwise.
        """
        if self.path is None:
            raise InputError("resume needs a file that holds the views done so far")
        if not self.path.exists():
            return
        try:
            lines = self.path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError):
            raise InputError(
                f"{self.path}: cannot be read as a trend's CSV, so that nothing can be resumed"
            ) from None
        made = dict(
            line.removeprefix("# ").split(": ", 1)
            for line in lines
            if line.startswith("# ") and ": " in line
        )
        for key, value in self.header.items():
            if made.get(key) != value:
                raise InputError(
                    f"{self.path}: made with {key} = {made.get(key, 'nothing')}, and this trend has {value}; resume with the "
                    "same, or write to another file"
                )
        wanted = set(self.views)
        for number, cells in enumerate(
            csv.DictReader(line for line in lines if not line.startswith("#")), 1
        ):
            try:
                row = {name: float(cell) for name, cell in cells.items()}
                view = View(row["azimuth_deg"], row["elevation_deg"])
                if view not in wanted or not set(self.needed) <= set(row):
                    raise ValueError
            except (TypeError, ValueError, KeyError):
                raise InputError(
                    f"{self.path}: row {number} is not one of this trend; write to another file"
                ) from None
            self.rows[view] = row

    def holds(self, views) -> bool:
        """Whether all of these are done."""
        return all(view in self.rows for view in views)

    def add(self, rows: dict[View, dict[str, float]]) -> None:
        """Takes the rows of a batch, and replaces the file by one that holds them too."""
        self.rows |= rows
        if self.path is None:
            return
        text = io.StringIO()
        for key, value in self.header.items():
            text.write(f"# {key}: {value}\n")
        text.write(f"# done: {len(self.rows)} of {len(self.views)} views\n")
        writer = csv.writer(text, lineterminator="\n")
        ordered = self.ordered()
        writer.writerow(ordered[0])
        writer.writerows(
            [f"{value:.{12 if name.endswith('_deg') else 9}g}" for name, value in row.items()]
            for row in ordered
        )
        with replacing(self.path) as partial:
            partial.write_text(text.getvalue(), encoding="utf-8")

    def ordered(self) -> list[dict[str, float]]:
        return [self.rows[view] for view in self.views if view in self.rows]

    def columns(self) -> dict[str, np.ndarray]:
        rows = self.ordered()
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}
