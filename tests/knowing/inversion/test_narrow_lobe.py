"""The width of a narrow lobe from one image of what it reflects."""

import mitsuba as mi
import pytest

import mi_lcair
from tests.knowing.inversion import ball
from tests.knowing.inversion.corner import clean
from tests.matrix import some_of

mi.set_variant("llvm_ad_mono")


@pytest.mark.slow
@pytest.mark.parametrize("e, start, draw", some_of([(0.004, 0.6, 0), (0.03, 1.5, 1)], 2))
def test_width_of_gloss_black(tmp_path, e, start, draw):
    """A ball of 450 K is reflected; each width with a draw of the camera's noise."""
    path = ball.write_scene(tmp_path, e)
    image = clean(path, 4096)
    problem = ball.problem(tmp_path, path, image, start * e, draw)
    (answer,) = mi_lcair.invert(problem, advise=False).answers
    assert answer.verdict == "determined"
    assert abs(answer.value - e) < 3 * answer.standard_error
    assert answer.standard_error < 0.03 * e
