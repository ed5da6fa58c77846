"""The problem of a twin: a heat balance, what was measured of it, and its unknowns."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from mi_lcair.declared import Described, entry, needs, one_of
from mi_lcair.errors import InputError, check_known, errors_of
from mi_lcair.files import parse_toml, read_text
from mi_lcair.knowing.inversion.data.readings import relative
from mi_lcair.knowing.inversion.tables import UnknownEntry
from mi_lcair.toml_table import check_tables, dotted, filled, plain, table_of, tables_of

OF_ENTRY = tuple(UnknownEntry.__dataclass_fields__)
OF_UNKNOWN = ("start", "lower", "upper", "prior")  # entries that an unknown may have


@dataclass(frozen=True)
class SeriesTable(Described, where="[heat]", rules=(needs("common_K", "measured"),)):
    """[heat] of a problem: the balance and its measured temperatures.

    Attributes
    ----------
    file : str
        The heat.toml. Its values are the first guess.
    measured : str or None
        CSV with the column `hour` and a column [K] for groups by name, or for facets as facet_12.
    sigma_K : float
        Noise of a reading.
    common_K : float
        Error that is common to all readings, such as a calibration error.
    starts : int
        Number of first guesses: that of the heat.toml, and random ones within what is known
        beforehand. The one that fits best is kept.
    """

    file: str = entry(is_file=True)
    measured: str | None = entry(None, is_file=True)
    sigma_K: float = entry(0.3, lower=1e-3, upper=1000)
    common_K: float = entry(0.0, lower=0, upper=1000)
    starts: int = entry(1, lower=1, upper=100)


@dataclass(frozen=True)
class CameraFrames(Described, rules=(one_of("netd_mK", "sigma"),)):
    """Table [[frames]]: images that one camera took at stated hours.

    Attributes
    ----------
    list : str
        CSV with the columns `hour` and `image`, files relative to its folder. Further columns are
        temperatures of the scene [K] at each hour, by name, such as "sky.temperature".
    name : str
        Name of the camera in messages and results; by default camera 1, camera 2 and so on.
    scene : str or None
        Bundled scene or Mitsuba XML file with the same model; that of the heat.toml if left out.
    parameters : dict
        The scene's $-parameters, such as band and resolution.
    sensor : int
        Number of the sensor, counted from 0.
    quantity, channel : str or None
        What the images hold, and the channel of an EXR file, as in [[data]] of a problem.
    scale : float
        Number by which the values of a file are multiplied, such as 0.01 for centikelvin.
    mask : str or None
        PNG, TIFF, CSV or NPY file. Pixels that are 0 do not count.
    saturation : float or None
        Pixels of this value and above do not count.
    netd_mK, sigma : float or None
        Noise of a pixel, one of them: NETD at 300 K, or in W m^-2 sr^-1.
    gain_sigma : str
        Standard deviation of the camera's gain, common to all frames, such as "3 %".
    offset_K, drift_K : float
        Standard deviations of an offset that is common to all frames, and of one of each frame,
        as a change of temperature at 300 K.
    pose_px : float
        Standard deviation of the direction in which the camera looks, in pixels.
    edge_px : int
        Pixels this near to the outline of a group are left out, because optics blur them.
    spp : int or None
        Paths of each pixel for the effective areas; by default the scene's.
    seed : int
        Seed of the random numbers.
    """

    list: str = entry(is_file=True)
    name: str = ""
    scene: str | None = entry(None, is_file=True)
    parameters: dict = entry(dict, is_file=True)
    sensor: int = entry(0, lower=0)
    quantity: str | None = None
    channel: str | None = None
    scale: float = 1.0
    mask: str | None = entry(None, is_file=True)
    saturation: float | None = None
    netd_mK: float | None = entry(None, is_positive=True)
    sigma: float | None = entry(None, is_positive=True)
    gain_sigma: str = "0"
    offset_K: float = entry(0.0, lower=0, upper=1000)
    drift_K: float = entry(0.0, lower=0, upper=1000)
    pose_px: float = entry(0.0, lower=0, upper=10)
    edge_px: int = entry(1, lower=0, upper=100)
    spp: int | None = entry(None, lower=16, upper=2**20)
    seed: int = entry(0, lower=0, upper=2**32 - 1)

    @property
    def gain(self) -> float:
        """gain_sigma as a number."""
        return relative(self.gain_sigma)

    def complete(self) -> None:
        """Raise InputError for a standard deviation that is no fraction."""
        _ = self.gain


@dataclass(frozen=True)
class TwinProblem:
    """What a problem with [heat] states: the balance, its cameras, and its unknowns by name."""

    heat: SeriesTable
    frames: list[CameraFrames]
    unknowns: dict[str, UnknownEntry]


def twin_problem(problem) -> TwinProblem | None:
    """The tables of a problem with [heat], from its file or as a dictionary; None for others."""
    if not isinstance(problem, (str, PathLike, dict)):
        return None
    is_tree = isinstance(problem, dict)
    where = "problem" if is_tree else f"problem '{problem}'"
    tree = plain(problem) if is_tree else parse_toml(read_text(problem, where), where)
    if "heat" not in tree:
        return None
    folder = Path() if is_tree else Path(problem).parent
    with errors_of(where):
        check_tables(["heat", "frames", "unknowns"], tree)
        heat = filled(SeriesTable, tree["heat"], "[heat]", folder)
        frames = [
            filled(CameraFrames, {"name": f"camera {k}"} | dict(values), f"[[frames]] {k}", folder)
            for k, values in enumerate(tables_of(tree, "frames"), 1)
        ]
        names = [table.name for table in frames]
        for name in {name for name in names if names.count(name) > 1}:
            raise InputError(f"[[frames]]: two cameras have the name '{name}'")
        if heat.measured is None and not frames:
            raise InputError("[heat]: measured is missing; give it, or [[frames]]")
        unknowns = {}
        for name, values in dotted(table_of(tree, "unknowns"), OF_ENTRY).items():
            place = f"[unknowns] '{name}'"
            check_known(f"key of {place}", OF_UNKNOWN, *(values if type(values) is dict else ()))
            unknowns[name] = filled(UnknownEntry, values, place)
        if not unknowns:
            raise InputError('no [unknowns]: name at least one, such as "ground.conductivity"')
        return TwinProblem(heat, frames, unknowns)
