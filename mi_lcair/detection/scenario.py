"""Scenario: a target, its observer, the atmosphere, the background and the sensor.

A scenario is read from a TOML file and checked. Each table of the file is a dataclass here.
"""

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from mi_lcair import scenes
from mi_lcair.declared import (
    Described,
    Rule,
    entry,
    excludes,
    fraction,
    given,
    needs,
    one_of,
    required,
    rule,
    texts,
    together,
)
from mi_lcair.detection.flight_path import FlightTable, Moments
from mi_lcair.errors import InputError, errors_of
from mi_lcair.files import parse_toml, read_text
from mi_lcair.physics.air.atmosphere import VACUUM
from mi_lcair.physics.air.levels import Weather
from mi_lcair.physics.atmosphere import clear_air_name
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.imager import LOCK_ON, Detector, Imager, with_preset
from mi_lcair.physics.materials import hemispherical_emissivity
from mi_lcair.physics.sky import clear_name, has_azimuths
from mi_lcair.physics.surroundings import HOTTEST_K, Words, sky_name
from mi_lcair.progress import Progress
from mi_lcair.rendering.motions.table import MOTIONS, Declared, motions_of
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.toml_table import check_tables, filled, located, located_files, plain

if TYPE_CHECKING:
    from mi_lcair.rendering.views import View

STATED = "a scenario is a TOML file that names a scene, its observer and the sensor"

WEATHER = tuple(entry.name for entry in fields(Weather))
POLAR = ("range_m", "azimuth_deg", "elevation_deg")
HIGHEST_M = 100_000.0  # largest height of a sensor, above all air
KELVIN = {"is_positive": True, "upper": HOTTEST_K, "unit": "K"}
DEFAULT_SPP = 64  # samples per pixel without a tolerance
# Entries that spp cannot be combined with
TO_A_TOLERANCE = ("tolerance", "tolerance_W_m2", "to_noise", "max_spp")


# Tables that a scenario may lack, and that have no defaults then
OPTIONAL = {"camera", "surroundings", "background", "flight"}
OF_SCENE = "target.parameters."  # beginning of the keys of a scene's parameters


def stated_elsewhere(target: "TargetModel") -> str | None:
    for name, table in {"band": "[sensor]", **dict.fromkeys(POSE, "[pose]")}.items():
        if name in target.parameters:
            return f"{name} is given in {table}"
    return None


@dataclass(frozen=True)
class TargetModel(Described, where="[target]", rules=(Rule(stated_elsewhere),)):
    """Table [target].

    Attributes
    ----------
    scene : str
        Name of a bundled scene, or path of a Mitsuba XML file.
    parameters : dict
        The scene's $-parameters.
    solution : str, optional
        File of an inversion's solution, FILE.json or FILE.json:STATE. The scene gets its
        temperatures, materials and radiances.
    height_m : float, optional
        Height of the target above the ground, m, in place of the observer's.
    """

    scene: str = entry(is_file=True)
    parameters: dict = entry(dict, is_file=True)
    solution: str | None = entry(None, is_file=True)
    height_m: float | None = entry(None, lower=0, upper=HIGHEST_M)


@dataclass(frozen=True)
class PluginFiles(Described):
    """Table [plugins].

    Attributes
    ----------
    files : tuple of str
        Python files that register BSDFs or emitters with Mitsuba. They run if you allow it, see
        `mi_lcair.trust`.
    """

    files: tuple[str, ...] = entry((), is_file=True)


@dataclass(frozen=True)
class Pose(Described):
    """Table [pose]: rotation of the target.

    Attributes
    ----------
    yaw_deg, pitch_deg, roll_deg : float, optional
        Value of the scene's parameter of the same name, degrees.
    """

    yaw_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None


POSE = tuple(entry.name for entry in fields(Pose))


PLACE = (
    excludes("position_m", *POLAR, why="give one of them"),
    together(*POLAR, unless="position_m = [x, y, z]"),
)


@dataclass(frozen=True)
class Observer(Described, where="[observer]", rules=PLACE):
    """Table [observer]: position of the sensor relative to the target, in the scene's axes.

    Attributes
    ----------
    range_m : float
        Distance from the target, m.
    azimuth_deg : float
        Azimuth from +x toward +y, degrees. +x is the nose and +y the left side of a target that
        [pose] does not turn.
    elevation_deg : float
        Elevation above the x-y plane, degrees.
    position_m : tuple of float, optional
        x, y and z, m, instead of range, azimuth and elevation, which are derived from it.
    height_m : float, optional
        Height of the sensor above the ground, m. Without it, and without that of the target, the
        lower one of the two is 50 m above the ground.
    """

    range_m: float | None = entry(None, is_positive=True)
    azimuth_deg: float | None = None
    elevation_deg: float | None = entry(None, lower=-90, upper=90)
    position_m: tuple[float, float, float] | None = None
    height_m: float | None = entry(None, lower=0, upper=HIGHEST_M)

    def complete(self) -> None:
        if self.position_m is not None:
            x, y, z = self.position_m
            level = np.hypot(x, y)
            angles = np.degrees([np.arctan2(y, x), np.arctan2(z, level)])
            values = np.hypot(level, z), *angles
            self.derive(**dict(zip(POLAR, map(float, values))))

    @property
    def view(self) -> "View":
        """Direction from the target to the sensor, a `View`."""
        from mi_lcair.rendering.views import View  # loads the renderer, which reading needs not

        return View(self.azimuth_deg, self.elevation_deg)


def weather_of_its_own(air: "Air") -> str | None:
    stated = given(air, WEATHER)
    if stated and clear_air_name(air.table) is None:
        return (
            f"{stated[0]} is weather of a clear air, but table = '{air.table}' has its own; choose "
            "us_standard or midlat_summer"
        )
    return None


OF_AIR = (
    rule(
        lambda t: not t.cn2 or t.table != VACUUM, "cn2 is turbulence of air; leave it out in vacuum"
    ),
    Rule(weather_of_its_own),
)


@dataclass(frozen=True, kw_only=True)
class Air(Weather, rules=OF_AIR):
    """Table [atmosphere], with the weather of a clear air.

    Attributes
    ----------
    table : str
        Name of a clear air, CSV, MODTRAN tape7 or "vacuum", as `physics.atmosphere.atmosphere`
        takes it.
    extrapolate : bool
        Whether ranges beyond a table are allowed.
    ranges_m : tuple of float, optional
        Ranges, m, of the blocks of a tape7 that does not contain them.
    air_temperature : float, optional
        Temperature, K, of the air of a tape7 that contains only transmittances (IEMSCT 0). The path
        radiance is that of a blackbody, times 1 - transmittance.
    cn2 : float
        Turbulence that blurs a camera's image, uniform along the path: structure parameter of the
        refractive index, m^(-2/3). 0 means no turbulence.
    wave : str
        "plane" wave, or "spherical" wave from points of the target, which has 3/8 of the effect.
    """

    table: str = entry(is_file=True)
    extrapolate: bool = False
    ranges_m: tuple[float, ...] | None = None
    air_temperature: float | None = entry(None, lower=150, upper=350, unit="K")
    cn2: float = entry(0.0, lower=0, upper=1e-9, unit="m^(-2/3)")
    wave: Literal["plane", "spherical"] = "plane"

    @property
    def weather(self) -> Weather:
        """The weather of a clear air."""
        return Weather(**{name: getattr(self, name) for name in WEATHER})


BEHIND = (
    one_of("sky", "daytime_sky", is_needed=False),
    excludes("temperature", "sky", "daytime_sky", "ground_temperature", "ground_emissivity"),
    rule(
        lambda t: given(t, ("temperature", "sky", "daytime_sky", "ground_temperature")),
        "sky and temperature are missing; give one of them",
    ),
    rule(
        lambda t: t.ground_emissivity == 1 or t.ground_temperature and (t.sky or t.daytime_sky),
        "ground_emissivity needs ground_temperature and sky: ground that is not black reflects it",
    ),
)


@dataclass(frozen=True)
class Background(Described, where="[background]", rules=BEHIND):
    """Table [background]: what the sensor sees beside the target.

    It is a blackbody, or what the line of sight meets: the sky upward and the ground downward.

    Attributes
    ----------
    sky : str, optional
        Sky table. A table with azimuths from the sun is a sky by day.
    daytime_sky : str, optional
        Name of a clear air. The sky is its sky with scattered sunlight. The ground then reflects
        the sun, too.
    sun_azimuth_deg : float, optional
        Azimuth of that sun in the scene's axes, from +x toward +y, degrees. By default it is that
        of the scene's emitter `sun`, or 0 if it has none.
    sun_elevation_deg : float, optional
        Elevation of that sun, degrees. By default it is that of the scene's emitter `sun`, or 45.
    temperature : float, optional
        Apparent temperature of a blackbody, K, instead of sky and ground.
    sun_file : str, optional
        CSV file wavelength_um,irradiance_W_m2_um of the sun that the ground reflects. By default it
        is the sun of the clear air.
    ground_temperature : float, optional
        Temperature of the ground, K. Its radiance crosses the air to the sensor.
    ground_emissivity : float
        Emissivity of the ground. It reflects the sky diffusely if this is below 1.
    """

    sky: str | None = entry(None, is_file=True)
    daytime_sky: str | None = None
    sun_azimuth_deg: float | None = None
    sun_elevation_deg: float | None = entry(None, lower=1, upper=90)
    sun_file: str | None = entry(None, is_file=True)
    temperature: float | None = entry(None, **KELVIN)
    ground_temperature: float | None = entry(None, **KELVIN)
    ground_emissivity: float = entry(1.0, is_positive=True, upper=1)

    @property
    def by_day(self) -> bool:
        """Whether its sky is one by day, which needs a sun."""
        return self.daytime_sky is not None or (self.sky is not None and has_azimuths(self.sky))

    def with_sun(self, azimuth_deg: float, elevation_deg: float) -> "Background":
        """The background with the sun at a place [degrees], if it states no other."""
        azimuth, elevation = self.sun_azimuth_deg, self.sun_elevation_deg
        return replace(
            self,
            sun_azimuth_deg=azimuth_deg if azimuth is None else azimuth,
            sun_elevation_deg=elevation_deg if elevation is None else elevation,
        )


@dataclass(frozen=True)
class Sensor(Described, where="[sensor]"):
    """Table [sensor].

    Attributes
    ----------
    band : str
        Band in which the scene is rendered.
    response : str, optional
        CSV with the response of the detector, within the band. By default the response of `band` is
        used.
    optics_transmittance : float
        Transmittance of the optics, in (0, 1].
    field_of_view_deg : float, optional
        Full angle of the conical field of view, in (0, 180] degrees; by default it is not limited.
    nei : float, optional
        Noise-equivalent irradiance behind the optics, W m^-2.
    snr : float
        Signal-to-noise ratio that a detection needs.
    """

    band: str
    response: str | None = entry(None, is_file=True)
    optics_transmittance: float = 1.0
    field_of_view_deg: float | None = None
    nei: float | None = None
    snr: float = LOCK_ON

    def complete(self) -> None:
        rendered = band_of(self.band)
        rendered.check_limits("[sensor]")
        if rendered.response is not None:
            raise InputError(
                f"band = '{self.band}' is a response; give it as response, and give a name or "
                "limits that contain it as band"
            )
        detector = self.detector().band
        if not rendered.holds(detector):
            raise InputError(
                f"response {detector.label} is not within band {rendered.label}; choose a band "
                "that contains it"
            )

    def detector(self) -> Detector:
        """The detector of the sensor."""
        return Detector(
            band_of(Path(self.response) if self.response else self.band),
            self.optics_transmittance,
            self.field_of_view_deg,
            self.nei,
            self.snr,
        )


SAMPLES = (
    excludes(
        "spp",
        *TO_A_TOLERANCE,
        why="spp is a fixed number of samples, a tolerance chooses one",
    ),
    needs("max_spp", "tolerance", "tolerance_W_m2", "to_noise", any_of=True),
)


@dataclass(frozen=True)
class RenderTable(Described, where="[render]", rules=SAMPLES):
    """Table [render].

    Attributes
    ----------
    max_bounces : tuple of int or "auto"
        Numbers of reflections. All of them use the same paths. If it is empty, the scene's own
        number is used. "auto" chooses one number from a short test run, so that at most a tenth of
        the tolerance, or of 1 %, is left out of the target's intensity. The errors include this
        part.
    lobe : str, optional
        Reflection models to use: "brdf" (full), "mirror" or "diffuse"; by default as in the scene.
    resolution : int
        `spp` and `max_spp` count the paths of a render divided by resolution x resolution. The
        paths begin anywhere in a window around the target, not in one pixel each.
    spp : int or None
        Samples per pixel (64). Leave it out with a tolerance.
    tolerance : float, str or None
        Allowed half of the 95 % interval of each contrast, as a fraction of its magnitude, such as
        0.02 or "2%".
    tolerance_W_m2 : float or None
        Allowed half of the 95 % interval of each contrast, W m^-2. With both tolerances, a render
        ends when one of them is reached.
    to_noise : bool
        Whether the camera's noise sets the number of samples, in place of a tolerance: the error of
        the rendering is then below the noise in 99.9 % of the frame.
    max_spp : int or None
        Largest number of samples per pixel with a tolerance (65536).
    seed : int
        Seed of the random numbers.
    """

    max_bounces: tuple[int, ...] | Literal["auto"] = entry((), lower=0, upper=10_000)
    lobe: str | None = None
    resolution: int = entry(256, lower=1)
    spp: int | None = entry(None, lower=2, upper=2**31)
    tolerance: float | str | None = None
    tolerance_W_m2: float | None = entry(None, is_positive=True)
    to_noise: bool = False
    max_spp: int | None = entry(None, lower=2, upper=2**31)
    seed: int = entry(0, lower=0, upper=2**32 - 1)

    def complete(self) -> None:
        if not given(self, ("spp", *TO_A_TOLERANCE)):
            self.derive(spp=DEFAULT_SPP)
        if self.tolerance is not None:
            with errors_of("tolerance"):
                self.derive(tolerance=fraction(str(self.tolerance)))

    @property
    def most_bounces(self) -> int | str | None:
        """The largest number of reflections, or "auto"; None: the scene's own number."""
        is_word = isinstance(self.max_bounces, str)
        return self.max_bounces if is_word else max(self.max_bounces, default=None)

    @property
    def has_tolerance(self) -> bool:
        """Whether the number of samples follows from a tolerance."""
        return self.spp is None

    def of_render(self) -> Sampling:
        """The sampling of one render, whose criterion is made from the tolerances.

        Raises InputError if the number of samples is left to a camera's noise.
        """
        if (self.spp, self.tolerance, self.tolerance_W_m2) == (None, None, None):
            raise InputError(
                "[render]: to_noise chooses the samples of a camera's image only; give spp, "
                "tolerance or tolerance_W_m2"
            )
        return Sampling(spp=self.spp, max_spp=self.max_spp, seed=self.seed)

    def of_image(self, progress: Progress | None = None) -> Sampling:
        """The sampling of a camera's image, for which only a relative tolerance counts.

        It has neither samples nor a tolerance if the camera's noise decides.
        """
        if self.to_noise:
            return Sampling(max_spp=self.max_spp, seed=self.seed, progress=progress)
        if self.tolerance is None:
            return Sampling(spp=self.spp or DEFAULT_SPP, seed=self.seed, progress=progress)
        return Sampling(
            tolerance=self.tolerance, max_spp=self.max_spp, seed=self.seed, progress=progress
        )

    def allowed(self, contrast: float) -> float:
        """Allowed half width, W m^-2, of the 95 % interval of a contrast; 0 without a tolerance."""
        return max((self.tolerance or 0) * abs(contrast), self.tolerance_W_m2 or 0)


@dataclass(frozen=True)
class Scenario:
    """A scenario: its tables, its name, and its title, which is the first comment of the file.

    `motions` are those of the target that the table [motions] declares.

    `camera` is None without a table [camera], which only images need. With a table [flight] the
    scenario is that of the flight's first moment.
    """

    name: str
    title: str
    target: TargetModel
    observer: Observer
    atmosphere: Air
    background: Background
    sensor: Sensor
    pose: Pose = field(default_factory=Pose)
    render: RenderTable = field(default_factory=RenderTable)
    camera: Imager | None = None
    surroundings: Words | None = None
    flight: FlightTable | None = None
    plugins: PluginFiles = field(default_factory=PluginFiles)
    motions: dict[str, Declared] = field(default_factory=dict)

    @property
    def heading(self) -> str:
        """Name and title, or the name alone where the file begins without a comment."""
        return f"{self.name}: {self.title}" if self.title else self.name

    @staticmethod
    def read(source: str | PathLike[str], **changes: object) -> "Scenario":
        """Read a scenario from a TOML file.

        Parameters
        ----------
        source : str or path-like
            File, or name of a bundled scenario (see `scenes.scenarios`). Paths in the file are
            relative to its folder.
        **changes
            Values by dotted key, such as "sensor.band". Text that is a TOML value is converted.
            Paths are relative to the working directory.

        Returns
        -------
        Scenario

        Raises
        ------
        InputError
            If the file or a change cannot be used.
        """
        path, name, title, tree = tables_of(source, changes)
        with errors_of(f"scenario '{source}'"):
            check_tables([*TABLES, MOTIONS], tree)
            words = tree.get("surroundings")
            if isinstance(words, dict):
                tree["surroundings"] = dict(map(worded, *zip(*words.items())))
                air = tree.get("atmosphere")
                air = clear_air_name(air.get("table")) if isinstance(air, dict) else None
                if air is not None:  # clear air of the path is that of sky, sun and ground, too
                    tree["surroundings"].setdefault("atmosphere", air)
            if "camera" in tree:
                tree["camera"] = with_preset(tree["camera"])
            motions = motions_of(tree.get(MOTIONS, {}), path.parent)
            check_moves(tree)
            lacking = OPTIONAL | ({"observer"} if "flight" in tree else set())
            parts = {
                table: filled(kind, tree.get(table, {}), f"[{table}]")
                for table, kind in TABLES.items()
                if table in tree or table not in lacking
            }
            parts["background"] = background_of(tree, parts)
            if "flight" in parts:
                parts |= placed(parts["target"], parts["flight"].moments(), 0)
        return Scenario(name, title, **parts, motions=motions)

    def at_moment(self, moments: Moments, number: int) -> "Scenario":
        """The scenario at one moment of a flight."""
        return replace(self, **placed(self.target, moments, number))

    def with_motions(self, motions: Mapping[str, Declared]) -> "Scenario":
        """The scenario with further motions of its target."""
        return replace(self, motions=self.motions | dict(motions))

    def check_scene(self) -> None:
        """Raise InputError if there is no such scene; unlike loading, this imports no renderer."""
        with errors_of(f"scenario '{self.name}': [target]"):
            scenes.file_of(self.target.scene)

    def scene_parameters(self) -> dict[str, str]:
        """The scene's $-parameters as text, without the band."""
        pose = {name: value for name, value in asdict(self.pose).items() if value is not None}
        return texts("[target.parameters]", self.target.parameters | pose)


TABLES = {
    table.name: kind
    for table in fields(Scenario)
    if isinstance(kind := required(table.type), type) and issubclass(kind, Described)
}


def tables_of(source: str | PathLike[str], changes: Mapping[str, object]) -> tuple:
    """File, name, title and tables of a scenario, whose paths are resolved, with the changes.

    Arguments and errors are those of `Scenario.read`. The tables are not checked.
    """
    if not isinstance(source, (str, PathLike)):
        raise InputError(f"{type(source).__name__} is no scenario; {STATED}")
    path, name = Path(source), Path(source).stem
    if path.suffix.lower() in (".xml", *scenes.MODELS) or str(source) in scenes.names():
        kind = "model" if path.suffix.lower() in scenes.MODELS else "scene"
        raise InputError(f"'{source}' is a {kind} and no scenario; {STATED}")
    if not path.suffix and not os.path.isfile(path):
        path, name = scenes.scenario_path(str(source)), str(source)
    text = read_text(path, f"scenario '{source}'")
    tree = parse_toml(text, f"scenario '{source}'")
    with errors_of(f"scenario '{source}'"):
        tree = {table: in_folder(table, part, path.parent) for table, part in tree.items()}
        for key, value in changes.items():
            # The name of a parameter may have a dot of its own
            change(tree, key.split(".", 2 if key.startswith(OF_SCENE) else -1), plain(value))
    return path, name, scenes.first_comment(text), tree


def check_moves(tree: dict) -> None:
    """Raise InputError if a scenario with a flight states what the path of the flight has."""
    if "flight" not in tree:
        return
    for table in ("observer", "pose"):
        if table in tree:
            raise InputError(f"[flight] and [{table}]: give one of them; the path has both")
    if isinstance(tree.get("target"), dict) and "height_m" in tree["target"]:
        raise InputError("[target]: height_m is that of the path of [flight]; leave it out")


def placed(target: TargetModel, moments: Moments, number: int) -> dict:
    """Target, observer and pose of a scenario at one moment of a flight.

    Angles that are 0 all the time are no parameters of the scene.
    """
    height_m = float(moments.position_m[number, 2] - moments.ground_m)
    turned = np.any(moments.attitude_deg, axis=0)
    pose = zip(POSE, moments.attitude_deg[number], turned)
    return {
        "target": replace(target, height_m=height_m),
        "observer": Observer(position_m=tuple(map(float, moments.to_observer_m[number]))),
        "pose": Pose(**{name: float(angle) for name, angle, is_turned in pose if is_turned}),
    }


def worded(key: str, value) -> tuple[str, object]:
    """An entry of [surroundings] with its numbers as text, "288,0.95" for 288 or [288, 0.95]."""
    values = value if isinstance(value, list) else [value]
    if all(type(item) in (int, float, str) for item in values):
        value = ",".join(f"{item}" for item in values)
    return key, value


def background_of(tree: dict, parts: dict) -> Background:
    """The background of a scenario's tables: [background], or what the surroundings have there."""
    words = parts.get("surroundings")
    if words is None:
        return parts.get("background") or filled(Background, {}, "[background]")
    if "background" in tree:
        raise InputError(
            "[surroundings] and [background]: give one of them; what surrounds the target is also "
            "behind it"
        )
    given = {}
    if words.sky is not None:
        name = words.atmosphere if words.sky == "clear" else clear_name(words.sky)
        given = {"sky": sky_name(words.sky, words.atmosphere)}
        if words.sun is not None:
            elevation, azimuth = words.sun_parts
            given = given if name is None else {"daytime_sky": name}
            given |= {"sun_azimuth_deg": azimuth, "sun_elevation_deg": elevation}
    given |= {} if words.sun_file is None else {"sun_file": words.sun_file}
    if words.ground is not None:
        temperature, material = words.ground_parts
        emissivity = hemispherical_emissivity(material, band_of(parts["sensor"].band))
        given |= {"ground_temperature": temperature}
        given |= {"ground_emissivity": emissivity if words.sky is not None else 1.0}
    return Background(**given)


def in_folder(table: str, part, folder: Path):
    """A table whose paths, relative to a folder, are relative to the working folder."""
    if table in TABLES:
        part = located_files(TABLES[table], part, folder)
    sun = part.get("sun") if table == "surroundings" and isinstance(part, dict) else None
    if isinstance(sun, str) and sun.count(",") > 1:  # its file follows its direction
        *front, file = sun.split(",", 2)
        part["sun"] = ",".join([*front, located(folder, file)])
    return part


def change(tree: dict, keys: list[str], value) -> None:
    """Set one value of a scenario's tree, and remove the entries that it replaces.

    The value None removes the entry.
    """
    *tables, key = keys
    if not tables:
        raise InputError(f"{key} is no entry; name TABLE.KEY, such as sensor.band")
    if tables == ["surroundings"]:
        tree.pop("background", None)
    for table in tables:
        tree = tree.setdefault(table, {})
        if not isinstance(tree, dict):
            raise InputError(f"{'.'.join(keys)}: '{table}' is not a table")
    if len(tables) == 1 and tables[0] in TABLES:
        for replaced in TABLES[tables[0]].replaced(key):
            tree.pop(replaced, None)
    tree[key] = parsed(value) if isinstance(value, str) else value
    if value is None:
        del tree[key]


def parsed(text: str):
    """The TOML value that a text denotes, or the text itself."""
    try:
        return parse_toml(f"value = {text}", "value")["value"]
    except InputError:
        return text
