"""Components of three-dimensional noise, against noise whose parts are drawn here."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair import formats
from mi_lcair.errors import InputError
from mi_lcair.laboratory.noise import NoiseComponents

GIVEN = NoiseComponents(50.0, 30.0, 10.0, 8.0, 15.0, 12.0, 6.0)
SIDES = {"t": 200, "v": 48, "h": 64}


def parts(seed: int) -> dict[str, np.ndarray]:
    """The parts of noise, each an array over the letters of its name."""
    random = np.random.default_rng(seed)
    return {
        name: sigma
        * random.standard_normal([n if k in name.split("_")[1] else 1 for k, n in SIDES.items()])
        for name, sigma in GIVEN._asdict().items()
    }


def test_parts_are_recovered():
    """Within 5 % of the standard deviations of the parts that were drawn."""
    drawn = parts(4)
    measured = NoiseComponents.of(290e3 + sum(drawn.values()))
    for name, part in drawn.items():
        assert getattr(measured, name) == pytest.approx(part.std(ddof=1), rel=0.05), name


@pytest.mark.parametrize("name", GIVEN._fields)
def test_a_part_leaves_the_others_at_zero(name):
    """No part holds a share of another: without pixel noise the others are rounding alone."""
    part = parts(5)[name]
    measured = NoiseComponents.of(300.0 + np.broadcast_to(part, tuple(SIDES.values())))
    for other, value in measured._asdict().items():
        if other == name:
            assert value == pytest.approx(part.std(ddof=1), rel=0.02)
        else:  # by chance the samples of a part resemble parts of fewer letters
            assert value < (1.2 if len(other) < len(name) else 1e-3), other


def test_variances_have_no_bias_in_few_frames():
    """The mean of 400 variances of 4 frames of 5 x 6 pixels is within 4 of its standard errors."""
    random, sides = np.random.default_rng(6), {"t": 4, "v": 5, "h": 6}
    squares = []
    for _ in range(400):
        frames = 0.0
        for name, sigma in {"tvh": 3.0, "vh": 4.0, "tv": 4.0, "th": 5.0}.items():
            frames = frames + sigma * random.standard_normal(
                [n if k in name else 1 for k, n in sides.items()]
            )
        squares.append(np.square(NoiseComponents.of(frames)))
    squares = np.array(squares)[:, :4]
    error = squares.std(axis=0, ddof=1) / np.sqrt(len(squares))
    assert np.all(abs(squares.mean(axis=0) - [9, 16, 16, 25]) < 4 * error)


def test_few_samples_are_refused():
    for shape in ((1, 5, 5), (5, 1, 5), (5, 5)):
        with pytest.raises(InputError, match="two or more of each"):
            NoiseComponents.of(np.zeros(shape))


@pytest.mark.parametrize(
    "second, message",
    [
        (np.zeros((4, 5, 3)), r"frame 2 has the shape \(4, 5, 3\)"),  # as of a colour picture
        (np.zeros((5, 4)), r"frame 2 has the shape \(5, 4\)"),
        (np.full((4, 5), np.nan), "frame 2 has values that are not finite"),
    ],
)
def test_frames_that_are_not_alike_are_refused(second, message):
    with pytest.raises(InputError, match=message):
        NoiseComponents.of([np.zeros((4, 5)), second, second])


def test_frames_of_a_file(tmp_path):
    """The pages of a TIFF are the frames; one page or another file is refused in one line."""
    counts = np.random.default_rng(8).integers(0, 2**16, (5, 6, 7)).astype(np.uint16)
    formats.write_tiff(tmp_path / "frames.tif", counts)
    assert mi_lcair.noise_components(tmp_path / "frames.tif") == NoiseComponents.of(counts)
    (tmp_path / "no.tif").write_text("no picture")
    with pytest.raises(InputError, match=r"no\.tif: has no frames that can be read: not an image$"):
        mi_lcair.noise_components(tmp_path / "no.tif")


def test_components_in_words():
    words = NoiseComponents(0.05, 0.03, 0.0, 0.008, 0.015, 0.012, 0.006).in_mK()
    assert words.startswith("sigma_tvh 50 mK, sigma_vh 30 mK, sigma_tv 0 mK, sigma_th 8 mK")
