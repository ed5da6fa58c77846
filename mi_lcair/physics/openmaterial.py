"""Materials of ASAM OpenMATERIAL 3D, version 1 (.xomp or .json): their emissivity and roughness.

`emissivityData` is the total emissivity over the hemisphere at one temperature, so that it holds in
the band `total`; other bands need `allow_band`. `surfaceRoughness` has the rms height h and the
correlation length l of the surface, where the autocorrelation has fallen to 1/e. For a Gaussian
autocorrelation the rms slope along one axis is

    alpha = sqrt(2) h / l,

which is the parameter alpha of the microfacet model with gamma = 2. Its index n + ik is one with
which the surface has the emissivity over the hemisphere: n = 1.5 with k > 0, or n < 1.5 with k = 0.
Without roughness, and where so rough facets would absorb more (see `reflection.microfacet`), the
surface is grey and diffuse.

A fit that is written gets the emissivity and the slope that it has in its band. Its exact
parameters are among the custom properties, and are read back.

Source: ASAM OpenMATERIAL 3D 1.0.0, schemas/material_schema.json.
"""

import json
import uuid
from functools import lru_cache
from math import sqrt

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError, errors_of
from mi_lcair.toml_table import typed

PROPERTIES = "materialProperties"
OWN = "mi_lcair"  # custom property with the exact parameters
ROUGHNESS = ("surfaceHeightRms", "surfaceCorrelationLength")
EMISSIVITY = ("emissivityCoefficient", "temperature")
SCHEMA = "https://raw.githubusercontent.com/asam-ev/OpenMATERIAL-3D/refs/tags/v1.0.0/schemas"
LENGTH_M = 1e-5  # correlation length that is written; only its ratio to the height matters
ALPHA, N, MOST_PLACE = (1e-4, 1.0), 1.5, 100.0  # bounds of the microfacet model
SLOPES = ("alpha", "e")  # parameters that are the slope of a lobe
AT_LEAST_0 = Bounds(lower=0)
UNKNOWN = "not stated"  # what a file must say and a fit does not know


def report_of(file: dict, where: str) -> dict:
    """The material of a file's content as the report of a fit; raises InputError without one."""
    properties = file[PROPERTIES]
    custom = properties.get("customProperties")
    own = custom.get(OWN) if isinstance(custom, dict) else None
    if own is not None:
        return own
    if "emissivityData" not in properties:
        raise InputError(f"{where}: an OpenMATERIAL without emissivityData; give it the emissivity")
    emissivity, _, source = numbers(properties, "emissivityData", EMISSIVITY, where)
    report = {"model": "grey", "form": "standard", "band": "total", "source": source}
    report["parameters"] = {"emissivity": emissivity}
    if "surfaceRoughness" in properties:
        height, length, of_roughness = numbers(properties, "surfaceRoughness", ROUGHNESS, where)
        alpha = sqrt(2) * height / length if length > 0 else 0.0
        if facets := facets_of(emissivity, alpha):
            report |= {"model": "microfacet", "parameters": facets}
            report["source"] += f"; roughness: {of_roughness}"
    return report


@lru_cache(maxsize=32)
def facets_of(emissivity: float, alpha: float) -> dict[str, float] | None:
    """Parameters of microfacets with this slope and emissivity; None where there are none."""
    from scipy.optimize import brentq

    from mi_lcair.physics.reflection.interface import emissivity_over_hemisphere
    from mi_lcair.physics.reflection.microfacet import MODEL

    if not ALPHA[0] <= alpha <= ALPHA[1]:
        return None

    def shape(place: float) -> dict[str, float]:
        n, k = (1 + place * (N - 1), 0.0) if place < 1 else (N, place - 1)
        return {"alpha": alpha, "gamma": 2.0, "n": n, "k": k, "rho_d": 0.0}

    def excess(place: float) -> float:
        surface = MODEL.surface_of(shape(place).values(), MODEL.forms[0])
        return emissivity_over_hemisphere(MODEL, surface) - emissivity

    if excess(0) < 0 or excess(MOST_PLACE) > 0:
        return None
    return shape(brentq(excess, 0, MOST_PLACE, xtol=1e-9))


def numbers(properties: dict, table: str, names: tuple[str, str], where: str):
    """Two numbers of a table of properties, and their sources."""
    with errors_of(f"{where}: {table}"):
        kinds = dict.fromkeys(names, float) | {"sources": str}
        if not isinstance(properties[table], dict):
            raise InputError("must be a table")
        given = typed(properties[table], kinds, kinds)
        for name in names:
            AT_LEAST_0.check(given[name], name)
    return *(given[name] for name in names), given["sources"]


def content_of(name: str, report: dict, emissivity: float, kelvin: float) -> dict:
    """The content of a file for the report of a fit.

    emissivity: over the hemisphere, in the band of the fit. kelvin: temperature that the file
    states for it.
    """
    own = {key: report[key] for key in ("model", "form", "band", "parameters")}
    own["sigma"] = {key: s for key, s in report["standard_error"].items() if s}
    band = f"mi-lcair fit, in the band {report['band']} um alone"
    properties = {"emissivityData": dict(zip((*EMISSIVITY, "sources"), (emissivity, kelvin, band)))}
    if slopes := [report["parameters"][s] for s in SLOPES if s in report["parameters"]]:
        height = slopes[0] * LENGTH_M / sqrt(2)
        stated = height, LENGTH_M, "mi-lcair fit: the ratio of the two, from the width of the lobe"
        properties["surfaceRoughness"] = dict(zip((*ROUGHNESS, "sources"), stated))
    properties["customProperties"] = {OWN: own}
    metadata = {
        "name": name,
        "description": f"Fit of measured BRDFs in the band {report['band']} um.",
        "uuid": str(uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(own, sort_keys=True))),
        "materialVersion": "1.0.0",
        "openMaterial3dVersion": "1.0.0",
        "copyrights": [UNKNOWN],
        "license": UNKNOWN,
        "authors": [UNKNOWN],
    }
    schema = f"{SCHEMA}/material_schema.json"
    return {"$schema": schema, "metadata": metadata, PROPERTIES: properties}
