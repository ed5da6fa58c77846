"""Small scenes for the tests of heating."""

import mitsuba as mi
import numpy as np

import mi_lcair


def grey(emissivity: float, **properties) -> dict:
    return {"type": "grey", "emissivity": emissivity, **properties}


def emits(group: str = "self", kelvin: float = 300.0) -> dict:
    return {"type": "thermal", "band": "total", "temperature": kelvin, "group": group}


def scene_of(**shapes):
    """A loaded scene of shapes."""
    film = {"type": "hdrfilm", "width": 4, "height": 4, "pixel_format": "luminance"}
    around = {
        "integrator": {"type": "bounce_path"},
        "sensor": {"type": "perspective", "film": film},
    }
    return mi_lcair.load(mi.load_dict({"type": "scene", **around, **shapes}, optimize=False))


def square(bsdf: dict, to_world=None, **more) -> dict:
    """A square of side 2 m, which faces up before it is moved."""
    turned = mi.ScalarTransform4f() if to_world is None else to_world
    return {"type": "rectangle", "to_world": turned, "bsdf": bsdf, **more}


def box(bsdf: dict, inward: bool = True, **more) -> dict:
    """A cube of edge 2 m, of 12 triangles."""
    return {"type": "cube", "flip_normals": inward, "bsdf": bsdf, **more}


def cube_of(emissivities) -> dict:
    """The faces of a grey cube of edge 1 m that is seen from inside, as groups face0 to face5.

    Face 2 k lies at 0 and face 2 k + 1 at 1 of axis k.
    """
    T, turns = mi.ScalarTransform4f(), {0: ([0, 1, 0], 90), 1: ([1, 0, 0], -90)}
    shapes = {}
    for face, emissivity in enumerate(emissivities):
        axis, at = divmod(face, 2)
        middle = [0.5, 0.5, 0.5]
        middle[axis] = float(at)
        turn = T.rotate([1, 0, 0], 180) if at else T
        if axis in turns:
            turn = T.rotate(*turns[axis]) @ turn
        to_world = T.translate(middle) @ turn @ T.scale([0.5, 0.5, 1])
        shapes[f"face{face}"] = square(grey(emissivity), to_world, emitter=emits(f"face{face}"))
    return shapes


def spheres(inner: dict, outer: dict):
    """Two concentric spheres of radii 1 and 2 m."""
    return scene_of(
        inner={"type": "sphere", "bsdf": inner, "emitter": emits("inner")},
        outer={
            "type": "sphere",
            "radius": 2,
            "flip_normals": True,
            "bsdf": outer,
            "emitter": emits("outer"),
        },
    )


def mirror_box(e1: float, e2: float, gap: float = 1.0) -> dict:
    """Two squares that face each other between four perfect mirrors."""
    T = mi.ScalarTransform4f()
    sides = {
        f"mirror{k}": square(
            grey(0.0, lobe="mirror"),
            T.rotate([0, 0, 1], 90 * k).translate([1, 0, 0]).rotate([0, 1, 0], -90),
        )
        for k in range(4)
    }
    upper = T.translate([0, 0, gap]).rotate([1, 0, 0], 180)
    return {
        "lower": square(grey(e1), emitter=emits("lower")),
        "upper": square(grey(e2), upper, emitter=emits("upper")),
        **sides,
    }


def between(result, a: str, b: str) -> float:
    """The conductor between two groups [m^2]."""
    names = result.facets.groups
    return result.conductors.by_group(result.facets).between[names.index(a), names.index(b)]


def rings_of(factor, elevations_deg: np.ndarray) -> np.ndarray:
    """Differences of a function of the elevation [rad] over the rings of the sky."""
    return np.diff(factor(np.radians(elevations_deg)))
