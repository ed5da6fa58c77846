"""Parameters of a reflection model over wavelength, as an entry [NAME.spectral] gives them.

Some parameters are common to all wavelengths, the others are tabulated, on straight lines between
the rows. Averages over wavelength are averages of the reflectance, not of the parameters: those of
Sandford and Robertson enter it linearly, n and k do not.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

import numpy as np
import scipy
from drjit.llvm.ad import Float64

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError, errors_of
from mi_lcair.physics import reflection
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.reflection import microfacet_equations
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.reflection.interface import ReflectionModel
from mi_lcair.physics.spectra.files import (
    FRACTION,
    by_angle,
    columns_of,
    refractive_index,
    spectrum_of,
)
from mi_lcair.table import rows_at
from mi_lcair.toml_table import typed

# Change of the spectrum of a material, by a scale, an offset, a slope and values at nodes
# ----------------------------------------------------------------------------------------

CHANGES = {"scale": ("1", 1.0), "offset": ("1", 0.0), "slope": ("1/um", 0.0)}  # unit, unchanged
NODES = 9  # even wavelengths of a band at which a spectrum can be changed


@dataclass(frozen=True)
class Change:
    """What a surface absorbs, a, becomes scale a + offset + slope (lambda - centre) + c(lambda).

    It is the emissivity of a grey surface, epsilon of Sandford and Robertson, and 1 - F of the
    facets of a rough surface. Results are clipped to what the surface can absorb.

    band_um: limits of the band [um], of which `centre` is the middle. scale, offset: dimensionless.
    slope: 1/um. nodes: values of c, a cubic spline, at `nodes_um`, (NODES,).
    """

    band_um: tuple[float, float] = (0.0, 1.0)
    scale: float = 1.0
    offset: float = 0.0
    slope: float = 0.0
    nodes: tuple[float, ...] = (0.0,) * NODES

    @property
    def is_none(self) -> bool:
        return self == Change(self.band_um)

    @property
    def nodes_um(self) -> np.ndarray:
        """Even wavelengths [um], (NODES,)."""
        return np.linspace(*self.band_um, NODES)

    def of(self, wavelengths_um: np.ndarray, absorbed: np.ndarray, most) -> np.ndarray:
        """The changed values (n, ...) of `absorbed` at wavelengths (n,), clipped to 0..most."""
        if self.is_none:
            return absorbed
        return np.clip(self.unclipped(wavelengths_um, absorbed), 0, most)

    def unclipped(self, wavelengths_um: np.ndarray, absorbed: np.ndarray) -> np.ndarray:
        added = self.offset + self.slope * (wavelengths_um - np.mean(self.band_um))
        if any(self.nodes):
            added += scipy.interpolate.CubicSpline(self.nodes_um, self.nodes)(wavelengths_um)
        return self.scale * absorbed + added.reshape(-1, *[1] * (absorbed.ndim - 1))

    def replaced(self, name: str, value: float) -> "Change":
        """The change with another value of one of CHANGES, or of a node by its number."""
        if name in CHANGES:
            return replace(self, **{name: value})
        nodes = list(self.nodes)
        nodes[int(name)] = value
        return replace(self, nodes=tuple(nodes))

    def bounds(self, name: str, wavelengths_um, absorbed, most) -> tuple[float, float]:
        """Range of one number, see `replaced`, in which nothing is clipped, the others held.

        The other arguments are those of `of`, before the change.
        """
        base = self.replaced(name, 0.0).unclipped(wavelengths_um, absorbed)
        rate = self.replaced(name, 1.0).unclipped(wavelengths_um, absorbed) - base
        moves = abs(rate) > 1e-12
        ends = np.sort([(end - base)[moves] / rate[moves] for end in (0.0, most)], axis=0)
        return float(ends[0].max(initial=-np.inf)), float(ends[1].min(initial=np.inf))


SAMPLES = 4001  # even wavelengths of a band at which a spectral material is evaluated
ROOM_K, HOT_K = 300.0, 800.0  # the average is compared with that for the farther temperature
COSINES = np.linspace(0, 1, 65)[1:] ** 2  # at which Fresnel reflectances are averaged
PACKET = 16  # numbers that Dr.Jit reads at once, at most
NODES_OF_COSINE = np.linspace(0, 1, 513) ** 2  # at which emissivities by angle are averaged
ANGLE_DEG = Bounds(meaning="angle of incidence", unit="degrees", lower=0, upper=89)
# What makes an entry: the key of its file, the model, and the common parameters of the entry.
KINDS = {
    "nk": ("microfacet", ("alpha", "gamma", "rho_d")),
    "spectrum": ("sandford_robertson", ("b", "e")),
    "dhr": ("sandford_robertson", ()),
    "emissivity": ("grey", ()),
}
TEXTS = ("model", "form", "source", "wavelengths", "shape", "outside")
CONSTANT = "constant"  # `outside`: the first and the last row hold beyond the rows


@dataclass(frozen=True, eq=False)
class SpectralParameters:
    """The parameters of a surface over wavelength.

    Attributes
    ----------
    model : ReflectionModel
    form : str
        Form of the model's equations.
    common : dict of str to float
        Parameters that hold at all wavelengths.
    wavelengths_um : ndarray, shape (n,)
        Rising wavelengths of the rows, um.
    rows : dict of str to ndarray, shape (n,)
        The other parameters by name.
    source : str
        Where the spectrum comes from.
    remarks : tuple of str
        What a user should know about the spectrum, one line each.
    change : Change
        Change of what the surface absorbs.
    is_extended : bool
        Whether the first and the last row hold outside the rows.
    by_angle : tuple of ndarray or None
        Rising angles, radians, (m,), and emissivities, (n, m), of a surface whose emissivity is
        known by angle, see `DirectionalFamily`. Its row "emissivity" is that of the hemisphere.
    """

    model: ReflectionModel
    form: str
    common: dict[str, float]
    wavelengths_um: np.ndarray
    rows: dict[str, np.ndarray]
    source: str
    remarks: tuple[str, ...] = field(default=())
    change: Change = field(default=Change())
    is_extended: bool = False
    by_angle: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def digest(self) -> str:
        """Hexadecimal digits that change with the spectrum."""
        arrays = [self.wavelengths_um, *self.rows.values(), np.array(list(self.common.values()))]
        arrays += self.by_angle or ()
        content = b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)
        return sha256(content + f"{self.form}{self.change}".encode()).hexdigest()

    def at(self, wavelengths_um: np.ndarray) -> dict[str, np.ndarray]:
        """All parameters at these wavelengths [um], by name in the model's order.

        The change of a microfacet spectrum is one of `facet_reflectance` alone.
        """
        given = self.unchanged_at(wavelengths_um)
        if self.by_angle is not None:
            emissivity = 1 - self.facet_reflectance(wavelengths_um, NODES_OF_COSINE)
            given["emissivity"] = of_hemisphere(emissivity)
        elif self.model.name != "microfacet":
            given[self.model.names[0]] = self.change.of(*self.absorbed(wavelengths_um, given))
        return given

    def unchanged_at(self, wavelengths_um: np.ndarray) -> dict[str, np.ndarray]:
        return {
            name: np.interp(wavelengths_um, self.wavelengths_um, self.rows[name])
            if name in self.rows
            else np.full(len(wavelengths_um), self.common[name])
            for name in self.model.names
        }

    def absorbed(self, wavelengths_um: np.ndarray, given: dict, cos=COSINES) -> tuple:
        """The arguments of `Change.of`: wavelengths, what is absorbed there, and the most of it.

        given: of `unchanged_at`. cos: cosines at the facets of a rough surface, or toward the
        observer of one whose emissivity is known by angle.
        """
        if self.by_angle is not None:
            return wavelengths_um, self.emitted_at(wavelengths_um, cos), 1.0
        if self.model.name == "microfacet":
            F = fresnel_reflectance(given["n"][:, None], given["k"][:, None], cos)
            return wavelengths_um, 1 - F, 1.0
        most = 1.0
        if self.model.name == "sandford_robertson":
            most = float(sr.G(Float64(self.common["b"]))[0]) - given["rho_d"]
        return wavelengths_um, given[self.model.names[0]], most

    def emitted_at(self, wavelengths_um: np.ndarray, cos: np.ndarray) -> np.ndarray:
        """Unchanged emissivity at cosines, (wavelengths, cosines), of one that is known by angle.

        It is linear between rows and angles, and that of the nearest one outside them.
        """
        theta, values = self.by_angle
        of_angles = rows_at(np.arccos(cos), theta, values.T)
        return rows_at(wavelengths_um, self.wavelengths_um, of_angles.T)

    def facet_reflectance(self, wavelengths_um: np.ndarray, cos: np.ndarray) -> np.ndarray:
        """Fresnel reflectance of a microfacet spectrum at cosines, (wavelengths, cosines).

        For an emissivity that is known by angle, it is the reflectance toward these directions.
        """
        given = self.unchanged_at(wavelengths_um)
        return 1 - self.change.of(*self.absorbed(wavelengths_um, given, cos))

    def averaged(self, wavelengths_um: np.ndarray, weights: np.ndarray) -> tuple[float, ...]:
        """Parameters, in the model's order, of the reflectance averaged with these weights."""
        weights = weights / weights.sum()
        mean = {
            # Rounding must not take the mean of ones above 1
            name: float(np.clip(weights @ value, value.min(), value.max()))
            if name in self.rows
            else self.common[name]
            for name, value in self.at(wavelengths_um).items()
        }
        if self.model.name == "microfacet":
            target = weights @ self.facet_reflectance(wavelengths_um, COSINES)
            mean["n"], mean["k"] = fitted_index(target, mean["n"], mean["k"])
        return tuple(mean.values())

    def weights(self, band: Band, temperature: float | None) -> tuple[np.ndarray, np.ndarray]:
        """Wavelengths of a band [um] and weights of the averages, (SAMPLES,) each.

        The weights are the response times the spectral radiance of a blackbody; without a
        temperature [K], the response alone.
        """
        wavelengths = np.linspace(band.lower_um, band.upper_um, SAMPLES)
        weights = band.response_at(wavelengths)
        weights[[0, -1]] /= 2
        if temperature is not None:
            radiance = weights * spectral_radiance(wavelengths, temperature)
            weights = radiance if radiance.sum() > 0 else weights
        return wavelengths, weights

    def check_covers(self, band: Band, what: str, remedy: str = "") -> None:
        """Raise InputError if the rows do not cover a band.

        what, remedy: beginning and end of the message.
        """
        if band.is_total or not (self.is_extended or self.covered(band) == 1):
            lower, upper = self.wavelengths_um[[0, -1]]
            raise InputError(
                f"{what}: its spectrum has {lower:.6g}-{upper:.6g} um and does not cover band "
                f"{band.label}{remedy}"
            )

    def covered(self, band: Band) -> float:
        """Share of a band that lies between the first and the last row."""
        lower, upper = self.wavelengths_um[[0, -1]]
        inside = min(upper, band.upper_um) - max(lower, band.lower_um)
        return max(inside, 0.0) / (band.upper_um - band.lower_um)

    def remarks_in(self, band: Band) -> tuple[str, ...]:
        """The remarks on the spectrum, and one on a band that its rows do not cover."""
        if self.covered(band) == 1:
            return self.remarks
        lower, upper = self.wavelengths_um[[0, -1]]
        return *self.remarks, (
            f"its spectrum has {lower:.6g}-{upper:.6g} um, and is assumed to be constant in the "
            f"other {1 - self.covered(band):.0%} of band {band.label}"
        )

    def reflectance_at_normal(self, values: tuple[float, ...]) -> float:
        """HDR along the normal of the surface with these parameters."""
        surface = self.model.surface_of(values, self.form)
        return float(self.model.HDR(surface, Float64(0))[0])

    def remark_on_average(self, band: Band, temperature: float) -> str:
        """How much an average depends on the temperature of the radiation [K]."""
        other = ROOM_K if temperature > (ROOM_K + HOT_K) / 2 else HOT_K
        averaged, of_other = (
            self.reflectance_at_normal(self.averaged(*self.weights(band, T)))
            for T in (temperature, other)
        )
        return (
            f"its spectrum is averaged in {band.label} for radiation of {temperature:g} K, with a "
            f"reflectance of {averaged:.4g} along the normal; for {other:g} K it "
            f"would be {of_other:.4g}"
        )


def of_hemisphere(values: np.ndarray) -> np.ndarray:
    """Mean over the hemisphere of values at NODES_OF_COSINE (..., angles), weighted by cosines."""
    return 2 * np.trapezoid(values * NODES_OF_COSINE, NODES_OF_COSINE, axis=-1)


@lru_cache(maxsize=64)
def change_bounds(
    spectrum: SpectralParameters, change: Change, name: str, band: Band
) -> tuple[float, float]:
    """Range of one number of a change in which nothing is clipped in a band, see `Change`."""
    wavelengths, _ = spectrum.weights(band, None)
    absorbed = spectrum.absorbed(wavelengths, spectrum.unchanged_at(wavelengths))
    return change.bounds(name, *absorbed)


def fresnel_reflectance(n: np.ndarray, k: np.ndarray, cos: np.ndarray) -> np.ndarray:
    """Fresnel reflectance of the indices n + ik at cosines, in the shape of their broadcast."""
    n, k, cos = np.broadcast_arrays(n, k, cos)
    contrast, nk = (n - 1) * (n + 1) - k**2, n * k
    arrays = [Float64(in_packets(values.ravel())) for values in (cos, contrast, nk)]
    return microfacet_equations.reflectance(*arrays).numpy().reshape(n.shape)


def in_packets(values: np.ndarray) -> np.ndarray:
    """A copy of numbers (n,) from the beginning of a packet, and with room up to the end of one.

    Dr.Jit reads NumPy's memory as it is, and compiles another kernel where it is not aligned.
    """
    room = np.empty(len(values) + 2 * PACKET)
    start = -(room.ctypes.data // room.itemsize) % PACKET
    aligned = room[start : start + len(values)]
    aligned[:] = values
    return aligned


def fitted_index(target: np.ndarray, n: float, k: float) -> tuple[float, float]:
    """The index n + ik within bounds whose reflectance at COSINES is nearest to `target`."""

    def residuals(index):
        return fresnel_reflectance(index[0], index[1], COSINES) - target

    largest = [parameter.upper for parameter in reflection.model("microfacet").parameters[2:4]]
    start = np.clip((n, k), (1.001, 1e-6), np.multiply(largest, 0.999))
    fit = scipy.optimize.least_squares(residuals, start, bounds=((1, 0), largest), x_scale=start)
    return float(fit.x[0]), float(fit.x[1])


# ------------------------------------------------------------------ Reading an entry


def spectral_parameters(
    where: str, entry: dict, folder: Path, fit: Callable | None = None
) -> SpectralParameters:
    """The parameters of an entry [NAME.spectral] of a materials file.

    Parameters
    ----------
    where
        Name of the entry in messages.
    entry
        Its keys.
    folder
        Folder of the file, beside which the files of spectra are searched.
    fit
        Function of a path: the material of a fit's JSON file, for the key `shape`.
    """
    kinds = [key for key in KINDS if key in entry]
    if len(kinds) != 1:
        raise InputError(
            f"{where}: give one of {', '.join(KINDS)}; found {', '.join(kinds) or 'none'}"
        )
    (kind,) = kinds
    name, numbers = KINDS[kind]
    types = dict.fromkeys((kind, *TEXTS), str) | dict.fromkeys(numbers, float)
    with errors_of(where):
        entry = typed(entry, types | ({"dhr_theta_deg": float} if kind == "dhr" else {}), numbers)
    if entry.get("model", name) != name:
        raise InputError(f"{where}: model = '{entry['model']}'; a spectrum by `{kind}` is {name}")
    files = {key: beside(folder, entry[key]) for key in (kind, "wavelengths") if key in entry}
    common = {key: entry[key] for key in numbers}
    with errors_of(where):
        parameters = OF_KIND[kind](entry, files, common, lambda path: fit(beside(folder, path)))
        check_rows(parameters)
    return parameters


def beside(folder: Path, name: str) -> str:
    """A file beside a materials file; the name of a page stays as it is."""
    return name if name.startswith("ri:") else str(folder / name)


def of_nk(entry, files, common, fit) -> SpectralParameters:
    wavelengths, n, k, source = refractive_index(files["nk"])
    remark = f"n and k of {source}; the table holds at room temperature"
    return spectrum("microfacet", entry, common, wavelengths, {"n": n, "k": k}, source, (remark,))


def of_columns(entry, files, common, fit) -> SpectralParameters:
    columns = {"epsilon": FRACTION, "rho_d": FRACTION}
    wavelengths, epsilon, rho_d = columns_of(files["spectrum"], columns)
    rows = {"epsilon": epsilon, "rho_d": rho_d}
    return spectrum("sandford_robertson", entry, common, wavelengths, rows, files["spectrum"])


def of_emissivity(entry, files, common, fit) -> SpectralParameters:
    path = files["emissivity"]
    if "wavelengths" not in files and (table := by_angle(path)) is not None:
        wavelengths, theta, values = table
        angles = np.arccos(NODES_OF_COSINE)
        rows = rows_at(angles, theta, values.T).T
        remark = "the average over the band uses the hemispherical emissivity at all angles"
        grey = spectrum(
            "grey", entry, common, wavelengths, {"emissivity": of_hemisphere(rows)}, path, (remark,)
        )
        return replace(grey, by_angle=(theta, values))
    wavelengths, emissivity = spectrum_of(path, "emissivity", files.get("wavelengths"))
    return spectrum("grey", entry, common, wavelengths, {"emissivity": emissivity}, path)


def of_dhr(entry, files, common, fit) -> SpectralParameters:
    """Sandford-Robertson parameters with the shape of a fit and a measured DHR spectrum.

    b, e and the diffuse share s = rho_d / (G - epsilon) are the fit's. With the DHR X of the lobe
    alone (epsilon = rho_d = 0) and g = g(theta),

        DHR = rho_d g / G + (1 - (epsilon + rho_d) g / G) X,   rho_d = s (G - epsilon)

    is linear in epsilon.
    """
    if "shape" not in entry:
        raise InputError(
            "`dhr` needs `shape`, the JSON file of a fit; for a grey diffuse surface write "
            f"emissivity = '{entry['dhr']}', which takes a reflectance too"
        )
    shape = fit(entry["shape"])
    if shape.model.name != "sandford_robertson":
        raise InputError(
            f"shape '{entry['shape']}' is a {shape.model.name}; must be a sandford_robertson"
        )
    theta = entry.get("dhr_theta_deg", 0.0)
    ANGLE_DEG.check(theta, "dhr_theta_deg")
    theta = np.radians(theta)
    wavelengths, DHR = spectrum_of(files["dhr"], "reflectance", files.get("wavelengths"))
    b, e = shape.parameters["b"], shape.parameters["e"]
    S = shape.model.surface_of((0, 0, b, e), shape.form)
    X, G = float(shape.model.DHR(S, Float64(theta))[0]), float(S.G[0])
    g = float(sr.g(Float64(np.cos(theta)), Float64(np.sin(theta) ** 2), Float64(b))[0])
    room = G - shape.parameters["epsilon"]
    s = shape.parameters["rho_d"] / room if room > 0 else 0.0
    epsilon = (s * g * (1 - X) + X - DHR) / (g / G * (s + X * (1 - s)))
    clipped = np.clip(epsilon, 0, G)
    rows = {"epsilon": clipped, "rho_d": s * (G - clipped)}
    infeasible = np.abs(clipped - epsilon) > 1e-9
    remarks = ()
    if infeasible.any():
        remarks = (
            f"at {infeasible.mean():.0%} of its wavelengths the measured DHR is impossible for "
            "this shape; epsilon is clipped there, by up to "
            f"{np.abs(clipped - epsilon).max():.2g}",
        )
    common = {"b": b, "e": e}
    form = {"form": shape.form} | entry
    return spectrum("sandford_robertson", form, common, wavelengths, rows, files["dhr"], remarks)


def spectrum(model, entry, common, wavelengths, rows, source, remarks=()) -> SpectralParameters:
    model = reflection.model(model)
    form = entry.get("form", model.forms[0])
    model.check_form(form)
    source, is_extended = entry.get("source", source), entry.get("outside") == CONSTANT
    if "outside" in entry and not is_extended:
        raise InputError(f"outside = '{entry['outside']}'; must be \"{CONSTANT}\" or left out")
    return SpectralParameters(
        model, form, common, wavelengths, rows, source, tuple(remarks), is_extended=is_extended
    )


def check_rows(parameters: SpectralParameters) -> None:
    """Raise InputError for rows that no surface can have, with their wavelength.

    Any n > 0 and k >= 0 is right in a spectrum: n is below 1 near strong absorption.
    """
    given = parameters.at(parameters.wavelengths_um)
    if parameters.model.name == "microfacet":
        given |= {"n": np.ones(1), "k": np.ones(1)}
    for wavelength, *values in zip(parameters.wavelengths_um, *given.values()):
        with errors_of(f"at {wavelength:g} um"):
            parameters.model.check_feasible(*map(float, values), form=parameters.form)


OF_KIND = {"nk": of_nk, "spectrum": of_columns, "dhr": of_dhr, "emissivity": of_emissivity}
