"""What further measurements would bring to invented estimates."""

from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.knowing.inversion import advice as module
from mi_lcair.knowing.inversion.advice import (
    Proposal,
    advice,
    information,
    listed,
    measurements,
    other_bands,
    other_states,
    priors,
    surroundings,
)
from mi_lcair.knowing.inversion.answers import answers
from mi_lcair.knowing.inversion.data.readings import Observation
from mi_lcair.knowing.inversion.least_squares.prediction import Weighing
from tests.knowing.inversion.blocks import block, estimated, kelvin, unknown

UNKNOWNS = [kelvin("a.temperature"), unknown("paint.b")]
INFORMATION = np.array([[0.02, 0.8], [0.8, 40.0]])
PRIOR = np.array([1e-4, 1.0])


def estimate():
    covariance = np.linalg.inv(INFORMATION + np.diag(PRIOR))
    found = answers(UNKNOWNS, estimated([300.0, 0.3], covariance))
    assert not any(answer.is_determined for answer in found)
    normal = SimpleNamespace(information=INFORMATION)
    state = SimpleNamespace(equations=normal, prior=PRIOR, model_errors=0.0)
    return state, found


def test_a_measurement_of_one_unknown():
    """Errors are those of the sum of both informations; useless proposals are left out."""
    state, found = estimate()
    useless = Proposal("nothing", 1e-6 * np.eye(2))
    known = Proposal("the paint", np.diag([0.0, 1e4]))
    better = Proposal("both", np.diag([4.0, 1e4]))
    result = advice(UNKNOWNS, state, found, [useless, known, better])
    assert [one.measure for one in result] == ["both", "the paint"]
    total = INFORMATION + np.diag(PRIOR)
    expected = np.sqrt(np.diag(np.linalg.inv(total + np.diag([0.0, 1e4]))))
    before = np.sqrt(np.diag(np.linalg.inv(total)))
    one = result[1]
    assert list(one.errors.values()) == pytest.approx(expected)
    assert list(one.now.values()) == pytest.approx(before)
    assert one.gain == pytest.approx(np.mean(np.log(before / expected)))
    assert one.words == (
        f"the paint would bring paint.b from +- {before[1]:.2g} to +- {expected[1]:.2g}, "
        f"a.temperature from +- {before[0]:.2g} to +- {expected[0]:.2g} K"
    )


def test_unknowns_that_come_with_a_measurement():
    """A second temperature, known to its span of 100 K, is eliminated."""
    state, found = estimate()
    new = np.array([[0.0, 0.0, 0.0], [0.0, 9000.0, 30.0], [0.0, 30.0, 1.0]])
    (one,) = advice(UNKNOWNS, state, found, [Proposal("more", new, (kelvin("c.temperature"),))])
    whole = np.zeros((3, 3))
    whole[:2, :2] = INFORMATION + np.diag(PRIOR)
    whole[2, 2] = 100.0**-2
    expected = np.sqrt(np.diag(np.linalg.inv(whole + new)))[:2]
    assert list(one.errors.values()) == pytest.approx(expected)


def test_a_proposal_is_worth_a_fifth_of_an_error():
    """Of an unknown alone: from an error of 1 to 0.81 or 0.79."""
    ones = [unknown("a", kind="emissivity")]
    state = SimpleNamespace(
        equations=SimpleNamespace(information=np.ones((1, 1))), prior=np.zeros(1), model_errors=0.0
    )
    found = answers(ones, estimated([0.3], np.ones((1, 1))))
    for error, count in ((0.81, 0), (0.79, 1)):
        proposal = Proposal("it", np.array([[error**-2.0 - 1]]))
        assert len(advice(ones, state, found, [proposal])) == count


def test_priors_that_are_proposed():
    ones = [
        kelvin("t"),
        unknown("a", prior=(0.3, 0.1)),
        unknown("b", prior=(0.3, 0.01)),
        unknown("gain [c]", kind="gain"),
        unknown("e", kind="emissivity"),
    ]
    found = {one.measure: one.information for one in priors(ones)}
    assert list(found) == ["knowing t to +- 1 K", "knowing a to +- 0.01", "knowing e to +- 0.01"]
    for measure, k, sigma in zip(found, (0, 1, 4), (1.0, 0.01, 0.01)):
        expected = np.zeros((5, 5))
        expected[k, k] = sigma**-2
        np.testing.assert_allclose(found[measure], expected)


def test_information_of_a_measurement_that_is_not_made():
    """J^T J / sigma^2, whatever the measured values are."""
    J = np.random.default_rng(0).normal(size=(9, 2))
    found = information(block([np.ones(9)], [J], np.full(9, np.nan), 0.3), np.zeros(2))
    np.testing.assert_allclose(found, J.T @ J / 0.09)


def test_lists_of_names():
    assert listed(["a", "b"]) == "a, b" and listed(list("abcde")) == "a, b, c and 2 more"


class Camera:
    """An image of n values with columns of its own unknowns that depend on the values x."""

    def __init__(self, number, is_image=True, scene=None):
        self.number, self.is_image, self.scene = number, is_image, scene
        self.J = np.random.default_rng(number).normal(size=(9, 8))

    def numbers(self, unknowns):
        return [k for k, one in enumerate(unknowns) if self.number in one.data]

    def block(self, unknowns, x, sampling):
        columns = self.J[:, : len(self.numbers(unknowns))] * x[self.numbers(unknowns)]
        return block([np.ones(9)], [columns], np.ones(9), unknown=np.array(self.numbers(unknowns)))

    def weighing(self, unknowns, x, sampling):
        return Weighing(np.full(9, 4.0))

    def expected(self, unknowns, x, count):
        own = self.numbers(unknowns)
        J = np.zeros((9, count))
        J[:, own] = self.J[:, : len(own)] * x[own]
        return J


def informed(J):
    """4 J^T J is the matrix, and 16 J^T J its noise of unit variance: J^T J."""
    return J.T @ J


def test_information_of_further_measurements():
    """Datum 2 sees a shared unknown, and one that only it and datum 3 have."""
    ones = [kelvin("a", data=(0, 1)), unknown("b", data=(1,))]
    everything = [
        kelvin("a", data=(0, 1, 2)),
        unknown("b", data=(1,)),
        kelvin("c", start=310.0, data=(2, 3)),
        kelvin("d", data=(3,)),
    ]
    proposed = {"one": [Camera(2)], "two": [Camera(2), Camera(3)]}
    x = np.array([300.0, 0.4])
    one, two = measurements(ones, x, everything, proposed, None)
    assert [e.label for e in one.extra] == ["c"] and [e.label for e in two.extra] == ["c", "d"]
    shared = [everything[0], everything[1]]
    J = Camera(2).expected([*shared, everything[2]], np.append(x, 310.0), 3)
    np.testing.assert_allclose(one.information, informed(J), rtol=1e-6, atol=1e-6)
    values = np.append(x, [310.0, 300.0])
    both = [Camera(k).expected([*shared, *everything[2:]], values, 4) for k in (2, 3)]
    np.testing.assert_allclose(two.information, sum(map(informed, both)), rtol=1e-6, atol=1e-6)
    assert measurements(ones, x, everything, {}, None) == []


def scene_of(parameters):
    return SimpleNamespace(
        parameters={
            name: SimpleNamespace(kind=kind, value=value)
            for name, (kind, value) in parameters.items()
        }
    )


def test_known_surroundings():
    """Temperatures of whole groups of which nothing is unknown."""
    camera = Camera(0)
    camera.where = scene_of(
        {
            "sky.temperature": ("temperature", 280.0),
            "lid.temperature": ("temperature", 300.0),
            "lid@300.temperature": ("temperature", 300.0),
            "wall.temperature": ("temperature", 290.0),
            "wall@290.temperature": ("temperature", 290.0),
            "paint.b": ("material", 0.3),
        }
    )
    ones = [kelvin("lid.temperature"), unknown("paint.b"), kelvin("x", name="wall@290.temperature")]
    assert surroundings(camera, ones) == {"sky.temperature": 280.0}


def test_a_hotter_state(monkeypatch):
    """Temperatures, 20 K higher, are unknown anew; the paint is the same. Numbers do not count."""
    changes = []

    @contextmanager
    def changed(scene, values):
        changes.append(values)
        yield

    monkeypatch.setattr(module, "changed", changed)
    ones = [unknown("paint.b"), kelvin("lid.temperature", prior=(300, 1), upper=310.0)]
    camera, number = Camera(0), Camera(0, is_image=False)
    camera.where = scene_of({"sky.temperature": ("temperature", 280.0)})
    x = np.array([0.3, 305.0])
    hot, sky = other_states(ones, x, [camera, number], None)
    assert hot.measure.startswith("a second state with lid.temperature 20 K hotter")
    (extra,) = hot.extra
    assert (extra.start, extra.prior, extra.upper) == (325.0, None, np.inf)
    J = camera.expected(ones, np.array([0.3, 325.0]), 2)
    expected = np.zeros((3, 3))
    expected[np.ix_([0, 2], [0, 2])] = informed(J)
    np.testing.assert_allclose(hot.information, expected, rtol=1e-6, atol=1e-6)
    assert changes == [{"sky.temperature": 300.0}]
    assert sky.measure == (
        "a second state with the surroundings (sky) 20 K hotter by a known amount"
    )
    known = informed(camera.expected(ones, x, 2))
    np.testing.assert_allclose(sky.information, known, rtol=1e-6, atol=1e-6)
    assert other_states(ones, x, [number], None) == []


def test_other_bands(monkeypatch):
    """Images with a NETD, in scenes with a parameter `band`, in the bands that they lack."""
    monkeypatch.setattr(module, "survey", lambda path, parameters: parameters)

    def image(number, band="LWIR", netd_mK=50.0, is_image=True, parameters=("band",)):
        scene = SimpleNamespace(
            path="s", parameters=dict.fromkeys(parameters), band=SimpleNamespace(name=band)
        )
        camera = Camera(number, is_image, scene)
        camera.entry = Observation("s", f"i{number}", {"T": 3}, 0, "hot", netd_mK)
        return camera

    class Loader:
        def datum(self, candidate, number, groups):
            made.append(candidate)
            return number

    made = []
    data = [image(0), image(1, "MWIR"), image(2, netd_mK=None), image(3, is_image=False)]
    data.append(image(4, parameters=("T",)))
    found = other_bands(data, Loader(), 7)
    assert found == {"the same image in MWIR": [7], "the same image in LWIR": [8]}
    assert [(one.name, one.parameters) for one in made] == [
        ("i0 in MWIR", {"T": 3, "band": "MWIR"}),
        ("i1 in LWIR", {"T": 3, "band": "LWIR"}),
    ]
    assert {(one.state, one.netd_mK) for one in made} == {("hot", 50.0)}
    assert list(other_bands([image(0), image(1)], Loader(), 2)) == ["the same images in MWIR"]
