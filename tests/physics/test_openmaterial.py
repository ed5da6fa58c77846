"""ASAM OpenMATERIAL 3D: emissivity and roughness as a material, and fits written and read back."""

import copy
import json

import numpy as np
import pytest
from drjit.llvm.ad import Float64

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.materials import entries_of, material

FILE = {
    "metadata": {"name": "aluminum", "uuid": "fe7d7070-50e5-45f1-9f26-58ecacb6ac5e"},
    "materialProperties": {
        "surfaceRoughness": {
            "surfaceHeightRms": 2e-6,
            "surfaceCorrelationLength": 2e-5,
            "sources": "stylus",
        },
        "emissivityData": {
            "emissivityCoefficient": 0.3,
            "temperature": 300.0,
            "sources": "calorimeter",
        },
        "densityData": {"density": 2699.0, "sources": "scales"},
    },
}


def written(folder, *changes, name="alu.xomp"):
    content = copy.deepcopy(FILE)
    for table, key, value in changes:
        place = content["materialProperties"]
        if key is None:
            place.pop(table)
        else:
            place[table][key] = value
    (folder / name).write_text(json.dumps(content))
    return str(folder / name)


def over_hemisphere(entry, count=2000):
    """Midpoints over theta, as the definition says."""
    theta = (np.arange(count) + 0.5) * np.pi / 2 / count
    emitted = 1 - entry.model.HDR(entry.surface(), Float64(theta)).numpy()
    return np.sum(emitted * np.sin(2 * theta)) * np.pi / 2 / count


@pytest.mark.parametrize("emissivity", [0.3, 0.9, 0.97])
@pytest.mark.parametrize("name", ["alu.xomp", "alu.json"])
def test_emissivity_and_roughness(tmp_path, emissivity, name):
    path = written(tmp_path, ("emissivityData", "emissivityCoefficient", emissivity), name=name)
    (entry,) = entries_of(path)
    assert entry.model.name == "microfacet" and entry.band == "total"
    assert entry.parameters["alpha"] == pytest.approx(0.1 * 2**0.5)
    assert entry.parameters["gamma"] == 2 and entry.parameters["rho_d"] == 0
    assert over_hemisphere(entry) == pytest.approx(emissivity, abs=1e-4)
    assert entry.source == "calorimeter; roughness: stylus"
    assert material(path, band("total")).parameters == entry.parameters
    with pytest.raises(InputError, match="not measured for band LWIR 8-12 um, only for total"):
        material(path, band("LWIR"))
    assert material(path, band("LWIR"), allow_band=True).band == "total"


def test_smooth_surfaces_reflect_as_their_index(tmp_path):
    path = written(tmp_path, ("surfaceRoughness", "surfaceHeightRms", 3e-9))
    (entry,) = entries_of(path)
    n, k = entry.parameters["n"], entry.parameters["k"]
    normal = 1 - entry.model.HDR(entry.surface(), Float64([0.0])).numpy()[0]
    assert normal == pytest.approx(4 * n / ((n + 1) ** 2 + k**2), rel=1e-4)


@pytest.mark.parametrize(
    "changes",
    [
        [("surfaceRoughness", None, 0)],
        [("surfaceRoughness", "surfaceHeightRms", 0.0)],
        [("surfaceRoughness", "surfaceHeightRms", 4.0)],
        [("surfaceRoughness", "surfaceCorrelationLength", 0.0)],
        # Facets of slope 0.5 absorb more than this among themselves
        [("emissivityData", "emissivityCoefficient", 0.03),
            ("surfaceRoughness", "surfaceHeightRms", 7e-6)],
    ],
)  # fmt: skip
def test_other_surfaces_are_diffuse(tmp_path, changes):
    (entry,) = entries_of(written(tmp_path, *changes))
    assert entry.model.name == "grey"
    assert entry.parameters["emissivity"] == (0.03 if len(changes) > 1 else 0.3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("emissivityData", None, 0), "an OpenMATERIAL without emissivityData"),
        (("emissivityData", "emissivityCoefficient", 1.2), "emissivity"),
        (("emissivityData", "emissivityCoefficient", "high"), "must be a finite number"),
        (("emissivityData", "kelvin", 300.0), "unknown key 'kelvin'"),
        (("surfaceRoughness", "surfaceHeightRms", "rough"), "surfaceRoughness: surfaceHeightRms"),
        (("surfaceRoughness", "surfaceHeightRms", -1.0), "must be 0 or more"),
    ],
)
def test_refused(tmp_path, change, words):
    with pytest.raises(InputError, match=f"alu.xomp.*{words}"):
        entries_of(written(tmp_path, change))
