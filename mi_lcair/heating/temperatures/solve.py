"""Temperatures of a loaded scene for a heat.toml."""

from dataclasses import replace

import numpy as np
from scipy import sparse

from mi_lcair.heating.exchange import exchange
from mi_lcair.heating.paths import RANDOMISATIONS
from mi_lcair.heating.sunlight import Sunlight
from mi_lcair.heating.temperatures.day import course
from mi_lcair.heating.temperatures.description import Description, Sigma, SignatureTable
from mi_lcair.heating.temperatures.heat_result import AllFacets, Heat, Intensity
from mi_lcair.heating.temperatures.network import Column, Network, Sunlit
from mi_lcair.heating.temperatures.weather import Weather, weather
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.facets.polygons import FacetPolygons
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.limits import check_free
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.window import window_area
from mi_lcair.sensitivity.facets import facet_matrix

SHADOW_RAYS = 32  # of each facet toward each position of the sun
BYTES = 1100  # memory for a facet and a position of the sun, measured with 4,000 and 8,000 facets
STEP = 0.1  # of the temperatures in differences of radiances [K]


def temperatures(scene: Scene, description: Description) -> Heat:
    """The temperatures of a scene's facets; see `mi_lcair.heat`."""
    run = description.run
    conditions = weather(
        description.weather, description.folder, run.steps, is_periodic=run.start_K is None
    )
    if description.signature is not None:
        window_area(scene.sensor(description.signature.sensor), scene.name)  # refuses other sensors
    radiation = exchange(scene, run.rays, run.seed)
    light, of_light = sunlit(scene, radiation.facets, conditions, description)
    network = Network(radiation.facets, radiation.traced, light, conditions, description.groups)
    columns = [network.column(name, sigma) for name, sigma in description.sigma.items()]
    doubtful = reflected_columns(network, description.sigma)
    noise = network.noise()
    solved = course(network, [*columns, *noise, *doubtful], run.start_K)
    changes = dict(zip(description.sigma, solved.changes))
    replicates = solved.changes[len(columns) :][: len(noise)]
    of_sigma = [
        f"[sigma] {name} changes no temperature"
        for name, change in changes.items()
        if not change.any()
    ]
    of_sigma += [
        f"[sigma] {column.name}: up to {abs(change).max():.2g} K of its effect, which is "
        f"{abs(changes[column.name]).max():.2g} K at most, assume that surfaces reflect evenly"
        for column, change in zip(doubtful, solved.changes[len(columns) + len(noise) :])
    ]
    table = FacetTable(scene)
    result = Heat(
        name=scene.name,
        facets=radiation.facets,
        seconds=conditions.seconds,
        kelvin=solved.kelvin,
        sigmas=description.sigma,
        changes=changes,
        noise=replicates.std(axis=0, ddof=1) / np.sqrt(len(replicates)),
        residual_W=solved.residual,
        days=solved.days,
        drift_K=solved.drift,
        intensity=None,
        all_facets=AllFacets(
            FacetPolygons.of(table.triangles, table.triangle_facet), table.temperature
        ),
        remarks=tuple(
            dict.fromkeys((*radiation.remarks, *of_light, *conditions.remarks, *of_sigma))
        ),
    )
    if description.signature is None:
        return result
    return replace(result, intensity=intensity(scene, result, description.signature, run.seed))


def reflected_columns(network: Network, sigmas: dict[str, Sigma]) -> list[Column]:
    """What emissivities change by reflections, if surfaces are not diffuse."""
    if network.facets.is_diffuse.all():
        return []
    return [
        Column(name, radiative=network.of_emissivity(name, sigma, is_whole=False))
        for name, sigma in sigmas.items()
        if name.rpartition(".")[2] == "emissivity"
    ]


def sunlit(scene: Scene, facets, conditions: Weather, description: Description):
    """The sunlight that facets absorb at the times of a weather, and remarks on it."""
    n, times = len(facets.area), len(conditions.seconds)
    shines = conditions.sun_W_m2 > 0
    beam = np.zeros((RANDOMISATIONS, times, n))
    if not shines.any() and not conditions.diffuse_W_m2.any():
        dark = np.zeros((1, n))
        return Sunlit(beam[:1], dark, dark, np.ones(n), sparse.csr_array((n, n))), ()
    what = f"sunlight on {n} facets at {shines.sum()} times"
    check_free(
        BYTES * n * shines.sum(), what, "lower steps of [run], or give the model larger facets"
    )
    light = Sunlight(scene, description.run.rays, description.run.seed)
    # Without a beam its areas are of no account, but a sheet's sides are
    suns = conditions.toward_sun[shines] if shines.any() else np.array([[0.0, 0, 1]])
    areas = light.areas(suns, SHADOW_RAYS)
    if shines.any():
        beam[:, shines] = areas.absorbing
    of_sky = light.of_sky.sum(axis=2)
    return (
        Sunlit(beam, of_sky, light.of_ground, light.absorptance, areas.onward),
        light.remarks,
    )


def intensity(scene: Scene, heat: Heat, table: SignatureTable, seed: int) -> Intensity:
    """The intensity of the model at all times, from one render by facet.

    Raises InputError for a sensor that is not orthographic.
    """
    area = window_area(scene.sensor(table.sensor), scene.name)
    traced = facet_matrix(scene, sensor=table.sensor, spp=table.spp, seed=seed, model_only=True)
    pixel = area / np.prod(traced.size)
    weights = pixel * np.array([np.asarray(m.sum(axis=0)).ravel() for m in traced.matrices])
    rest = pixel * traced.rest.sum(axis=1)
    place = {number: k for k, number in enumerate(heat.facets.number)}
    is_solved = np.array([number in place for number in traced.facets])
    column = [place[number] for number in traced.facets[is_solved]]

    def whole(values, others):
        """Values (m, n) of the facets that exchange heat among those that are seen."""
        result = np.zeros((len(values), len(is_solved))) + others
        result[:, is_solved] = values[:, column]
        return result

    def radiance(kelvin):
        return in_band_radiance(traced.band, whole(kelvin, traced.temperature))

    values = (radiance(heat.kelvin) @ weights.T + rest).T
    slope = (radiance(heat.kelvin + STEP) - radiance(heat.kelvin - STEP)) / (2 * STEP)
    mean = weights.mean(axis=0)
    changes = {
        name: (slope * whole(change, 0.0)) @ mean
        for name, change in (heat.changes | {"exchange": heat.noise}).items()
    }
    error = values.std(axis=0, ddof=1) / np.sqrt(len(values))
    return Intensity(traced.band.label, values.mean(axis=0), error, changes)
