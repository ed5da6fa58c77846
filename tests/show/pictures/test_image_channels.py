"""Tests of pictures: place, colour and unit of each pixel, and images with few values."""

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.image import imread

from mi_lcair.drawing import write_figure
from mi_lcair.errors import InputError
from mi_lcair.show.page.model_panel import scales
from mi_lcair.show.pictures.comparison import figure as comparison
from mi_lcair.show.pictures.image_channels import WHOLE, around_target, figure, limits_of_channel

GREY = (0.6, 0.6, 0.6)
BLUE = to_rgb("steelblue")


def save_picture(path, *args, **options):
    """Write the picture of some channels."""
    write_figure(figure(*args, **options), path)


def colour_at(path, figure, row, column):
    """Colour in the PNG of the middle of a pixel of the first panel's image."""
    image = imread(path)
    x, y = figure.axes[0].transData.transform((column, row))
    return image[image.shape[0] - 1 - int(y), int(x), :3]


@pytest.mark.slow
def test_pixels_lie_where_the_axes_say(tmp_path, figures):
    """Row 0 is at the top and column 0 at the left. The scale spans all values."""
    values = np.array([[1, 2, 3], [3, 3, 1]], np.float32)
    save_picture(tmp_path / "a.png", {"Y": values})
    inferno = colormaps["inferno"]
    for row, column in np.ndindex(2, 3):
        expected = inferno((values[row, column] - 1) / 2)[:3]
        np.testing.assert_allclose(
            colour_at(tmp_path / "a.png", figures[0], row, column), expected, atol=0.01
        )
    top_left, bottom_right = (figures[0].axes[0].transData.transform(at) for at in ((0, 0), (2, 1)))
    assert top_left[0] < bottom_right[0] and top_left[1] > bottom_right[1]


@pytest.mark.slow
def test_logarithmic_colours(tmp_path, figures):
    """On a logarithmic scale 10 is half way between 1 and 100.

    Zeros and negative values are grey.
    """
    save_picture(
        tmp_path / "a.png", {"Y": np.array([[1, 10, 100], [0, -1, 100]], np.float32)}, log=True
    )
    colours = [colour_at(tmp_path / "a.png", figures[0], 0, column) for column in range(3)]
    np.testing.assert_allclose(colours, colormaps["inferno"]([0.0, 0.5, 1.0])[:, :3], atol=0.01)
    for column in (0, 1):
        np.testing.assert_allclose(
            colour_at(tmp_path / "a.png", figures[0], 1, column), GREY, atol=0.01
        )


def test_a_logarithmic_scale_ends_six_decades_below_the_largest_value(tmp_path, figures):
    """A value of 1e-30 does not extend the scale. The colour bar shows that it is clipped."""
    save_picture(tmp_path / "a.png", {"Y": np.array([[1e-30, 1, 100]])}, log=True)
    bar = figures[0].axes[1]
    assert bar.get_ylim() == pytest.approx((1e-4, 100))
    np.testing.assert_allclose(
        colour_at(tmp_path / "a.png", figures[0], 0, 0), colormaps["inferno"](0.0)[:3], atol=0.01
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, label",
    [
        ("Y", r"radiance (W m⁻² sr⁻¹)"),
        ("bounce00.Y", r"radiance (W m⁻² sr⁻¹)"),
        ("group.range.Y", r"radiance (W m⁻² sr⁻¹)"),
        ("stderr.Y", r"standard error of radiance (W m⁻² sr⁻¹)"),
        ("sigma.Y", r"standard uncertainty of radiance (W m⁻² sr⁻¹)"),
        ("d.sky.radiance.Y", r"derivative of radiance (W m⁻² sr⁻¹ per unit)"),
        ("temperature.Y", "brightness temperature (K)"),
        ("range.Y", "range (m)"),
    ],
)
def test_units(tmp_path, figures, name, label):
    save_picture(
        tmp_path / "a.png", {name: np.array([[300.0, 300.0001]])}, "two_plates, MWIR 3-5 um"
    )
    panel, bar = figures[0].axes
    assert bar.get_ylabel() == label
    assert panel.get_title() == f"two_plates, MWIR 3-5 um, {name}"
    assert bar.yaxis.get_offset_text().get_text() == ""  # no "+3e2" to be added in the head


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, nothing, is_grey",
    [
        ("range.Y", 0.0, True),
        ("range.Y", np.inf, True),
        ("temperature.Y", 0.0, True),
        ("Y", np.nan, True),
        ("Y", 0.0, False),
    ],
)
def test_pixels_without_a_value(tmp_path, figures, name, nothing, is_grey):
    """Pixels without a range or a temperature do not extend the scale, and are grey.

    They are blue where the scale is grey. A radiance of 0 is a value.
    """
    save_picture(tmp_path / "a.png", {name: np.array([[nothing, 300.0, 310.0]])})
    panel, bar = figures[0].axes
    assert bar.get_ylim() == ((300, 310) if is_grey else (0, 310))
    word, colour = ("blue", BLUE) if name == "temperature.Y" else ("grey", GREY)
    drawn = colour_at(tmp_path / "a.png", figures[0], 0, 0)
    assert np.allclose(drawn, colour, atol=0.01) == is_grey
    assert (f"{word}: no value" in panel.get_xlabel()) == is_grey


@pytest.mark.slow
@pytest.mark.parametrize("log", [False, True])
@pytest.mark.parametrize(
    "values",
    [
        np.full((3, 4), 36.0),
        np.zeros((3, 4)),
        np.full((3, 4), np.nan),
        np.full((3, 4), -2.0),
        np.full((1, 1), 1e-35),
        np.full((1, 1), 1e35),
        np.ones((200, 2)),
        36 + 1e-5 * np.arange(12.0).reshape(3, 4),
    ],
    ids=["constant", "zero", "nan", "negative", "tiny", "huge", "tall", "narrow"],
)
def test_images_with_little_to_show(tmp_path, figures, values, log):
    """The scale holds all values, and nothing warns (warnings are errors in the tests)."""
    save_picture(tmp_path / "a.png", {"Y": values.astype(np.float32)}, "scene", log=log)
    lower, upper = figures[0].axes[1].get_ylim()
    shown = values[np.isfinite(values) & ((values > 0) | (not log))]
    assert lower < upper
    assert np.all((lower <= shown * 1.0001) | (shown < 0)) and np.all(
        (shown <= upper * 1.0001) | (shown < 0)
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "value, limits", [(0.0, (0, 1)), (36.0, (34.2, 37.8)), (-2.0, (-2.1, -1.9))]
)
def test_a_constant_lies_in_the_middle_of_its_scale(tmp_path, figures, value, limits):
    """A constant image has a scale around its value; that of 0 begins at 0."""
    save_picture(tmp_path / "a.png", {"Y": np.full((2, 2), value)})
    assert figures[0].axes[1].get_ylim() == pytest.approx(limits)


@pytest.mark.slow
@pytest.mark.parametrize("log", [False, True])
def test_numbers_that_cannot_be_drawn(tmp_path, log):
    """Very small and very large values are drawn; values that are too large are refused."""
    for values in ([1e-320, 1e-310], [5e-324, 1e37], [-1e37, 1e37], [np.nan, np.inf]):
        save_picture(tmp_path / "a.png", {"Y": np.array([values, values])}, log=log)
    for values in ([1e308, -1e308], [3e38, 0]):
        with pytest.raises(InputError, match="Y: has .*; values up to 1e.37 can be drawn"):
            save_picture(tmp_path / "b.png", {"Y": np.array([values, values])}, log=log)
    assert [file.name for file in tmp_path.iterdir()] == ["a.png"]


@pytest.mark.slow
def test_names_are_no_formulas(tmp_path, figures):
    """Dollar signs in a title or channel do not begin mathematics."""
    for channels in (["$\\bad$.Y"], ["$\\bad$.Y", "Y"]):
        save_picture(tmp_path / "a.png", {name: np.ones((2, 2)) for name in channels}, "$\\worse$")


def test_names_are_one_short_line(tmp_path, figures):
    save_picture(tmp_path / "a.png", {"a\x1b[31m\nb": np.ones((2, 2))}, "t" * 10_000)
    (title,) = [figures[0].axes[0].get_title()]
    assert len(title) <= 120 and title.isprintable() and title.endswith(r"a\x1b[31m b")


@pytest.mark.slow
def test_a_montage_gives_each_channel_its_own_scale(tmp_path, figures):
    """Each channel has a panel and a colour bar, in the given order and without overlaps."""
    channels = {f"bounce{k:02d}.Y": np.linspace(0, 10.0**-k, 12).reshape(3, 4) for k in range(5)}
    save_picture(tmp_path / "a.png", channels, "cavity", common_scale=False)
    panels, bars = figures[0].axes[::2], figures[0].axes[1::2]
    assert [panel.get_title() for panel in panels] == list(channels)
    assert [bar.get_ylim()[1] for bar in bars] == pytest.approx([10.0**-k for k in range(5)])
    boxes = [axes.get_tightbbox() for axes in figures[0].axes]
    panels_and_bars = [box.union(boxes[2 * k : 2 * k + 2]) for k, box in enumerate(boxes[::2])]
    for k, box in enumerate(panels_and_bars):
        assert not any(box.overlaps(other) for other in panels_and_bars[:k])
        assert (
            box.x0 >= 0
            and box.x1 <= figures[0].bbox.x1
            and box.y0 >= 0
            and box.y1 <= figures[0].bbox.y1
        )


def test_nothing_is_written_where_nothing_can_be(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        save_picture(tmp_path / "nowhere" / "a.png", {"Y": np.ones((2, 2))})


def test_an_interrupted_picture_leaves_nothing(tmp_path, monkeypatch):
    def interrupted(self, path, **kwargs):
        path.write(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(Figure, "savefig", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save_picture(tmp_path / "a.png", {"Y": np.ones((2, 2))})
    assert list(tmp_path.iterdir()) == []


def test_channels_of_one_quantity_share_a_scale(tmp_path, figures):
    """Two different radiances must not look the same; temperatures have a scale of their own."""
    ones = np.ones((2, 2))
    channels = {"Y": ones, "target.Y": 5 * ones, "temperature.Y": 300 * ones}
    save_picture(tmp_path / "a.png", channels)
    first, second, kelvin = (bar.get_ylim() for bar in figures[0].axes[1::2])
    assert first == second == (1, 5) and kelvin == pytest.approx((285, 315))


def test_fireflies_do_not_stretch_the_scale(tmp_path, figures):
    values = np.random.default_rng(0).random((50, 50)) + 1
    values[7, 7], values[8, 8] = 1e4, 2e4
    save_picture(tmp_path / "a.png", {"Y": values})
    panel, bar = figures[0].axes
    assert 1.9 < bar.get_ylim()[1] < 2.1 and bar.get_ylim()[0] == pytest.approx(1, abs=0.01)
    assert panel.get_xlabel().endswith("values to 2e+04")
    # A target of few pixels on an even background keeps its scale
    values = np.ones((50, 50))
    values[7, 7] = 100
    save_picture(tmp_path / "b.png", {"Y": values})
    assert figures[1].axes[1].get_ylim() == (1, 100)


def test_only_a_panel_whose_pixels_are_cut_off_says_so(tmp_path, figures):
    values = np.random.default_rng(0).random((50, 50)) + 1
    values[7, 7] = 2e4
    save_picture(tmp_path / "a.png", {"Y": values, "target.Y": np.full((50, 50), 1.5)})
    panel, _, other, other_bar = figures[0].axes
    assert panel.get_xlabel().endswith("values to 2e+04")
    assert other.get_xlabel() == "column (pixel)" and 1.9 < other_bar.get_ylim()[1] < 2.1


def test_edges_do_not_stretch_the_scale_of_a_temperature(tmp_path, figures):
    """3 % of the pixels see the object in a part of their area; a cold half of it stays."""
    values = np.linspace(290, 330, 2500).reshape(50, 50)
    values[:, 20][:40], values[:, 30][:35] = 150, 200
    save_picture(tmp_path / "a.png", {"temperature.Y": values})
    panel, bar = figures[0].axes
    assert 288 < bar.get_ylim()[0] < 295 and bar.get_ylim()[1] == 330
    assert panel.get_xlabel().endswith("values from 150")
    values[25:] = 100
    save_picture(tmp_path / "b.png", {"temperature.Y": values})
    assert figures[1].axes[1].get_ylim() == (100, pytest.approx(310, abs=1))


def test_pages_have_the_limits_of_pictures(tmp_path, figures):
    """Also for a page of facets, whose areas say how few they are."""
    rng = np.random.default_rng(1)
    channels = {
        "Y": 2 + rng.random((30, 30)),
        "temperature.Y": 300 + rng.random((30, 30)),
        "d.self.temperature": rng.random((30, 30)) - 0.7,
    }
    channels["Y"][0, :3], channels["temperature.Y"][:, 4] = 90, 120  # .3 % hot, 3 % on an edge
    for log in (False, True):
        save_picture(tmp_path / "a.png", channels, log=log, common_scale=False)
        for (name, values), bar in zip(channels.items(), figures[-1].axes[1::2]):
            limits = scales(name, values)["log_limits" if log else "limits"]
            assert bar.get_ylim() == pytest.approx(limits)
    assert figures[0].axes[1].get_ylim()[1] < 3.01 and figures[0].axes[3].get_ylim()[0] > 299.9
    assert figures[0].axes[5].get_ylim() == pytest.approx((-0.7, 0.7), abs=0.01)
    assert figures[0].axes[4].images[0].get_cmap().name == "RdBu_r"
    radiances, areas = np.array([1.0, 2.0, 3.0, 500.0]), np.array([5.0, 9.0, 5.0, 0.01])
    assert scales("radiance_W_m2_sr", radiances, areas)["limits"] == (1, 3)
    assert scales("radiance_W_m2_sr", radiances, np.ones(4))["limits"] == (1, 500)


def test_two_images_and_their_difference(figures):
    """One scale for both, and one with 0 in its middle; mean and rms over what both know."""
    first = {"temperature.Y": np.array([[300.0, 310.0, 0.0], [305.0, 305.0, 305.0]])}
    second = {"temperature.Y": first["temperature.Y"] + [[0.0, 20.0, 300.0], [-10.0, 0.0, 0.0]]}
    panels = comparison((first, second), ("a.exr", "b.exr"), vmin=290.0, cmap="viridis").axes
    titles = [panel.get_title() for panel in panels[::2]]
    assert titles[:2] == ["temperature.Y: a.exr", "temperature.Y: b.exr"]
    assert titles[2] == "difference.temperature.Y: mean 2, rms 10"
    assert [bar.get_ylim() for bar in panels[1::2]] == [(290, 330), (290, 330), (-20, 20)]
    assert [panel.images[0].get_cmap().name for panel in panels[::2]] == 2 * ["viridis"] + [
        "RdBu_r"
    ]
    assert (
        panels[4].images[0].get_array()[0, 1] == 20 and panels[4].images[0].get_array().mask[0, 2]
    )
    with pytest.raises(InputError, match="a and b: have 3 x 2 and 2 x 2 pixels"):
        comparison((first, {"temperature.Y": np.ones((2, 2))}), ("a", "b"))


def test_limits_and_colours_that_are_given(tmp_path, figures):
    values = np.array([[1.0, 2.0, 3.0]])
    save_picture(tmp_path / "a.svg", {"Y": values}, vmin=1.5, vmax=2.5, cmap="gray")
    panel, bar = figures[0].axes
    assert bar.get_ylim() == (1.5, 2.5) and panel.images[0].get_cmap().name == "gray"
    assert panel.images[0].colorbar.extend == "both"
    for options, message in (
        ({"vmin": 5.0}, "vmin = 5.0: the scale must rise"),
        ({"vmin": 2.0, "vmax": 2.0}, "vmin = 2 and vmax = 2"),
        ({"vmax": float("nan")}, "vmax = nan"),
        ({"vmin": 0.0, "log": True}, "above 0 on a logarithmic scale"),
        ({"cmap": "infrno"}, "unknown colour map 'infrno'; known: inferno"),
    ):
        with pytest.raises(InputError, match=message):
            save_picture(tmp_path / "b.png", {"Y": values}, **options)
    assert not (tmp_path / "b.png").exists()


def test_axes_in_metres_and_outlines(tmp_path, figures):
    """The line between two facets is where the pixels change, in metres from the middle."""
    facets = np.array([[0, 0, 1, 1], [0, 0, 1, 1]])
    save_picture(tmp_path / "a.png", {"Y": facets + 1.0}, window_m=(8.0, 2.0), outlines=facets)
    panel = figures[0].axes[0]
    assert panel.get_xlabel() == "x (m)" and panel.get_ylabel() == "y (m)"
    assert panel.get_xlim() == (-4, 4) and panel.get_ylim() == (-1, 1)
    ends = np.concatenate(panel.collections[0].get_segments())
    assert set(ends[:, 0]) == {0.0} and set(ends[:, 1]) == {-1.0, 0.0, 1.0}
    box = panel.get_window_extent()
    assert box.width / box.height == pytest.approx(4, rel=1e-6)


def test_a_small_target_sets_the_scale_of_its_frame():
    """The optics blur its error over the frame, down to rounding."""
    kelvin, error = np.full((64, 64), 281.0), np.full((64, 64), 1e-13)
    kelvin[30:34, 20:40] += np.linspace(1, 6, 20)
    error[30:34, 20:40] = 0.1
    channels = {"temperature.Y": kelvin, "stderr_K.Y": error}
    part = around_target(channels)
    assert part == (slice(30, 34), slice(20, 40))
    limits = limits_of_channel("temperature.Y", [kelvin[part].ravel()], log=False)
    assert (limits.lower, limits.upper) == (282.0, 287.0)
    assert around_target({"temperature.Y": kelvin}) == WHOLE
