"""Independent errors of the temperatures of single facets."""

from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_slope
from mi_lcair.plugins.emission.source import rounded
from mi_lcair.sensitivity.facets import facet_matrix
from mi_lcair.table import LARGEST, read_table
from mi_lcair.uncertainty.numbers.number import Number

LEAST_SPP = 16  # samples per pixel, 2 for each of the matrix's randomisations


def facet_contribution(number: Number, group: str, stated: float | Path) -> float:
    """Standard uncertainty of a number from independent errors of the facets of a group.

    A facet's part of the derivative with respect to its temperature is its share of the effective
    area of all facets with that temperature. The shares come from one more render, which records
    the emitting facets. Reflections are included.

    Parameters
    ----------
    number : Number
        A number that was started.
    group : str
        Group of thermal emitters.
    stated : float or Path
        Standard deviation of every facet's temperature [K], or a CSV `facet,sigma_K`, with facets
        numbered as in `FacetTable`. Facets that it does not list have no error.

    Raises
    ------
    InputError
        If the group has no facets with temperatures, or the CSV cannot be used.
    """
    numbers = number.numbers
    pixels = numbers.windows.pixels
    matrix = facet_matrix(
        number.scene,
        groups=[group],
        sensor=numbers.sampling.sensor,
        spp=max(LEAST_SPP, numbers.paths // pixels),
        seed=numbers.sampling.seed,
    )
    sigma = sigma_of(matrix.facets, stated, group)
    number.columns += 1
    # Effective area of each facet in each randomisation, (R, facets) [m^2]
    area = np.array([m.sum(axis=0) for m in matrix.matrices]) * numbers.area / pixels
    slopes = slopes_per_area(number, group, matrix, area.mean(axis=0))
    effects = area * slopes * sigma
    count = len(effects)
    # Squares of noisy effects are too large on average; products of independent ones are not
    products = effects.sum(axis=0) ** 2 - (effects**2).sum(axis=0)
    return float(np.sqrt(max(products.sum() / (count * (count - 1)), 0.0)))


def slopes_per_area(number: Number, group: str, matrix, area: np.ndarray) -> np.ndarray:
    """Derivative of the number with respect to each temperature, per effective area of the facet.

    If the render resolves the sources separately, the derivative for each source is exact. It is
    divided among the facets of the source. Otherwise the facets radiate to the sensor directly.
    """
    if not number.is_linear:
        if number.unit != "W/sr":
            raise InputError(
                f"{number.what}: errors of single facets in a contrast need at most 64 "
                "temperatures in the scene"
            )
        return in_band_slope(matrix.band, matrix.temperature)
    slopes, temperature = np.zeros(len(area)), rounded(matrix.temperature)
    for k, source in enumerate(number.areas.sources):
        if source.group == group and source.temperature is not None:
            facets_of_source = temperature == source.temperature
            whole = area[facets_of_source].sum()
            if whole > 0:
                slopes[facets_of_source] = number.source_slope(k) / whole
    return slopes


def sigma_of(facets: np.ndarray, stated: float | Path, group: str) -> np.ndarray:
    """Standard deviation of each facet's temperature [K]."""
    if not isinstance(stated, Path):
        return np.full(len(facets), float(stated))
    table = read_table(stated, ("facet", "sigma_K"), "standard deviations")
    columns = table.numbers(("facet", "sigma_K"))
    table.check_range("sigma_K", columns["sigma_K"], 0, LARGEST)
    sigma = dict(zip(columns["facet"].tolist(), columns["sigma_K"].tolist()))
    if len(sigma) < len(columns["facet"]):
        raise InputError(f"{table.file}: a facet is listed twice")
    if strange := [facet for facet in sigma if facet not in facets]:
        raise InputError(f"{table.file}: group {group} has no facet {strange[0]:g}")
    return np.array([sigma.get(float(facet), 0.0) for facet in facets])
