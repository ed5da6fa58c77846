"""Cavities that the renderer traces: against rings, and against mirrors traced in Float64."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.laboratory.cavities import paths
from mi_lcair.laboratory.cavities.cavity import effective_emissivity
from mi_lcair.laboratory.cavities.description import CavityDescription
from mi_lcair.laboratory.cavities.shape import CavityWall
from mi_lcair.rendering.sampling import Sampling
from tests.matrix import some_of

SIGMAS = 4.5  # of Student's 15 degrees of freedom: 4 in 10,000


def described(**tables):
    return CavityDescription.read(tables)


SHAPES = [
    {"kind": "cylinder", "radius_m": 0.1, "length_m": 0.3, "aperture_radius_m": 0.06},
    {"kind": "cone", "radius_m": 0.1, "angle_deg": 50},
    {"kind": "sphere", "radius_m": 2.0, "aperture_radius_m": 1.1},
    {"kind": "cylinder_cone", "radius_m": 0.02, "length_m": 0.08, "angle_deg": 110},
]
VIEWS = [{}, {"from": "normal", "angle_deg": 30}, {"distance_m": 0.5}]
CASES = [(SHAPES[0], view) for view in VIEWS] + list(zip(SHAPES[1:], VIEWS))


@pytest.mark.slow
@pytest.mark.parametrize("shape, view", some_of(CASES, 3))
def test_diffuse_walls_as_rings(shape, view, tmp_path):
    """Paths and rings, isothermal and with a profile."""
    depth = described(shape=shape, wall={"emissivity": 1.0}).shape.depth
    profile = tmp_path / "profile.csv"
    profile.write_text(f"z_m,kelvin\n0,290\n{depth / 3},300\n{depth},315\n")
    for wall in ({"emissivity": 0.6}, {"emissivity": 0.6, "profile": str(profile)}):
        cavity = described(shape=shape, wall=wall, view=view)
        exact, _, _ = effective_emissivity(cavity, "rings", Sampling())
        value, error, _ = effective_emissivity(cavity, "paths", Sampling(paths=2**14))
        assert (abs(value - exact) < SIGMAS * error).all()
        assert error.max() < 4e-3


def mirror_cylinder(start, direction, R, L, reflectance):
    """Share of each ray that leaves an open cylinder of mirrors again, traced in Float64."""
    left = np.zeros(start.shape[1])
    place, d, weight = start.copy(), direction.copy(), np.ones(start.shape[1])
    while weight.max() > 1e-5:
        a, b = d[0] ** 2 + d[1] ** 2, place[0] * d[0] + place[1] * d[1]
        c = place[0] ** 2 + place[1] ** 2 - R**2
        wall = (-b + np.sqrt(np.maximum(b * b - a * c, 0))) / np.maximum(a, 1e-30)
        end = np.where(d[2] > 0, (L - place[2]) / d[2], -place[2] / np.minimum(d[2], -1e-30))
        leaves = (end < wall) & (d[2] < 0)
        left += np.where(leaves, weight, 0)
        weight = np.where(leaves, 0, weight * reflectance)
        is_wall = wall < end
        place = place + d * np.where(is_wall, wall, end)
        normal = place[:2] / np.hypot(*place[:2])
        turned = d[:2] - 2 * np.sum(d[:2] * normal, axis=0) * normal
        d = np.where(is_wall, np.vstack([turned, d[2]]), np.vstack([d[:2], -d[2]]))
    return left


@pytest.mark.slow
@pytest.mark.parametrize("from_, epsilon", [("hemisphere", 0.1), ("normal", 0.4)])
def test_mirrors(epsilon, from_):
    """A cylinder of mirrors: facets change nothing that 2^16 rays could show."""
    R, L = 0.1, 0.25
    angle = 25 if from_ == "normal" else 0
    cavity = described(
        shape={"kind": "cylinder", "radius_m": R, "length_m": L},
        wall={"emissivity": epsilon, "specular": 1.0},
        view={"from": from_, "angle_deg": angle, "spot_m": R},
    )
    rng = np.random.default_rng(3)
    r, phi, u, psi = np.sqrt(rng.random(2**16)), *rng.random((3, 2**16))
    phi *= 2 * np.pi
    start = R / 2 * r * np.array([np.cos(phi), np.sin(phi), 0 * phi])
    sine = np.sqrt(u) if from_ == "hemisphere" else np.full_like(u, np.sin(np.radians(angle)))
    azimuth = 2 * np.pi * psi
    direction = np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), np.sqrt(1 - sine**2)])
    left = mirror_cylinder(start, direction, R, L, 1 - epsilon)
    value, error, _ = effective_emissivity(cavity, "paths", Sampling(paths=2**16))
    own = left.std() / np.sqrt(left.size)
    assert abs(value[0] - (1 - left.mean())) < SIGMAS * np.hypot(error[0], own)


@pytest.mark.slow
def test_intervals_are_true():
    """Of 20 intervals of 95 %, 15 or more hold the exact value (all but 4 in 10,000 times)."""
    cavity = described(
        shape={"kind": "sphere", "radius_m": 1.0, "aperture_radius_m": 0.5},
        wall={"emissivity": 0.5},
    )
    exact = effective_emissivity(cavity, "rings", Sampling())[0][0]
    grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}}
    wall = CavityWall.of_shape(cavity.shape, 1)
    scene = paths.scene_of_wall(wall, grey, {}, None, paths.reflections(0.5), "LWIR")
    held = 0
    for seed in range(20):
        sampling = Sampling(paths=2**11, seed=seed)
        value, error, _ = paths.effective_emissivity(scene, cavity.view, None, sampling)
        held += abs(value[0] - exact) < 2.131 * error[0]
    assert held >= 15


@pytest.mark.slow
def test_material_is_black_in_a_closed_limit():
    """A wall of any reflection model looks black through a hole that is small enough."""
    result = mi_lcair.cavity(
        {
            "shape": SHAPES[0] | {"aperture_radius_m": 0.002},
            "wall": {"material": "gloss_black"},
            "view": {"wavelengths_um": [4.0, 10.0]},
        },
        tolerance=1e-3,
    )
    assert (result.wall_emissivity > 0.8).all()
    assert (1 - result.effective < 2e-3).all()
