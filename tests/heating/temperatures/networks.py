"""Networks of a few facets, for tests of the heat balance."""

import numpy as np
from scipy import sparse

from mi_lcair.heating.conductors import Conductors, Facets, Traced
from mi_lcair.heating.surfaces import SolarAreas
from mi_lcair.heating.temperatures.description import GroupTable
from mi_lcair.heating.temperatures.network import Network
from mi_lcair.heating.temperatures.weather import WeatherSeries


def weather(count=1, albedo=0.2, **numbers) -> WeatherSeries:
    """Weather at times of a day; numbers or arrays by name."""
    seconds = 86400 / count * np.arange(1, count + 1)
    usual = {
        "air_K": 290.0, "h_W_m2_K": 8.0, "sky_K": 260.0, "ground_K": 285.0, "sun_W_m2": 0.0,
        "diffuse_W_m2": 0.0,
        "sun_elevation_deg": 45.0, "sun_azimuth_deg": 0.0,
    }  # fmt: skip
    arrays = {
        name: np.broadcast_to(np.asarray(value, float), seconds.shape)
        for name, value in (usual | numbers).items()
    }
    return WeatherSeries(seconds=seconds, albedo=albedo, **arrays)


def network(
    between,
    sky,
    ground,
    conditions,
    *,
    area=None,
    beam=0.0,
    groups=None,
    onward=None,
):
    """A network of n facets, each in a group g0, g1, ... of its own."""
    n = len(sky)
    area = np.ones(n) if area is None else np.asarray(area, float)
    names = tuple(f"g{k}" for k in range(n))

    matrix = sparse.csr_array(np.asarray(between, float))
    mean = Conductors(matrix, np.reshape(sky, (n, 1)), np.asarray(ground, float))
    total = np.maximum(mean.outward, 1e-3)
    facets = Facets(
        number=np.arange(n), area=area, sides=np.ones(n, int), groups=names, group=np.arange(n),
        material=np.array(["grey"] * n), emissivity=np.minimum(total / np.maximum(area, 1e-3), 1),
    )  # fmt: skip
    times = len(conditions.seconds)
    beam = np.broadcast_to(beam, (times, n)).astype(float)[None, conditions.shines]
    diffuse = 0.6 * np.array([[sky], [ground]], float)
    onward = sparse.csr_array((n, n)) if onward is None else sparse.csr_array(onward)
    sun = SolarAreas(beam, beam, 0 * beam, *diffuse, np.full(n, 0.6), onward)
    tables = {name: GroupTable(**table) for name, table in (groups or {}).items()}
    return Network(facets, Traced((mean,)), sun, conditions, tables)
