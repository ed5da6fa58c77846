"""Picture of a model: what is seen from each side, in which colour, on axes in metres."""

from io import BytesIO

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from mi_lcair.models3d import read
from mi_lcair.show.pictures import model as model_picture
from mi_lcair.show.pictures.model import (
    BACK,
    BEHIND,
    NOTHING,
    VIEWS,
    figure,
    nearest_triangles,
    png,
)
from tests.models3d.shapes import SIDES, cube, obj

SIDE_NAMES = ("tail", "nose", "right", "left", "bottom", "top")


@pytest.fixture
def load(tmp_path):
    def load(text):
        (tmp_path / "model.obj").write_text(text)
        return read(tmp_path / "model.obj")

    return load


def seen(model, view):
    """The facet in each pixel of a view, NOTHING or BEHIND."""
    box, longest = model_picture._window(model)
    image = model_picture._triangles_seen(model, view, box, longest / 50)
    return np.where(image >= 0, model.triangle_facet[np.maximum(image, 0)], image)


def test_the_nearest_triangle():
    """Two triangles of which the second is nearer on the left of x = 4 only; pixel by pixel."""
    points = np.array([[(0, 0), (8, 0), (0, 8)], [(0, 0), (8, 0), (0, 8)]], float)
    depth = np.array([[4, 4, 4], [8, 0, 8]], float)  # 8 - x
    image = nearest_triangles(points, depth, (10, 9))
    rows, columns = np.indices((10, 9)) + 0.5
    inside = columns + rows <= 8
    assert (image == np.where(inside, np.where(columns < 4, 1, 0), NOTHING)).all()


def test_pieces_of_the_work_make_no_difference(monkeypatch):
    random = np.random.default_rng(1)
    points, depth = random.uniform(-3, 33, (200, 3, 2)), random.uniform(0, 1, (200, 3))
    whole = nearest_triangles(points, depth, (30, 20))
    monkeypatch.setattr(model_picture, "AT_ONCE", 100)
    assert (nearest_triangles(points, depth, (30, 20)) == whole).all()
    assert len(np.unique(whole)) > 20


def test_each_view_sees_its_side(load):
    """The views see left side, nose and top of a box; the nose is at the left of the first."""
    model = load(cube(size=2) + obj([(2.5, y, z) for y in (0, 2) for z in (0, 1)], [(0, 2, 3, 1)]))
    for view, side in zip(VIEWS, ("left", "nose", "top")):
        image = seen(model, view)
        middle = image[image.shape[0] * 3 // 5, image.shape[1] // 2]
        assert SIDE_NAMES[middle] == side or (side, middle) == ("nose", 6), view.title
    # The upright sheet before the nose covers the lower half of it
    front = seen(model, VIEWS[1])
    assert np.count_nonzero(front == 6) == pytest.approx(np.count_nonzero(front == 1), rel=0.1)
    rows, _ = np.nonzero(front == 6)
    assert rows.max() < np.nonzero(front == 1)[0].min() + 1


def test_backs(load):
    """The back of a model's facet has a colour of its own; those of a room hide nothing."""
    assert (seen(load(cube(flip=[3])), VIEWS[0]) == BEHIND).any()
    room = cube(at=(-5, -5, -5), size=11, flip=range(6), label="s*blackbody*250*")
    image = seen(load(cube() + room), VIEWS[0])
    assert not (image == BEHIND).any() and SIDE_NAMES[image[20, image.shape[1] // 2]] == "left"


def test_axes_in_metres(load):
    """Each panel's axes have the limits of the model and a margin, in metres."""
    points = [(x, y, z) for x in (0, 4) for y in (0, 2) for z in (0, 1)]
    drawn = figure(load(obj(points, SIDES)), "a $title")
    left, front, top = drawn.axes
    assert [(panel.get_xlabel(), panel.get_ylabel()) for panel in (left, front, top)] == [
        ("x (m)", "z (m)"),
        ("y (m)", "z (m)"),
        ("x (m)", "y (m)"),
    ]
    assert left.get_xlim()[0] > 4 and left.get_xlim()[1] < 0  # the nose is on the left
    assert front.get_xlim()[0] < 0 and front.get_xlim()[1] > 2
    assert top.get_ylim()[0] > 2 and top.get_ylim()[1] < 0
    words = [[text.get_text() for text in panel.texts] for panel in (left, front, top)]
    assert [set(filter(None, own)) for own in words] == [{"nose", "up"}, {"up"}, {"nose"}]


def test_materials_have_names(load):
    model = load(cube() + cube(at=(2, 0, 0), label="f*glossBlack*350*"))
    (legend,) = figure(model).legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "bare_aluminum (model)",
        "gloss_black (model)",
    ]


@pytest.mark.parametrize("corner", [(1, 0, 0), (0, 0, 9)])
def test_a_flat_model(load, corner):
    """A model without thickness is drawn, also edge on; a name that no font has is no error."""
    model = load(obj([(0, 0, 0), corner, (0, 1, 0)], [(0, 1, 2)]))
    image = np.array(Image.open(BytesIO(png(model, "模型"))).convert("RGB"))
    assert image.shape[1] > 300 and len(np.unique(image.reshape(-1, 3), axis=0)) > 20


def test_labels_of_ticks_do_not_touch(load):
    """A cube of 2 m about the origin had a label each 0.25 m, one at the end of the other."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    drawn = figure(load(obj(corners, faces)), "cube")
    drawn.canvas.draw()
    for panel in drawn.axes:
        boxes = [tick.label1.get_window_extent() for tick in panel.xaxis.get_major_ticks()]
        ends = sorted((box.x0, box.x1) for box in boxes)
        assert len(ends) > 3 and all(a[1] + 4 < b[0] for a, b in zip(ends, ends[1:]))


def colours(model):
    """All colours (N, 3) of the three views."""
    panels = figure(model).axes[:3]
    return np.concatenate([np.reshape(panel.images[0].get_array(), (-1, 3)) for panel in panels])


def test_a_room_shows_its_far_walls(load):
    """Backs are left out where no front is seen, unless they are all that there is."""
    back = to_rgb(BACK)
    room, sheet = cube(size=2, flip=range(6)), obj([(0, 0, 0), (0, 1, 0), (1, 0, 0)], [(0, 1, 2)])
    for text, is_shown in ((room, False), (cube(flip=[2, 3]), True), (sheet, True)):
        assert (colours(load(text)) == back).all(axis=1).any() == is_shown
    assert len(np.unique(colours(load(room)), axis=0)) > 1
