"""An inverse problem: measurements, unknowns, and what is known beforehand, read from a TOML file.

Each table of the file is a dataclass here.
"""

import os
import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

from mi_lcair import scenes
from mi_lcair.detection.scenario import filled
from mi_lcair.errors import InputError, unknown
from mi_lcair.files import read_text

QUANTITIES = ("radiance", "apparent_temperature")
TABLES = ("data", "unknowns", "nuisance", "candidates", "goal", "render")
NUMBERS = ("intensity", "contrast")  # what a goal may be about, W/sr
FILES = ("scene", "image", "mask", "sigma_image", "trend")  # entries that may name a file
PER = ("band", "state", "data")  # what an unknown may have a value of its own for
LABELLED = re.compile(r"\s*(?P<name>[^\[\]]*[^\[\]\s])\s*(\[(?P<of>[^\[\]]+)\])?\s*")
NAME_KEY = re.compile(r"[^\[\],]{1,64}")


@dataclass(frozen=True)
class Place:
    """Where a measurement looks: a scene, a view and a heating state.

    Attributes
    ----------
    scene : str
        Bundled scene or Mitsuba XML file.
    name : str
        Name in messages and results; by default data 1, data 2 and so on.
    parameters : dict
        The scene's $-parameters.
    sensor : int
        Number of the sensor, counted from 0.
    state : str
        Name of the heating state. Temperatures have one value for each state.
    netd_mK : float, optional
        Noise-equivalent temperature difference of a pixel, mK.
    sigma : float, optional
        Standard deviation of the noise: W m^-2 sr^-1 for an image, W/sr for an intensity.
    """

    scene: str
    name: str = ""
    parameters: dict = field(default_factory=dict)
    sensor: int = 0
    state: str = ""
    netd_mK: float | None = None
    sigma: float | None = None

    def __post_init__(self):
        for key in ("netd_mK", "sigma"):
            value = getattr(self, key)
            if value is not None and not value > 0:
                raise InputError(f"{key} = {value:g}; must be positive")
        for key, value in self.parameters.items():
            if type(value) not in (str, int, float, bool):
                raise InputError(f"parameters: {key} = {value}; must be a text or a number")
        for key in ("name", "state"):
            if (text := getattr(self, key)) and not NAME_KEY.fullmatch(text):
                raise InputError(
                    f"{key} = '{text}'; must have 1 to 64 characters, without brackets and commas"
                )
        if self.sensor < 0:
            raise InputError(f"sensor = {self.sensor}; sensors are counted from 0")

    def scene_parameters(self) -> dict[str, str]:
        """The scene's $-parameters as text."""
        return {
            name: str(value).lower() if isinstance(value, bool) else str(value)
            for name, value in self.parameters.items()
        }

    def noises(self) -> list[str]:
        """Names of the entries that state the noise."""
        return [key for key in ("netd_mK", "sigma") if getattr(self, key) is not None]


@dataclass(frozen=True)
class Measurement(Place):
    """Table [[data]]: a measured image, number or trend.

    Attributes
    ----------
    image : str, optional
        EXR, TIFF, CSV or NPY file of the size of the scene's film.
    channel : str, optional
        Channel of an EXR file ("Y").
    quantity : str, optional
        "radiance" [W m^-2 sr^-1] or "apparent_temperature" [K]. Needed except for EXR.
    scale : float
        Number by which the values of the file are multiplied, such as 0.01 for centikelvin.
    mask : str, optional
        PNG, TIFF, CSV or NPY file; pixels that are 0 do not count.
    saturation : float, optional
        Pixels of this value and above do not count. In the unit of `quantity`.
    sigma_image : str, optional
        Image of the noise's standard deviation in the unit of `quantity`.
    gain, offset : bool
        Whether measured = gain x radiance + offset, with an unknown gain or offset.
    gain_prior, offset_prior : tuple of float, optional
        Mean and standard deviation that are known beforehand.
    intensity : float, optional
        Intensity of the target, W/sr, in place of an image.
    trend : str, optional
        CSV with the columns azimuth_deg, elevation_deg, intensity_W_sr and, without `sigma`,
        standard_error_W_sr, in place of an image.
    """

    image: str | None = None
    channel: str | None = None
    quantity: str | None = None
    scale: float = 1.0
    mask: str | None = None
    saturation: float | None = None
    sigma_image: str | None = None
    gain: bool = False
    offset: bool = False
    gain_prior: tuple[float, ...] | None = None
    offset_prior: tuple[float, ...] | None = None
    intensity: float | None = None
    trend: str | None = None

    def __post_init__(self):
        super().__post_init__()
        kinds = [key for key in ("image", "intensity", "trend") if getattr(self, key) is not None]
        if len(kinds) != 1:
            raise InputError(
                f"has {' and '.join(kinds) or 'no measurement'}; give one of image, "
                "intensity and trend"
            )
        self._check_noise()
        if self.quantity is not None and self.quantity not in QUANTITIES:
            raise unknown("quantity", self.quantity, QUANTITIES)
        if self.scale == 0:
            raise InputError("scale = 0; must not be zero")
        for key in ("gain", "offset"):
            prior = getattr(self, f"{key}_prior")
            if prior is not None and not getattr(self, key):
                raise InputError(f"{key}_prior is given without {key} = true")
            if getattr(self, key) and not self.image:
                raise InputError(f"{key} belongs to an image, and this is a number")
            check_prior(prior, f"{key}_prior")

    def _check_noise(self):
        noises = self.noises()
        allowed = {
            "image": ("netd_mK", "sigma", "sigma_image"),
            "trend": ("sigma",),
            "number": ("sigma",),
        }["image" if self.image else "trend" if self.trend else "number"]
        if self.trend and not noises:
            return  # the file states it
        if len(noises) != 1 or noises[0] not in allowed:
            raise InputError(
                f"states its noise by {' and '.join(noises) or 'nothing'}; "
                f"give {'one of ' if len(allowed) > 1 else ''}{', '.join(allowed)}"
            )

    def noises(self) -> list[str]:
        return [*super().noises(), *(["sigma_image"] if self.sigma_image is not None else [])]


@dataclass(frozen=True)
class Candidate(Place):
    """Table [[candidates]]: a measurement that could be made; what it would bring is computed.

    Its noise is `netd_mK` or `sigma` of an image.
    """

    def __post_init__(self):
        super().__post_init__()
        if len(self.noises()) != 1:
            raise InputError("needs its noise; give one of netd_mK, sigma")


@dataclass(frozen=True)
class Entry:
    """Entry of [unknowns] or [nuisance].

    Attributes
    ----------
    start : float, optional
        First guess; by default the scene's value.
    lower, upper : float, optional
        Bounds; by default those of the model.
    prior : tuple of float, optional
        Mean and standard deviation that are known beforehand.
    per : tuple of str, optional
        What has a value of its own: "band", "state", "data"; [] for one value in all data. By
        default temperatures have one for each state, materials and emissivities one for each band,
        and radiances one for each band and state.
    """

    start: float | None = None
    lower: float | None = None
    upper: float | None = None
    prior: tuple[float, ...] | None = None
    per: tuple[str, ...] | None = None

    def __post_init__(self):
        check_prior(self.prior, "prior")
        for word in self.per or ():
            if word not in PER:
                raise unknown("word of per", word, PER)
        if None not in (self.lower, self.upper) and not self.lower < self.upper:
            raise InputError(f"lower = {self.lower:g} is not below upper = {self.upper:g}")


@dataclass(frozen=True)
class Goal:
    """Table [goal]: what the unknowns are to achieve, in place of measurements.

    Attributes
    ----------
    quantity : str
        "intensity" of the target [W/sr], or "contrast" [W/sr]: the intensity less that of the
        background which the target hides.
    scene : str
        Bundled scene or Mitsuba XML file.
    parameters : dict
        The scene's $-parameters.
    value : float
        Wanted value.
    at_most : bool
        Whether smaller magnitudes than `value` satisfy too.
    background_K : float, optional
        Apparent temperature of the background, for a contrast.
    azimuth_deg, elevation_deg : tuple of float
        Aspects over which the rms deviation from the value is made small: all pairs.
    starts : int
        Number of first guesses: the scene's values, and random ones within the bounds.
    """

    quantity: str
    scene: str
    parameters: dict = field(default_factory=dict)
    value: float = 0.0
    at_most: bool = False
    background_K: float | None = None
    azimuth_deg: tuple[float, ...] = (0.0,)
    elevation_deg: tuple[float, ...] = (0.0,)
    starts: int = 1

    def __post_init__(self):
        if not 1 <= self.starts <= 100:
            raise InputError(f"starts = {self.starts}; must lie in 1..100")
        if self.quantity not in NUMBERS:
            raise unknown("quantity", self.quantity, NUMBERS)
        if (self.background_K is not None) != (self.quantity == "contrast"):
            raise InputError("background_K goes with quantity = 'contrast', and is needed there")
        if self.background_K is not None and not self.background_K > 0:
            raise InputError(f"background_K = {self.background_K:g}; must be positive")
        if self.at_most and not self.value > 0:
            raise InputError(f"value = {self.value:g}; must be positive with at_most")

    @property
    def aspects(self) -> tuple[tuple[float, float], ...]:
        """All pairs of azimuth and elevation, degrees."""
        return tuple((a, e) for e in self.elevation_deg for a in self.azimuth_deg)


@dataclass(frozen=True)
class Sampling:
    """Table [render].

    Attributes
    ----------
    spp : int, optional
        Samples per pixel (those of the scene). For the aspects of a trend or a goal, the number of
        paths divided by 64 x 64 (16).
    seed : int
        Seed of the random numbers.
    randomisations : int
        Independent renders whose products are unbiased.
    iterations : int
        Largest number of renders of each image.
    """

    spp: int | None = None
    seed: int = 0
    randomisations: int = 4
    iterations: int = 20

    def __post_init__(self):
        for key, least, most in (
            ("spp", 2, 2**31),
            ("seed", 0, 2**32 - 1),
            ("randomisations", 2, 64),
            ("iterations", 1, 1000),
        ):
            value = getattr(self, key)
            if value is not None and not least <= value <= most:
                raise InputError(f"{key} = {value}; must lie in {least}..{most}")


@dataclass(frozen=True)
class Problem:
    """An inverse problem.

    name: name of its file. title: first comment of the file. data, unknowns, nuisance, candidates,
    goal, render: its tables. nuisance: parameters that are uncertain but not sought.
    """

    name: str
    title: str
    data: tuple[Measurement, ...]
    unknowns: dict[str, Entry]
    nuisance: dict[str, Entry] = field(default_factory=dict)
    candidates: tuple[Candidate, ...] = ()
    goal: Goal | None = None
    render: Sampling = field(default_factory=Sampling)

    @staticmethod
    def read(source) -> "Problem":
        """Read a problem from a TOML file, with paths relative to its folder.

        Raises InputError if the file cannot be used.
        """
        path = Path(source)
        text = read_text(path, f"problem '{source}'")
        try:
            tree = tomllib.loads(text)
        except (ValueError, RecursionError) as error:
            raise InputError(f"problem '{source}': {error}") from None
        return Problem.of(tree, path.parent, str(source), scenes.first_comment(text))

    @staticmethod
    def of(tree: dict, folder=".", name: str = "problem", title: str = "") -> "Problem":
        """The problem that a tree of tables, as in the file, describes.

        folder: folder to which paths are relative. Raises InputError if an entry cannot be used.
        """
        try:
            for table in tree:
                if table not in TABLES:
                    raise unknown("table", table, TABLES)
            data = rows(tree, "data", Measurement, Path(folder))
            candidates = rows(tree, "candidates", Candidate, Path(folder))
            goal = tree.get("goal")
            goal = None if goal is None else filled(Goal, located(goal, folder), "[goal]")
            problem = Problem(
                name=name,
                title=title,
                data=data,
                unknowns=entries(tree, "unknowns"),
                nuisance=entries(tree, "nuisance"),
                candidates=candidates,
                goal=goal,
                render=of_table(Sampling, tree.get("render", {}), "[render]"),
            )
            problem.check()
        except InputError as error:
            raise InputError(f"problem '{name}': {error}") from None
        return problem

    def check(self) -> None:
        """Raise InputError for tables that do not go together."""
        if bool(self.data) == (self.goal is not None):
            raise InputError(
                "has [[data]] beside [goal]; give one of them"
                if self.data
                else "no [[data]]: add a measurement, or a [goal]"
            )
        if not self.unknowns:
            raise InputError("no [unknowns]: name at least one parameter of the scene")
        if twice := self.unknowns.keys() & self.nuisance.keys():
            raise InputError(f"'{min(twice)}' is in [unknowns] and in [nuisance]; keep one")
        names = [place.name for place in (*self.data, *self.candidates)]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(f"two data or candidates have the name '{twice}'; rename one")


def check_prior(prior, key: str) -> None:
    """Raise InputError unless a prior is None or a mean and a positive standard deviation."""
    if prior is None:
        return
    if len(prior) != 2:
        raise InputError(f"{key} = {list(prior)}; must be [mean, sigma]")
    if not prior[1] > 0:
        raise InputError(
            f"{key} = {list(prior)}: sigma is {prior[1]:g}; must be positive. Set a parameter that "
            "is known exactly in the scene instead"
        )


def rows(tree: dict, table: str, kind, folder: Path) -> tuple:
    """The entries of an array of tables as dataclasses, each with a name."""
    values = tree.get(table, [])
    if not isinstance(values, list):
        raise InputError(f"[{table}] must be written [[{table}]], once for each measurement")
    result = []
    for number, value in enumerate(values, 1):
        where = f"[[{table}]] {number}"
        if not isinstance(value, dict):
            raise InputError(f"{where}: must be a table")
        default = {"name": f"{'data' if table == 'data' else 'candidate'} {number}"}
        result.append(of_table(kind, default | located(value, folder), where))
    return tuple(result)


def of_table(kind, values, where: str):
    """The dataclass of a table, with `where` in front of all messages."""
    try:
        return filled(kind, values, where)
    except InputError as error:
        text = str(error)
        raise InputError(text if where in text else f"{where}: {text}") from None


def entries(tree: dict, table: str) -> dict[str, Entry]:
    """The entries of [unknowns] or [nuisance] by name."""
    values = tree.get(table, {})
    if not isinstance(values, dict):
        raise InputError(f"[{table}] must be a table")
    result = {}
    for name, value in values.items():
        where = f"[{table}] '{name}'"
        if not isinstance(value, dict):
            raise InputError(f"{where} = {value!r}; must be a table, such as {{start = 300}}")
        if value and all(isinstance(inner, dict) for inner in value.values()):
            raise InputError(
                f"{where}: write the whole name in quotes, such as "
                f'"{name}.{next(iter(value))}" = {{}}'
            )
        if not LABELLED.fullmatch(name):
            raise InputError(f'{where}: must be a name, such as "lid.temperature" or "... [hot]"')
        result[name] = of_table(Entry, value, where)
    return result


def located(table, folder) -> dict:
    """A table whose paths are relative to the working directory instead of `folder`.

    An entry without a suffix that is not a file stays as it is: it is a bundled name.
    """
    if not isinstance(table, dict):
        return table
    located_at = lambda value: str(Path(folder) / value)
    is_file = lambda value: isinstance(value, str) and os.path.isfile(located_at(value))
    result = dict(table)
    for key in FILES:
        value = table.get(key)
        if isinstance(value, str) and (Path(value).suffix or is_file(value)):
            result[key] = located_at(value)
    if isinstance(table.get("parameters"), dict):
        result["parameters"] = {
            key: located_at(value) if is_file(value) else value
            for key, value in table["parameters"].items()
        }
    return result


def parts(name: str) -> tuple[str, tuple[str, ...]]:
    """Name and bracketed labels of an unknown, such as "lid.epsilon [LWIR]"."""
    match = LABELLED.fullmatch(name)
    of = tuple(word.strip() for word in (match["of"] or "").split(",") if word.strip())
    return match["name"], of
