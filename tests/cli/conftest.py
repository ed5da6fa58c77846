"""Fixtures of the command line's tests: calls, and a substitute for the renderer."""

from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

import mi_lcair
from mi_lcair.cli import main


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Empty folder in which the commands run."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("MI_LCAIR_DEBUG", raising=False)
    return tmp_path


@pytest.fixture
def run():
    """Function that calls the command line in this process."""
    return lambda *args: CliRunner().invoke(main, [str(arg) for arg in args])


@pytest.fixture
def refused(run):
    """Function that makes a call which must be refused, and returns its message.

    The call must end with exit status 2, one line on stderr and nothing on stdout.
    """

    def message(*args):
        result = run(*args)
        assert (result.exit_code, result.stdout, result.stderr.count("\n")) == (2, "", 1), (
            result.output
        )
        assert result.stderr.startswith("mi-lcair: ")
        return result.stderr

    return message


class Renderer:
    """Substitute for mi_lcair.load, render and signature.

    It records its arguments, and returns `results` or raises `error`.
    """

    error = None
    remarks = ()
    results = {}

    def load(self, scene, /, **parameters):
        self.loaded = (scene, parameters)
        return SimpleNamespace(name="the scene", remarks=self.remarks)

    def render(self, scene, **sampling):
        self.asked(scene, **sampling)
        from mi_lcair.physics.bands import band
        from mi_lcair.rendering.images.render import Render

        return Render(
            **{
                "channels": {"Y": np.full((2, 3), 5, np.float32)},
                "header": {"band": "MWIR", "spp": 16},
                "spp": 16,
                "band": band("MWIR"),
                "mean": 5.25,
                "mean_error": 0.5,
                "rms_error": 0.0125,
                "reached": None,
                "invalid": 0,
                "closure_error": None,
                "paths": 96,
                "seconds": 1.5,
                "scene_name": "cavity",
                "window_m": (0.3, 0.2),
                "tolerance": sampling["tolerance"],
                **self.results,
            }
        )

    def signature(self, scene, by_spectrum, facets, **sampling):
        from mi_lcair.signatures.signature import Intensity, Signature

        self.asked(scene, **sampling)
        scene = {
            "intensity": 22.0755,
            "standard_error": 0.0021,
            "half_width": 0.005,
            "by_bounce": [20.0, 2.0755],
            "by_bounce_error": [0.0, 0.0021],
            "by_group": {"hot": 21.0, "self": 1.0755},
            "by_group_error": {"hot": 0.002, "self": 0.0},
            "by_seen": {"plate": 22.0755},
            "by_seen_error": {"plate": 0.0021},
            "closure": 0.0,
        }
        own = {name: value for name, value in self.results.items() if name in scene}
        target = {**scene, "intensity": 11.5, "by_bounce": [10.0, 1.5], **own}
        return Signature(
            scene_name="two_plates",
            band="total",
            scene=Intensity(**scene),
            target=Intensity(**target),
            effective_areas=None,
            facets=None,
            window_area=0.06,
            seconds=1.5,
            paths=2**32,
            invalid=self.results.get("invalid", 0),
            degrees_of_freedom=7,
            missed=0.0,
            systematic=1e-7,
            tolerance=sampling["tolerance"],
            reached=self.results.get("reached"),
        )

    def asked(self, scene, progress, **sampling):
        assert scene.name == "the scene"
        self.sampling = sampling
        progress(1, 4)
        progress(4, 4)
        if self.error:
            raise self.error


@pytest.fixture
def renderer(monkeypatch):
    renderer = Renderer()
    for name in ("load", "render", "signature"):
        monkeypatch.setitem(vars(mi_lcair), name, getattr(renderer, name))
    return renderer
