"""The CSV file of a trend, and the file beside it that states how its rows were made.

Both are complete after each batch, so that an interrupted run can continue.
"""

import json
import warnings
from hashlib import sha256
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, escaped, printable
from mi_lcair.files import check_writable, read_text, replacing
from mi_lcair.formats import netcdf, tables
from mi_lcair.formats.csv import cell
from mi_lcair.rendering.views import View
from mi_lcair.table import read_table, safe_cell

NEEDED = tables.KNOWN_BY[tables.TREND]


def beside(path: Path) -> Path:
    """The file beside a trend's CSV `path` that states how its rows were made."""
    return path.with_name(f"{path.name}.json")


class TrendFile:
    """Rows of a trend by view, and the files that hold them.

    FILE.csv is plain: a line of names, and a row for each view. FILE.csv.json has `made`, which is
    the header; `done` and `views`, the number of rows and of all views; and `batches`, a checksum
    for each finished batch by its number. The checksum is the first 16 hexadecimal digits of the
    SHA-256 of header, columns and rows.

    Parameters
    ----------
    path : path-like or None
        File to write; None for no file.
    header : dict of str to str
        How the rows were made.
    batches : list of (int, tuple of View)
        Numbers and views of the batches that are rendered together.

    Raises
    ------
    InputError
        If the files cannot be written.
    """

    def __init__(self, path, header: dict[str, str], batches):
        self.path = None if path is None else Path(path)
        self.header = {key: escaped(value) for key, value in header.items()}
        self.batches = [views for _, views in batches]
        self.rows: dict[View, dict[str, float]] = {}
        self.lines: dict[View, str] = {}
        if self.path:
            check_writable(self.path)
            check_writable(beside(self.path))

    @property
    def views(self) -> list[View]:
        """All views of the trend, in their order."""
        return [view for views in self.batches for view in views]

    def refuse_to_overwrite(self) -> None:
        """Raise InputError if the CSV exists already."""
        if self.path and self.path.exists():
            raise InputError(
                f"output '{self.path}' exists; give --resume (resume=True) to keep its views, "
                "--overwrite (overwrite=True) to replace it, or name another file"
            )

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
        made, checksums = self._made()
        for key, value in self.header.items():
            if made.get(key) != value:
                raise InputError(
                    f"{self.path}: made with {key} = {printable(made.get(key, 'nothing'), 100)}, "
                    f"and this trend has {printable(value, 100)}; resume with the same, or write "
                    "to another file"
                )
        columns, *rows = [line for line in lines if line] or [""]
        by_view = {}  # lines that are not yet assigned to a batch
        for line in rows:
            by_view.setdefault(tuple(line.split(",")[:2]), []).append(line)
        damaged = 0
        for number, views in enumerate(self.batches):
            own = [line for view in views for line in by_view.pop(cells(view), ())]
            stated = checksums.get(str(number))
            if stated == self.checksum(columns, own):
                for view, line in zip(views, own):
                    self.rows[view] = dict(zip(columns.split(","), map(number_of, line.split(","))))
            elif own or stated:
                damaged += 1
        if damaged or by_view:
            strange = f"; {len(by_view)} rows of other views are dropped" if by_view else ""
            warnings.warn(
                f"{self.path}: {damaged} of {len(self.batches)} batches do not match their "
                f"checksum and are rendered again{strange}",
                stacklevel=2,
            )

    def _made(self) -> tuple[dict, dict]:
        """Header and checksums of the file beside the CSV.

        Raises InputError if that file is missing or of another kind.
        """
        path = beside(self.path)
        if not path.exists():
            raise InputError(
                f"{self.path}: cannot be resumed without '{path.name}' beside it, which states how "
                "its rows were made; write to another file"
            )
        try:
            content = json.loads(read_text(path))
            made, checksums = content["made"], content["batches"]
            if not all(isinstance(part, dict) for part in (made, checksums)):
                raise TypeError
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"{path}: does not state how the rows of a trend were made; write to another file"
            ) from None
        return made, checksums

    def checksum(self, columns: str, rows: list[str]) -> str:
        """Checksum of the rows of a batch, together with the header and the line of columns."""
        made = [f"{key}: {value}" for key, value in self.header.items()]
        return sha256("\n".join([*made, columns, *rows]).encode()).hexdigest()[:16]

    def holds(self, views) -> bool:
        """Whether the rows of all these views are known."""
        return all(view in self.rows for view in views)

    def add(self, rows: dict[View, dict[str, float]]) -> None:
        """Add the rows of a batch, and replace the files by those that include them."""
        self.rows |= rows
        if self.path is None:
            return
        names = list(self.ordered()[0])
        for view, row in self.rows.items():
            if view not in self.lines:
                values = (cell(float(row[name])) for name in names[2:])
                self.lines[view] = ",".join([*cells(view), *values])
        columns = ",".join(map(column, names))
        content = [columns, *(self.lines[view] for view in self.views if view in self.rows)]
        state = {
            "made": self.header,
            "done": len(self.rows),
            "views": len(self.views),
            "batches": {
                str(number): self.checksum(columns, [self.lines[view] for view in views])
                for number, views in enumerate(self.batches)
                if self.holds(views)
            },
        }
        with replacing(self.path) as partial, replacing(beside(self.path)) as partial_state:
            partial_state.write_text(json.dumps(state, indent=2) + "\n", encoding="utf-8")
            partial.write_text("\n".join(content) + "\n", encoding="utf-8")

    def ordered(self) -> list[dict[str, float]]:
        """The known rows, in the order of the views."""
        return [self.rows[view] for view in self.views if view in self.rows]

    def columns(self) -> dict[str, np.ndarray]:
        """The known rows as columns, in the order of the views."""
        rows = self.ordered()
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def read_trend(path) -> tuple[str, dict[str, np.ndarray], str]:
    """Scene's name, columns and band of a trend in a .csv or .nc file.

    Raises InputError for a file of another kind.
    """
    path = Path(path)
    made = stated(path)
    if path.suffix.lower() == ".nc":
        columns = netcdf.read_columns(path)
    else:
        table = read_table(path, NEEDED)
        columns = table.numbers(table.columns, may_lack=True)
    if not set(NEEDED) <= set(columns):
        raise InputError(f"{path}: is no trend, which has the columns {', '.join(NEEDED)}")
    rows = np.isfinite(columns["intensity_W_sr"])  # others are points of a grid without a view
    columns = {name: values[rows] for name, values in columns.items()}
    return made.get("scene", path.stem), columns, made.get("band", "")


def stated(path: Path) -> dict[str, str]:
    """Scene's name and band of a trend in a .csv or .nc file, as far as they are stated."""
    made = {}
    if path.suffix.lower() == ".nc":
        made = netcdf.read_attributes(path)
    elif beside(path).exists():
        made, _ = TrendFile(path, {}, [])._made()
    return {name: str(made[name]) for name in ("scene", "band") if name in made}


def cells(view: View) -> tuple[str, str]:
    """The first two cells of a view's row: azimuth and elevation in degrees."""
    return f"{view.azimuth_deg:.12g}", f"{view.elevation_deg:.12g}"


def column(name: str) -> str:
    """Name of a column as the file holds it; a comma in a group's label becomes a semicolon."""
    return safe_cell(name).replace(",", ";").replace('"', "'")


def number_of(text: str) -> float:
    """The number of a cell; NaN for an empty one."""
    return float(text) if text else np.nan
