"""Picture of a facet model from three sides: its axes in metres, and its materials."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mi_lcair.coincident import unit_normals
from mi_lcair.drawing import content_of, new_figure, plain, styled
from mi_lcair.models3d.model import Model
from mi_lcair.models3d.modellers.naming import TYPES

PIXELS = 320  # along the longest side of the model
MARGIN = 0.06  # beside the model, as a fraction of its longest side
ARROW = 0.1  # length of the arrows, as a fraction of the model's longest side
AT_ONCE = 2_000_000  # pairs of a pixel and a triangle that are tested at once
NOTHING, BEHIND = -1, -2  # what a pixel shows instead of a triangle
BACK = "#ff00c8"  # colour of backs, which neither emit nor reflect
MOST_TICKS = 5  # intervals between ticks along the longest side
WIDTH = 3.6  # of a panel that shows the longest side, inches


@dataclass(frozen=True)
class Side:
    """A direction from which a model is drawn. Axes are 0, 1, 2 for x, y, z.

    right, up, near: axis and sign of what points right, up and to the observer in the picture.
    """

    title: str
    right: tuple[int, int]
    up: tuple[int, int]
    near: tuple[int, int]


VIEWS = (
    Side("left side (azimuth 90)", (0, -1), (2, 1), (1, 1)),
    Side("front (azimuth 0)", (1, 1), (2, 1), (0, 1)),
    Side("top (elevation 90)", (0, -1), (1, -1), (2, 1)),
)
TITLE = "x forward (nose), y left, z up"
ARROWS = {0: "nose", 2: "up"}  # words at the arrows along +x and +z


def png(model: Model, title: str = TITLE) -> bytes:
    """The picture of `figure` as the content of a PNG file."""
    return content_of(figure(model, title), format="png", dpi=100)


@styled
def figure(model: Model, title: str = TITLE):
    """Matplotlib Figure of a model from its left side, from the front and from above.

    Sky and terrain are drawn behind the model where they face the observer. Backs of model facets
    have a colour of their own. Where all sides show backs, as those of a room do, the backs are
    left out, so that the walls behind them are seen.
    """
    box, longest = _window(model)
    sizes = np.diff(box, axis=0)[0]
    images = [_triangles_seen(model, view, box, longest / PIXELS) for view in VIEWS]
    is_room = False
    if all(image.max() < 0 for image in images):  # no front is seen
        inner = [_triangles_seen(model, view, box, longest / PIXELS, True) for view in VIEWS]
        is_room = all(image.max() >= 0 for image in inner)
        images = inner if is_room else images
    widths = [sizes[view.right[0]] for view in VIEWS]
    heights = [sizes[view.up[0]] for view in VIEWS]
    scale = WIDTH / max(*widths, *heights)
    size = scale * sum(widths) + 4.2, scale * max(heights) + 1
    drawn = new_figure(np.maximum(size, (8, 3)), dpi=100, layout="constrained")
    panels = drawn.subplots(1, 3, width_ratios=widths)
    _draw_materials(drawn, panels, model, images, box, longest)
    drawn.suptitle(plain(title + ", seen through the nearest walls" * is_room))
    return drawn


def _draw_materials(drawn, panels, model, images, box, longest):
    """Draw the materials, with a legend."""
    from matplotlib import colormaps
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Patch

    kinds = [f"{Path(kind.material).name} ({TYPES[kind.type]})" for kind in model.labels]
    names = sorted(set(kinds))
    palette = colormaps["tab10" if len(names) <= 10 else "tab20"].colors
    colours = {name: palette[number % len(palette)] for number, name in enumerate(names)}
    of_label = np.array([colours[kind] for kind in kinds])
    of_triangle = of_label[model.label[model.triangle_facet]]
    normals = unit_normals(model.vertices[model.triangles])
    patches = [Patch(color=colours[name], label=plain(name)) for name in names]
    for panel, view, image in zip(panels, VIEWS, images):
        # Facets are darker the more they are turned away, so that the shape can be seen
        shade = 0.55 + 0.45 * abs(normals[:, view.near[0], None])
        rgb = np.ones((*image.shape, 3))
        rgb[image >= 0] = (shade * of_triangle)[image[image >= 0]]
        rgb[image == BEHIND] = to_rgb(BACK)
        panel.imshow(rgb, origin="lower", extent=_extent(view, box), interpolation="nearest")
        _finish(panel, view, box, longest)
    if any((image == BEHIND).any() for image in images):
        patches.append(Patch(color=BACK, label="seen from behind"))
    drawn.legend(handles=patches, loc="outside right upper")


def _finish(panel, view, box, longest):
    """Add a title, axes in metres, and arrows in front of the nose and above the model."""
    from matplotlib.ticker import MaxNLocator

    sizes = np.diff(box, axis=0)[0]
    for axis, along in ((panel.xaxis, view.right[0]), (panel.yaxis, view.up[0])):
        most = max(2, round(MOST_TICKS * sizes[along] / sizes.max()))
        axis.set_major_locator(MaxNLocator(most, steps=[1, 2, 5, 10]))
    panel.set_title(view.title, fontsize=9)
    panel.set_facecolor("white")
    panel.set_xlabel(f"{'xyz'[view.right[0]]} (m)")
    panel.set_ylabel(f"{'xyz'[view.up[0]]} (m)")
    for axis, word in ARROWS.items():
        if axis == view.near[0]:
            continue
        start = (box.sum(axis=0) - _room_for_arrows(longest)) / 2
        start[axis] = box[1, axis] - (ARROW + MARGIN) * longest
        end = start.copy()
        end[axis] += ARROW * longest
        start, end = ((point[view.right[0]], point[view.up[0]]) for point in (start, end))
        style = {"arrowstyle": "-|>", "color": "black", "lw": 1.2, "shrinkA": 0, "shrinkB": 0}
        panel.annotate("", end, start, arrowprops=style)
        side = "right" if axis == 0 else "left"
        panel.annotate(word, start, (3, 4), textcoords="offset points", fontsize=8, ha=side)


def _window(model):
    """Lowest and highest coordinates (2, 3) that are drawn, and the model's longest side [m]."""
    of_target = model.facets_of("f")[model.triangle_facet]
    triangles = model.triangles[of_target if of_target.any() else slice(None)]
    points = model.vertices[triangles].reshape(-1, 3)
    lower, upper = points.min(axis=0), points.max(axis=0)
    longest = (upper - lower).max()
    around = np.maximum(MARGIN * longest, (0.2 * longest - (upper - lower)) / 2)
    return np.stack([lower - around, upper + around + _room_for_arrows(longest)]), longest


def _room_for_arrows(longest):
    """Lengths (3,) along x, y and z that are left for the arrows [m]."""
    return longest * np.array([ARROW + MARGIN if axis in ARROWS else 0 for axis in range(3)])


def _extent(view, box):
    """Coordinates at the left, right, lower and upper edge of a view."""
    edges = []
    for axis, sign in (view.right, view.up):
        edges += [*box[::sign, axis]]
    return edges


def _triangles_seen(model, view, box, pixel, without_backs=False):
    """The number of the triangle (H, W) that each pixel shows, NOTHING or BEHIND."""
    corners = model.vertices[model.triangles]
    left, _, bottom, _ = _extent(view, box)
    points = np.stack(
        [
            sign * (corners[..., axis] - start) / pixel
            for (axis, sign), start in ((view.right, left), (view.up, bottom))
        ],
        axis=-1,
    )
    depth = view.near[1] * corners[..., view.near[0]]
    sizes = np.ceil(np.diff(box, axis=0)[0] / pixel).astype(int)
    image = nearest_triangles(points, depth, (sizes[view.up[0]], sizes[view.right[0]]))
    turned = _area(*np.moveaxis(points, 1, 0)) < 0
    opaque = model.facets_of("f")[model.triangle_facet] & (not without_backs)
    if turned[~opaque].any():  # the backs of sky and terrain hide nothing
        kept = np.flatnonzero(opaque | ~turned)
        image = nearest_triangles(points[kept], depth[kept], image.shape)
        image[image >= 0] = kept[image[image >= 0]]
    image[(image >= 0) & turned[np.maximum(image, 0)]] = BEHIND
    return image


def nearest_triangles(points: np.ndarray, depth: np.ndarray, shape) -> np.ndarray:
    """The number of the triangle (H, W) that is nearest to the observer in the middle of each
    pixel, NOTHING where there is none.

    points: corners (T, 3, 2) in pixels, across and up. depth: (T, 3), larger values are nearer.
    """
    image, nearest = np.full(shape, NOTHING), np.full(shape, -np.inf)
    limits = np.array(shape[::-1])
    first = np.clip(np.ceil(points.min(axis=1) - 0.5), 0, limits).astype(int)
    last = np.clip(np.floor(points.max(axis=1) - 0.5) + 1, 0, limits).astype(int)
    spans = np.maximum(last - first, 0)
    area = _area(*np.moveaxis(points, 1, 0))
    counts = np.where(area != 0, spans.prod(axis=1), 0)
    groups = np.cumsum(counts) // AT_ONCE
    for group in np.unique(groups):
        triangles = np.flatnonzero((groups == group) & (counts > 0))
        if not len(triangles):
            continue
        triangle = np.repeat(triangles, counts[triangles])
        begins = np.cumsum(counts[triangles]) - counts[triangles]
        within = np.arange(len(triangle)) - np.repeat(begins, counts[triangles])
        column = first[triangle, 0] + within % spans[triangle, 0]
        row = first[triangle, 1] + within // spans[triangle, 0]
        middle = np.stack([column, row], axis=1) + 0.5
        a, b, c = np.moveaxis(points[triangle], 1, 0)
        weights = np.stack([_area(middle, b, c), _area(a, middle, c), _area(a, b, middle)], axis=1)
        weights /= area[triangle, None]
        inside = weights.min(axis=1) >= 0
        triangle, row, column = triangle[inside], row[inside], column[inside]
        near = np.einsum("nk,nk->n", weights[inside], depth[triangle])
        order = np.argsort(near, kind="stable")  # of several in one pixel, the last one stays
        order = order[near[order] > nearest[row[order], column[order]]]
        nearest[row[order], column[order]] = near[order]
        image[row[order], column[order]] = triangle[order]
    return image


def _area(a, b, c):
    """Twice the signed area (N,) of triangles with corners (N, 2)."""
    return (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
