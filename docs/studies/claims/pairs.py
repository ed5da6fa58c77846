"""Pairs of scenes that must agree, whatever their answer is (metamorphic claims).

Both scenes of a pair are traced with random numbers of their own. The claim is that they differ by
no more than twice their combined half intervals, about four standard errors.
"""

import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from copy import copy
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.claims import further_claims, planck, scenario_claims
from docs.studies.claims.case import Case, Draw
from docs.studies.claims.scene_file import NAMED, PIXELS, Place
from docs.studies.claims.scenes import case as drawn_case
from docs.studies.claims.witness import Claim, Witness
from mi_lcair.errors import InputError

SPP = 256
COMBINED = 2.0  # allowed difference in combined half intervals
SCALE, SHIFT = 7.3, 2.0  # of lengths, and in sizes of the scene
SOME = 4  # partners of each case, so that many cases can be tried
ONE_K = 400.0  # temperature of everything [K]
TEMPERATURE = re.compile(r'(name="temperature" value=")[^"]*')
DOUBTS = ("single precision", "left to rounding")  # in remarks that withdraw all claims


class Unpaired(Exception):
    """The case has no such pair."""


class Moved(Draw):
    """The choices of a `Draw`, at another place."""

    def __init__(self, rng, change: Callable[[Place], Place]):
        super().__init__(rng)
        self.change = change

    def place(self, farthest: float = 10.0) -> Place:
        return self.change(super().place(farthest))


class Pairs:
    """The pairs of a case, and the mean radiance of each partner with half its 95 % interval."""

    def __init__(self, seed: int, number: int, folder: Path):
        self.seed, self.number, self.folder = seed, number, folder
        self.case, self.rng = drawn_case(seed, number), np.random.default_rng([seed, number, 3])

    def as_drawn(self) -> Path:
        """The scene file of the case."""
        case = self.case
        return case.file.write(self.folder, case.band, case.bounces, case.sampling)

    def mean(self, case: Case, **changed) -> tuple[float, float]:
        """Mean radiance of a case in its window, written with other arguments."""
        how = {"band": case.band, "bounces": case.bounces, "sampling": case.sampling} | changed
        return self.of_file(case.file.write(self.folder, **how), case.area)

    def of_file(self, path: Path, area: float) -> tuple[float, float]:
        scene = mi_lcair.load(path)
        if any(doubt in remark for remark in scene.remarks for doubt in DOUBTS):
            raise Unpaired
        target = mi_lcair.signature(scene, spp=SPP, seed=int(self.rng.integers(10**6))).target
        return target.intensity / area, target.half_width / area

    def at(self, change: Callable[[Place], Place]) -> tuple[float, float]:
        """That of the case at another place."""
        return self.mean(drawn_case(self.seed, self.number, partial(Moved, change=change)))

    # ------------------------------------------------------------------ Partners

    def turned(self):
        q, _ = np.linalg.qr(self.rng.normal(size=(3, 3)))
        q *= np.sign(np.linalg.det(q))
        return self.at(lambda p: Place(p.scale, q @ p.rotation, q @ p.shift))

    def mirrored(self):
        flip = np.diag([1.0, -1.0, 1.0])
        return self.at(lambda p: Place(p.scale, flip @ p.rotation, flip @ p.shift))

    def scaled(self):
        return self.at(lambda p: Place(SCALE * p.scale, p.rotation, SCALE * p.shift))

    def moved(self):
        return self.at(lambda p: Place(p.scale, p.rotation, p.shift + SHIFT * p.scale))

    def divided(self):
        return self.at(lambda p: replace(p, halves=True))

    def in_another_order(self):
        """Shapes are listed from the last to the first."""
        file = copy(self.case.file)
        is_shape = [part.lstrip().startswith("<shape") for part in file.parts]
        last = (part for part, one in zip(file.parts[::-1], is_shape[::-1]) if one)
        file.parts = [next(last) if one else part for part, one in zip(file.parts, is_shape)]
        return self.mean(replace(self.case, file=file))

    def without_emitter_sampling(self):
        return self.mean(self.case, sampling="false" if self.case.sampling != "false" else "true")

    def aimed(self):
        """To a tolerance, for which paths begin where the model is."""
        target = mi_lcair.signature(
            self.as_drawn(), tolerance=0.01, max_spp=4 * SPP, seed=self.seed
        ).target
        return target.intensity / self.case.area, target.half_width / self.case.area

    def sum_of_two_bands(self):
        lower, upper = planck.BANDS_UM[self.case.band]
        if np.isinf(upper) or 'type="area"' in "".join(self.case.file.parts):
            raise Unpaired  # a source with a number for the whole band
        middle = lower + (upper - lower) * self.rng.uniform(0.2, 0.8)
        bands = (f"{lower!r}-{middle:.4f}", f"{middle:.4f}-{upper!r}")
        return tuple(map(sum, zip(*(self.mean(self.case, band=band) for band in bands))))

    def constant_spectrum(self):
        return self.of_file(self.with_constant_spectra()[1], self.case.area)

    def with_constant_spectra(self) -> tuple[Path, Path]:
        """The scene file, and the same with spectra in place of reflectances."""
        case = self.case
        if not case.materials or case.band == "total":
            raise Unpaired
        lower, upper = planck.BANDS_UM[case.band]
        spectra = {name: [(0.9 * lower, x), (upper + 1, x)] for name, x in case.materials.items()}
        path = self.as_drawn()
        return path, further_claims.with_spectra(case, path, spectra)

    # ------------------------------------------------------------------ Pairs

    def all(self) -> Iterator[tuple[str, tuple[float, float], tuple[float, float]]]:
        """Yield the name, and the values of both, of some partners and of all other pairs."""
        first = self.mean(self.case)
        for name in (*self.rng.choice(PARTNERS, SOME, replace=False), *OTHERS):
            with suppress(Unpaired, InputError):
                found = getattr(self, name.replace(" ", "_"))()
                yield name, *((first, found) if name in PARTNERS else found)

    def constant_spectrum_in_air(self):
        """Contrasts of a body between clear sky and ground, through 4 km of air."""
        if not self.case.kind.endswith("void"):
            raise Unpaired
        return [self.contrast(*self.in_air(scene)) for scene in self.with_constant_spectra()]

    def contrast_of_a_sweep(self):
        """A contrast, and that row of a sweep."""
        path, view = self.in_air(self.as_drawn())
        sampling = {"spp": SPP, "resolution": PIXELS, "seed": self.seed + 1}
        conditions = {"base": {"scenario": str(path)}, "conditions": view, "sampling": sampling}
        return [self.contrast(path, view), row_of(mi_lcair.sweep(conditions).columns())]

    def contrast_of_a_flight(self):
        """A contrast, and a target that stands still before a flight's observer."""
        path, view = self.in_air(self.as_drawn())
        (direction,) = scenario_claims.directions([view["azimuth_deg"]], [view["elevation_deg"]])
        path.with_name("path.csv").write_text(STANDS, encoding="utf-8")
        text, flown = path.read_text(encoding="utf-8"), path.with_name("flown.toml")
        where = f"[flight]\npath = 'path.csv'\nobserver_m = {(DISTANCE * direction).tolist()}\n"
        text = OBSERVER.sub(where + "ground_m = -2000\n", text).replace("height_m = 2000", "")
        flown.write_text(text, encoding="utf-8")
        return [self.contrast(path, view), row_of(mi_lcair.flight(flown, seed=self.seed + 2).table)]

    def in_air(self, scene: Path) -> tuple[Path, dict[str, float]]:
        """A scenario of a body between clear sky and ground, or its own, and its view."""
        if self.case.body is None:
            raise Unpaired
        around = CLEAR if self.case.kind.endswith("void") else BEHIND
        rng = np.random.default_rng([self.seed, self.number, 4])
        azimuth, elevation = map(float, rng.uniform((0, 5), (360, 60)))
        view = {"azimuth_deg": azimuth, "elevation_deg": elevation}
        path = self.folder / "air.toml"
        text = IN_AIR.format(
            scene=scene.name, around=around, band=self.case.band, range=DISTANCE, **view
        )
        path.write_text(text, encoding="utf-8")
        return path, view

    @staticmethod
    def contrast(path: Path, view) -> tuple[float, float]:
        row = mi_lcair.contrast(path).rows[-1]
        return row.total.value, row.half_width

    def two_sheets(self):
        """Rectangles with two sides, and two rectangles with one side each, back to back."""
        case, sides = self.case, ([], [])
        for part in case.file.parts:
            both, reverse = part, ""
            if 'type="rectangle"' in part and (found := BSDF.search(part)) and "plume" not in part:
                both = part.replace(found[0], f'<bsdf type="twosided"> {found[0]} </bsdf>')
                reverse = NAMED.sub(r'<ref id="\1"/>', part)
                reverse = reverse.replace("<matrix", '<rotate y="1" angle="180"/> <matrix')
            sides[0].append(both)
            sides[1].append(part + reverse)
        if sides[0] == case.file.parts:
            raise Unpaired
        pair = []
        for parts in sides:
            file = copy(case.file)
            file.parts = parts
            pair.append(self.mean(replace(case, file=file)))
        return pair

    def one_temperature(self):
        """Everything at one temperature is a blackbody, if the target sees nothing else."""
        case, text = self.case, "".join(self.case.file.parts)
        ones = dict.fromkeys(case.radiances(), 1.0)
        sees_all = abs(case.response(ones, case.materials).mean(axis=(1, 2)).sum() - 1) < 1e-6
        if not sees_all or case.unlimited or any(word in text for word in OTHER_SOURCES):
            raise Unpaired
        path = self.as_drawn()
        content = TEMPERATURE.sub(rf"\g<1>{ONE_K}", path.read_text(encoding="utf-8"))
        path.write_text(content, encoding="utf-8")
        return (planck.in_band_radiance(case.band, ONE_K), 0.0), self.of_file(path, case.area)


OTHER_SOURCES = ('type="area"', 'type="sun"', "mesh_attribute", "bitmap")  # than one temperature
PARTNERS = (  # of the scene as it was drawn
    "turned",
    "mirrored",
    "scaled",
    "moved",
    "divided",
    "in another order",
    "without emitter sampling",
    "aimed",
    "sum of two bands",
    "constant spectrum",
)
OTHERS = (
    "one temperature",
    "two sheets",
    "constant spectrum in air",
    "contrast of a sweep",
    "contrast of a flight",
)
DISTANCE = 4000.0  # of the observer in air [m]
BSDF = re.compile(r'<bsdf type="(?!twosided)\w+".*?</bsdf>')
OBSERVER = re.compile(r"\[observer\]\n(.*= .*\n)*")
STANDS = "time_s,x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg\n" + "0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n"
CLEAR = '[surroundings]\nsky = "clear"\nground = "295,0.9"'
BEHIND = "[background]\ntemperature = 285"
IN_AIR = """[target]
scene = "{scene}"
height_m = 2000
[observer]
range_m = {range}
azimuth_deg = {azimuth_deg!r}
elevation_deg = {elevation_deg!r}
[atmosphere]
table = "us_standard"
{around}
[sensor]
band = "{band}"
[render]
resolution = 8
spp = 256
"""


def row_of(table) -> tuple[float, float]:
    """The contrast of the first row of a table, and half of its 95 % interval."""
    return tuple(float(table[f"contrast_{name}W_m2"][0]) for name in ("", "half_width_"))


def claims_of_pairs(seed: int, number: int, kind: str = "") -> list[Claim]:
    """The claims that the pairs of a case agree."""
    with tempfile.TemporaryDirectory() as folder:
        pairs = Pairs(seed, number, Path(folder))
        if kind not in pairs.case.kind or pairs.case.kind.startswith("part"):
            return []  # parts are about rounding
        witness = Witness(pairs.case, seed, number, pairs.case.sampling)
        try:
            return [
                witness.claim(f"pair, {name}", value, truth, COMBINED * np.hypot(*halves))
                for name, *both in pairs.all()
                for (truth, value), halves in [zip(*both)]
            ]
        except (Unpaired, InputError):
            return []
