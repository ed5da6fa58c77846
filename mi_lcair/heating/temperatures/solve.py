"""Temperatures of a loaded scene for a heat.toml."""

from dataclasses import replace

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.estimate import Contribution, Estimate
from mi_lcair.heating.conductors import standard_error
from mi_lcair.heating.exchange import exchange
from mi_lcair.heating.paths import emitting_facets
from mi_lcair.heating.sunlight import SolarAreas, solar_areas
from mi_lcair.heating.temperatures.day import course
from mi_lcair.heating.temperatures.description import (
    Description,
    RunTable,
    SignatureTable,
)
from mi_lcair.heating.temperatures.heat_result import Heat
from mi_lcair.heating.temperatures.network import Network
from mi_lcair.heating.temperatures.weather import Weather, weather
from mi_lcair.physics.blackbody import radiance_and_slope
from mi_lcair.rendering.facets.polygons import FacetPolygons
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.limits import check_free
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.window import window_area
from mi_lcair.sensitivity.facets import FacetMatrix, facet_matrix

# Rays toward the sun: least number from each side of a facet at each time, and number of all rays
# up to which there are as many as paths
SHADOW_RAYS, ALL_SHADOW_RAYS = 32, 2**24
BYTES = 1100  # memory for a facet and a position of the sun, measured with 4,000 and 8,000 facets
DOUBTFUL = 0.01  # share of an effect that may rest on an assumption without a remark


def temperatures(scene: Scene, description: Description) -> Heat:
    """The temperatures of a scene's facets; see `mi_lcair.heat`."""
    run, sigmas = description.run, description.sigma
    conditions = weather(
        description.weather, description.folder, run.steps, is_periodic=run.start_K is None
    )
    table, signature = FacetTable(scene), description.signature
    traced = None if signature is None else effective_areas(scene, table, signature, run.seed)
    radiation = exchange(scene, run.rays, run.seed)
    sun = sunlight(scene, len(radiation.facets.number), conditions, run)
    network = Network(radiation.facets, radiation.traced, sun, conditions, description.groups)
    columns = [network.column(name, sigma) for name, sigma in sigmas.items()]
    solved = course(network, columns, run.start_K)
    rows = [Contribution("exchange", standard_error(solved.scatter))]
    rows += [
        Contribution(name, change, sigma=sigma)
        for (name, sigma), change in zip(sigmas.items(), solved.changes)
    ]
    of_sigma = [
        f"[sigma] {row.quantity} changes no temperature"
        for row in rows[1:]
        if not row.contribution.any()
    ]
    of_sigma += remarks_on_emissivities(network, sigmas, solved.kelvin[0], traced is not None)
    of_sun = () if sun is None else sun.remarks
    result = Heat(
        name=scene.name,
        facets=radiation.facets,
        seconds=conditions.seconds,
        estimate=Estimate.of(solved.kelvin, "K", rows),
        residual_W=solved.residual,
        days=solved.days,
        drift_K=solved.drift,
        intensity=None,
        band="" if traced is None else traced[0].band.label,
        polygons=FacetPolygons.of(table.triangles, table.triangle_facet),
        scene_kelvin=table.temperature,
        remarks=tuple(dict.fromkeys((*radiation.remarks, *of_sun, *conditions.remarks, *of_sigma))),
    )
    return result if traced is None else replace(result, intensity=intensity(result, *traced))


def remarks_on_emissivities(
    network: Network, sigmas: dict, kelvin: np.ndarray, has_intensity: bool
) -> list[str]:
    """Remarks on neglected effects of emissivities. kelvin: (n,), at the first time."""
    facets, remarks = network.facets, []
    for name, sigma in sigmas.items():
        group, _, bare = name.rpartition(".")
        if bare != "emissivity":
            continue
        effects = (network.of_emissivity(group, sigma, whole)(kelvin, 0) for whole in (False, True))
        onward, whole = (abs(effect).max() for effect in effects)
        if onward > DOUBTFUL * whole:
            share = f"{onward / whole:.0%} of its effect assumes that surfaces reflect evenly"
            remarks.append(f"[sigma] {name}: {share}")
        if has_intensity:
            delta = network.relative(group, sigma, facets.emissivity)
            share = facets.emitting_area @ delta / facets.emitting_area.sum()
            remarks.append(
                f"[sigma] {name}: changes the intensity by temperatures only; the surfaces also "
                f"emit {share:.1%} more at the same temperatures, which a budget takes in"
            )
    return remarks


def sunlight(scene: Scene, n: int, conditions: Weather, run: RunTable) -> SolarAreas | None:
    """The sunlight that n facets absorb while the sun shines; None in the dark."""
    suns = conditions.toward_sun[conditions.shines]
    if not len(suns):
        if not conditions.diffuse_W_m2.any():
            return None
        suns = np.array([[0.0, 0, 1]])  # for the sides of a sheet
    check_free(
        BYTES * n * len(suns),
        f"sunlight on {n} facets at {len(suns)} times",
        "lower steps of [run], or give the model larger facets",
    )
    shadow_rays = max(SHADOW_RAYS, min(run.rays, ALL_SHADOW_RAYS // (n * len(suns))))
    return solar_areas(scene, suns, run.rays, shadow_rays, run.seed)


def effective_areas(
    scene: Scene, table: FacetTable, signature: SignatureTable, seed: int
) -> tuple[FacetMatrix, float]:
    """Radiance of the model by facet from one render, and the area of a pixel [m^2].

    Raises InputError for a sensor without a window, for what `facet_matrix` refuses, and for an
    emitter whose temperatures cannot be replaced.
    """
    area = window_area(scene.sensor(signature.sensor), scene.name)
    number = emitting_facets(table, shapes := list(scene.mi.shapes()), scene.name)
    for facet in number[np.isnan(table.temperature[number])]:
        raise InputError(
            f"{scene.name}: shape '{shapes[table.shape_index[facet]].id()}' has no temperature for "
            "each facet, in whose place [signature] could put the balance's; give it a number"
        )
    options = {"sensor": signature.sensor, "spp": signature.spp, "seed": seed}
    traced = facet_matrix(scene, **options, model_only=True)
    return traced, area / np.prod(traced.size)


def intensity(heat: Heat, traced: FacetMatrix, pixel: float) -> Estimate:
    """The intensity of the model at all times; see `effective_areas`."""
    weights = pixel * np.array([np.asarray(m.sum(axis=0)).ravel() for m in traced.matrices])
    rest = pixel * traced.rest.sum(axis=1)

    whole = heat.of_scene(heat.kelvin, heat.scene_kelvin)[:, traced.facets]
    radiance, slope = radiance_and_slope(traced.band, whole)
    values = (radiance @ weights.T + rest).T
    mean = slope * weights.mean(axis=0)

    def through(change):
        return np.sum(mean * heat.of_scene(change)[:, traced.facets], axis=1)

    first, *inputs = (row.through(through) for row in heat.estimate.contributions)
    rows = Contribution("noise of the rendering", standard_error(values)), *inputs, first
    return Estimate.of(values.mean(axis=0), "W/sr", rows)
