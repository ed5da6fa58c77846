"""Shapes of bodies from their silhouettes in several views."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair import InputError
from mi_lcair.models3d import export, read
from tests.knowing.inversion.corner import EXACT
from tests.rendering.motions.test_control_points import ball

POINTS = 6
SIGMA = 0.5  # W m^-2 sr^-1, of 39 of the body


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A black ball of radius .5 m in a window that leaves room for a larger one."""
    folder = tmp_path_factory.mktemp("ball")
    points, triangles = ball()
    lines = ["v {} {} {}".format(*point) for point in points]
    lines += ["o f*blackbody*300*ball"] + ["f {} {} {}".format(*t + 1) for t in triangles]
    (folder / "ball.obj").write_text("\n".join(lines))
    export(read(folder / "ball.obj"), folder / "ball")
    path = folder / "ball" / "scene.xml"
    text = path.read_text()
    path.write_text(text.replace('<scale x="', '<scale x="1.3" y="1.3"/> <scale x="', 1))
    return str(path)


def view(scene: str, k: int, size: float, **changes) -> dict:
    """Image k of the ball, scaled by `size`."""
    place = {"azimuth_deg": 120 * k, "elevation_deg": 25 - 50 * (k % 2), "resolution": 12}
    loaded = mi_lcair.load(scene, **place, **{"self.size": size})
    image = mi_lcair.render(loaded, spp=1024, seed=9).channels["Y"].astype(float)
    image += np.random.default_rng(k).normal(0, SIGMA, image.shape)
    file = scene.replace("scene.xml", f"view{k}_{size}.npy")
    np.save(file, image)
    return {"scene": scene, "image": file, "quantity": "radiance", "sigma": SIGMA} | {
        "parameters": place, **EXACT, **changes,
    }  # fmt: skip


def problem(data, entry: dict, points: int = POINTS, name: str = "body.shape") -> dict:
    return {
        "data": data,
        "motions": {"body.shape": {"groups": ["self"], "control_points": points}},
        "unknowns": dict.fromkeys([name] if isinstance(name, str) else name, entry),
        "render": {"spp": 32},
    }


def test_a_ball_that_is_larger(scene):
    """All views share one shape. It is the offset that the factor of the size makes."""
    data = [view(scene, k, 1.2) for k in range(3)]
    known = {"prior": [0, 0.2], "correlation_m": 0.3}
    solution = mi_lcair.invert(problem(data, known), advise=False)
    assert [a.label for a in solution.answers] == [f"body.shape.{k}" for k in range(POINTS)]
    assert {a.unit for a in solution.answers} == {"m"}
    value = np.array([a.value for a in solution.answers])
    error = np.array([a.standard_error for a in solution.answers])
    assert solution.converged and solution.p_value > 1e-3
    assert value == pytest.approx(0.1, abs=0.01)
    assert (np.abs(value - 0.1) < 4 * error).all() and error.max() < 0.01
    again = mi_lcair.load(scene, resolution=8)
    assert "body.shape.0" not in mi_lcair.parameters(again)


def test_what_no_view_shows_is_not_determined(scene):
    """From one side, a silhouette says nothing of the front and of the back."""
    known = {"prior": [0, 0.1], "correlation_m": 0.05}
    one = [view(scene, 0, 1.0, parameters={"azimuth_deg": 0, "resolution": 12})]
    solution = mi_lcair.invert(problem(one, known, 10), advise=False)
    verdicts = [a.verdict.startswith("not determined") for a in solution.answers]
    errors = np.array([a.standard_error for a in solution.answers])
    assert 0 < sum(verdicts) < len(verdicts)
    assert errors[verdicts].min() > 0.05 > errors[np.invert(verdicts)].max() > 0


@pytest.mark.parametrize(
    ("entry", "name", "text"),
    [
        ({"correlation_um": 1.0}, "body.shape", "correlation_um is of spectra"),
        ({"correlation_m": 1.0}, "body.shape.0", "correlation_m is of facets"),
        ({}, "body.shape.6", "known: body.shape"),
        ({}, "body.shapes", "body.shape"),
        ({}, ("body.shape", "body.shape.1"), "'body.shape.1' is in several entries"),
        ({"lower": 0.6}, "body.shape", "no value lies in its bounds"),
    ],
)
def test_refused(scene, entry, name, text):
    with pytest.raises(InputError, match=text):
        mi_lcair.invert(problem([view(scene, 0, 1.0)], entry, name=name))
