"""Small scenes for the plugins' tests: rectangles as meshes, with a temperature per facet if
wanted.
"""

import mitsuba as mi
import numpy as np
import pytest

FILM = {
    "type": "hdrfilm",
    "component_format": "float32",
    "pixel_format": "luminance",
    "rfilter": {"type": "box"},
}


@pytest.fixture
def plate(tmp_path):
    """plate(name, corners, bsdf, temperature, ...): a one-sided rectangle of two facets, as a
    shape's dictionary.
    """

    def make(name, corners, bsdf, temperature=None, band="LWIR", group="self"):
        mesh = mi.Mesh(name, 4, 2)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = np.array(corners, dtype=np.float32).ravel()
        parameters["faces"] = np.array([0, 1, 2, 0, 2, 3], dtype=np.uint32)
        parameters.update()
        per_facet = isinstance(temperature, (list, tuple))
        if per_facet:
            mesh.add_attribute("face_temperature", 1, list(map(float, temperature)))
        mesh.write_ply(str(tmp_path / f"{name}.ply"))
        shape = {
            "type": "ply",
            "filename": str(tmp_path / f"{name}.ply"),
            "face_normals": True,
            "bsdf": bsdf,
        }
        if temperature is not None:
            value = (
                {"type": "mesh_attribute", "name": "face_temperature"}
                if per_facet
                else float(temperature)
            )
            shape["emitter"] = {
                "type": "thermal",
                "band": band,
                "temperature": value,
                "group": group,
            }
        return shape

    return make


@pytest.fixture
def corner(plate):
    """corner(integrator, bsdf=..., ...): a floor, hotter than the two grey walls that stand on it.

    bsdf: of the floor; where it names no `type`, what is to differ from a Sandford-Robertson one.
    """

    def make(integrator, bsdf=None, floor_temperature=500.0, resolution=8, **shapes):
        grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.4}}
        bsdf = bsdf or {}
        if "type" not in bsdf:
            bsdf = {"epsilon": 0.3, "rho_d": 0.1, "b": 0.2, "e": 0.1, **bsdf}
            bsdf["type"] = "sandford_robertson"
        T = mi.ScalarTransform4f
        look = T().look_at(
            origin=[0.1, -0.4, 0.9], target=[0.1, 0.05, 0.05], up=[0, 1, 0]
        ) @ T().scale([0.08, 0.08, 1])
        return mi.load_dict(
            {
                "type": "scene",
                "integrator": integrator,
                "sensor": {
                    "type": "orthographic",
                    "to_world": look,
                    "film": {**FILM, "width": resolution, "height": resolution},
                },
                "floor": plate(
                    "floor",
                    [[0, 0, 0], [0.2, 0, 0], [0.2, 0.1, 0], [0, 0.1, 0]],
                    bsdf,
                    floor_temperature,
                    group="floor",
                ),
                "left": plate(
                    "left",
                    [[0, 0, 0], [0, 0.1, 0], [0, 0.1, 0.2], [0, 0, 0.2]],
                    grey,
                    350.0,
                    group="wall",
                ),
                "back": plate(
                    "back",
                    [[0, 0.1, 0], [0.2, 0.1, 0], [0.2, 0.1, 0.2], [0, 0.1, 0.2]],
                    grey,
                    300.0,
                    group="wall",
                ),
                **shapes,
            },
            optimize=False,
        )

    return make
