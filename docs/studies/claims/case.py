"""A scene whose answer is known, and the random choices that all kinds of scenes share."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from docs.studies.claims import planck
from docs.studies.claims.scene_file import PIXELS, UP, Place, SceneFile

STEP = 1e-4  # relative step of the central differences that give the derivatives
COLDEST, HOTTEST = 20.0, 3000.0  # K
Values = dict[str, float]
PANELS = (1, 4, 16)  # panels of Gauss's quadrature across a pixel that are tried in turn
CONVERGED = 1e-6  # relative difference between two of them at which the quadrature ends


class Unsuitable(Exception):
    """The draw gives no scene: its quadrature does not converge, or its parts overlap."""


@dataclass(frozen=True)
class Body:
    """A convex body whose surroundings are the same in all directions.

    corners: of its triangles, as the scene has them [m], (n, 3, 3). groups: of the triangles, (n,).
    radiance: callable (radiances, materials) -> radiance of each triangle, (n,). toward: unit
    vector toward the sensor. is_whole: whether the sensor's window has a margin around it.
    """

    corners: np.ndarray
    groups: np.ndarray
    radiance: Callable[[Values, Values], np.ndarray]
    toward: np.ndarray
    is_whole: bool

    @property
    def areas(self) -> np.ndarray:
        """Areas of the triangles times their outward normals, (n, 3) [m^2]."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return np.cross(b - a, c - a) / 2

    def change(self, displaced: np.ndarray, values: Values, materials: Values) -> float:
        """Change of the intensity if the corners are displaced, per unit of the displacement.

        displaced: displacements of the corners, (n, 3, 3).
        """
        a, b, c = np.moveaxis(self.corners, 1, 0)
        of_a, of_b, of_c = np.moveaxis(displaced, 1, 0)
        rates = (np.cross(of_b - of_a, c - a) + np.cross(b - a, of_c - of_a)) / 2
        seen = self.areas @ self.toward > 0
        return float(self.radiance(values, materials)[seen] @ (rates @ self.toward)[seen])


@dataclass(frozen=True)
class Case:
    """A scene with its exact results, which are linear in the radiances of its sources.

    Attributes
    ----------
    kind : str
        Name of the function that drew it.
    file : SceneFile
    band : str
    sampling : str
        Whether paths draw emitters, in the words of scene files: true, false or auto.
    bounces : int
        Largest number of reflections.
    half_window : float
        Half of the side of the sensor's window, before the scene is scaled.
    temperatures : dict
        Temperature of each group of thermal emitters [K].
    materials : dict
        Values of the parameters of materials, by their names in `mi_lcair.parameters`.
    response : callable
        (radiances of the sources by name, materials) -> radiance of the target, (K, H, W), by
        number of reflections and pixel, or (K, 1, 1) if only the mean over the window is known.
        What reflects more often than `bounces` times is not included.
    second : callable
        (radiances, materials) -> mean radiance of the target, from another derivation.
    second_error : float
        Relative error of the second derivation.
    unlimited : callable or None
        As `second`, with any number of reflections; None where `response` has them all.
    error : float
        Relative error of the exact results.
    irradiance : float or None
        Irradiance by the sun, whose name as a source is "sun" [W m^-2].
    view : callable or None
        (direction toward the observer, radiances, materials) -> intensity [W/sr], projected area
        [m^2] of the model.
    body : Body or None
        The target, if it is a convex body whose surroundings are the same in all directions.
    facets : callable or None
        (radiances, materials) -> intensity of each facet toward the sensor [W/sr].
    shows : str, callable or None
        Group that the whole target belongs to, or (radiances, materials) -> mean radiance of the
        target by the group that is seen; None: it is not known.
    fills_window : bool
        Whether the window shows nothing else that radiates than the target.
    """

    kind: str
    file: SceneFile
    band: str
    sampling: str
    bounces: int
    half_window: float
    temperatures: Values
    materials: Values
    response: Callable[[Values, Values], np.ndarray]
    second: Callable[[Values, Values], float]
    second_error: float = 1e-6
    unlimited: Callable[[Values, Values], float] | None = None
    error: float = 2e-6
    irradiance: float | None = None
    view: Callable | None = None
    body: "Body | None" = None
    facets: Callable | None = None
    shows: str | Callable[[Values, Values], Values] | None = None
    fills_window: bool = True

    @property
    def area(self) -> float:
        """Area of the sensor's window [m^2]."""
        return (2 * self.half_window * self.file.place.scale) ** 2

    def radiances(self, **changed: float) -> Values:
        """Radiance of each source; `changed` replaces temperatures [K] or the irradiance."""
        temperatures = {name: changed.get(name, T) for name, T in self.temperatures.items()}
        values = {name: planck.in_band_radiance(self.band, T) for name, T in temperatures.items()}
        if self.irradiance is not None:
            values["sun"] = changed.get("sun", self.irradiance)
        return values

    def radiances_within(self, lower_um: float, upper_um: float) -> Values:
        """Radiance of each source between two wavelengths in the band [um]."""
        values = {
            name: planck.radiance_within(lower_um, upper_um, T)
            for name, T in self.temperatures.items()
        }
        if self.irradiance is not None:
            lower, upper = planck.BANDS_UM[self.band]
            values["sun"] = self.irradiance * (upper_um - lower_um) / (upper - lower)
        return values

    def photons(self) -> Values:
        """The same in photons m^-2 sr^-1 s^-1, and m^-2 s^-1 for the sun."""
        values = {
            name: planck.by_quadrature(self.band, T, photons=True)
            for name, T in self.temperatures.items()
        }
        if self.irradiance is not None:
            values["sun"] = self.irradiance * planck.photons_of_even_light(self.band)
        return values

    def background_radiance(self, temperature: float) -> float:
        """Radiance of a blackbody in the case's band [W m^-2 sr^-1]."""
        return planck.in_band_radiance(self.band, temperature)

    @property
    def pixels(self) -> np.ndarray:
        """Radiance of the target, (K, H, W) or (K, 1, 1)."""
        return self.response(self.radiances(), self.materials)

    @property
    def by_bounce(self) -> np.ndarray:
        """Mean radiance of the target with 0, 1, ... reflections."""
        return self.pixels.mean(axis=(1, 2))

    @property
    def mean(self) -> float:
        return float(self.by_bounce.sum())

    @property
    def by_group(self) -> Values:
        """Mean radiance of the target by what emitted it."""
        values = self.radiances()
        groups = {}
        for name in values:
            alone = {other: value * (other == name) for other, value in values.items()}
            group = name.partition("@")[0]
            share = self.response(alone, self.materials).mean(axis=(1, 2)).sum()
            groups[group] = groups.get(group, 0.0) + float(share)
        return groups

    @property
    def by_seen(self) -> Values:
        """Mean radiance of the target by the group that is seen; empty if it is not known."""
        if isinstance(self.shows, str):
            return {self.shows: self.mean}
        return {} if self.shows is None else self.shows(self.radiances(), self.materials)

    @property
    def with_all_reflections(self) -> float:
        exact = self.unlimited
        return self.mean if exact is None else float(exact(self.radiances(), self.materials))

    def derivatives(self) -> dict[str, np.ndarray]:
        """Derivatives of the radiance by pixel, by the names of `mi_lcair.parameters`."""

        def image(**changed):
            materials = {name: changed.get(name, x) for name, x in self.materials.items()}
            return self.response(self.radiances(**changed), materials).sum(axis=0)

        def difference(name, value):
            step = STEP * value
            return (image(**{name: value + step}) - image(**{name: value - step})) / (2 * step)

        names = {name: f"{name}.temperature" for name in self.temperatures if "@" not in name}
        result = {full: difference(name, self.temperatures[name]) for name, full in names.items()}
        for name, value in self.materials.items():
            if 0 < value < 1:
                result[name] = difference(name, value)
        if self.irradiance is not None:
            result["sun.irradiance"] = difference("sun", self.irradiance)
        return result


class Draw:
    """Random choices of a scene."""

    def __init__(self, rng: np.random.Generator):
        self.rng = rng
        self.band = str(rng.choice(["MWIR", "LWIR", "SWIR", "total"], p=[0.4, 0.35, 0.1, 0.15]))
        sampling = rng.random()
        self.sampling = "true" if sampling < 0.5 else "false" if sampling < 0.75 else "auto"

    def between(self, lower: float, upper: float) -> float:
        return float(self.rng.uniform(lower, upper))

    def size(self, lower: float, upper: float) -> float:
        """A number whose logarithm is uniform."""
        return float(np.exp(self.rng.uniform(np.log(lower), np.log(upper))))

    def chance(self, probability: float) -> bool:
        return bool(self.rng.random() < probability)

    def whole(self, lower: int, upper: int) -> int:
        """A whole number from `lower` to `upper`."""
        return int(self.rng.integers(lower, upper + 1))

    def temperature(self, lower: float = COLDEST, upper: float = HOTTEST) -> float:
        return self.size(lower, upper)

    def ambient(self) -> float:
        """Temperature of surroundings: mostly near 300 K [K]."""
        return self.between(250, 350) if self.chance(0.7) else self.temperature()

    def background(self) -> float:
        """Temperature of what sources are seen against: often cold, so that they matter [K]."""
        return self.temperature(upper=150) if self.chance(0.4) else self.ambient()

    def direction(self) -> np.ndarray:
        vector = self.rng.normal(size=3)
        return vector / np.linalg.norm(vector)

    def rotation(self) -> np.ndarray:
        """No rotation in half of the draws, otherwise any."""
        if self.chance(0.5):
            return np.eye(3)
        q, r = np.linalg.qr(self.rng.normal(size=(3, 3)))
        q *= np.sign(np.diag(r))
        return q * np.sign(np.linalg.det(q))

    def case(
        self,
        kind: str,
        file: SceneFile,
        temperatures: Values,
        bounces: int,
        half_window: float = 1.0,
        **exact,
    ) -> Case:
        """A case in the band and with the sampling of this draw; exact: its other attributes."""
        return Case(
            kind=kind,
            file=file,
            band=self.band,
            sampling=self.sampling,
            bounces=bounces,
            half_window=half_window,
            temperatures=temperatures,
            **exact,
        )

    def place(self, farthest: float = 10.0) -> Place:
        """Scale over six decades, rotation, and a shift of up to `farthest` sizes."""
        scale, rotation = self.size(1e-3, 1e3), self.rotation()
        shift = farthest * self.direction() * scale if self.chance(0.3) else np.zeros(3)
        return Place(scale, rotation, shift)

    def lens(self) -> str:
        """Kind of a second sensor, which images the plane that the orthographic one looks at."""
        return str(self.rng.choice(["perspective", "thinlens"]))

    def up(self) -> np.ndarray:
        """Upward direction of a camera that looks down: along y, or turned."""
        angle = 0.0 if self.chance(0.5) else self.between(0, 2 * np.pi)
        return np.array([-np.sin(angle), np.cos(angle), 0.0])


def on_film(centre, up, half_window: float, panels: int):
    """Points of a camera's window that looks along -z, pixel by pixel.

    Returns points (H * m, W * m, 3), from the upper left, and weights (m,) along each side of a
    pixel, which add up to 1.
    """
    x, w = np.polynomial.legendre.leggauss(4)
    inside = ((np.arange(panels)[:, None] + (x + 1) / 2) / panels).ravel()
    along = (np.arange(PIXELS)[:, None] + inside).ravel() / PIXELS * 2 - 1
    right = np.cross(-UP, up)
    offsets = along[None, :, None] * right - along[:, None, None] * np.asarray(up)
    return centre + half_window * offsets, np.tile(w / 2 / panels, panels)


def pixel_means(values, weights) -> np.ndarray:
    """Means (H, W) over pixels of values at the points of `on_film`."""
    m = len(weights)
    blocks = np.reshape(values, (PIXELS, m, PIXELS, m))
    return np.einsum("imjn,m,n->ij", blocks, weights, weights)


def converged(values, centre, up, half_window: float) -> np.ndarray:
    """Means over pixels, (n, H, W), of a function of points that gives n values of each.

    Raises Unsuitable if they do not converge.
    """
    before = None
    for panels in PANELS:
        points, weights = on_film(centre, up, half_window, panels)
        means = np.array([pixel_means(row, weights) for row in values(points.reshape(-1, 3))])
        if before is not None and np.allclose(means, before, CONVERGED, 1e-30):
            return means
        before = means
    raise Unsuitable
