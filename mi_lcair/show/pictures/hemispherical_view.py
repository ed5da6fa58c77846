"""Picture of the hemispherical view of a facet over theta and phi (thesis Figures 3.12, 3.13)."""

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.signatures.facets import MAP_PHI, MAP_THETA, NOTHING, HemisphericalView

PAPER = (0.93, 0.93, 0.93)  # colour of directions without a surface
EDGE = 0.45  # brightness of the lines between facets, relative to the facets
MOST_GROUPS = 16  # largest number of groups in the legend
MOST_LABELS = 24  # largest number of facets that are labelled with their number
ROOM = 4.5  # distance of a label from the edges of its facet, degrees
COARSE = 4  # step, in pixels of the map, of the search for places of labels


@styled
def figure(view: HemisphericalView):
    """Figure of the facets that a facet sees, theta against phi.

    Each group has its own hue. Facets with higher numbers are darker.
    """
    from matplotlib.patches import Patch

    colours, groups = facet_colours(view)
    figure = new_figure((11, 4), layout="constrained")
    axes = figure.subplots()
    axes.imshow(
        edges_darkened(view.map, colours[view.map]),
        extent=(-180, 180, 90, 0),
        aspect="auto",
        interpolation="nearest",
    )
    for number, column, row in places(view.map):
        dark = colours[number] @ (0.3, 0.6, 0.1) < 0.5
        place = column / MAP_PHI * 360 - 180, row / MAP_THETA * 90
        style = {"ha": "center", "va": "center", "fontsize": 7}
        axes.text(*place, number, color="white" if dark else "black", **style)
    axes.set_xticks(range(-180, 181, 45))
    axes.set_yticks(range(0, 91, 15))
    axes.set_xlabel("azimuth φ from the direction of the facet's second corner (degrees)")
    axes.set_ylabel("θ from the normal (degrees)")
    group, material = view.facets.group[view.facet], view.facets.material[view.facet]
    title = f"{view.scene_name}: what facet {view.facet} sees (group {group}, {material})"
    axes.set_title(plain(title), fontsize=11)

    entries = [(colour, f"{plain(name)}: {share:.4f}") for name, (colour, share) in groups.items()]
    if len(entries) > MOST_GROUPS:
        entries = entries[:MOST_GROUPS] + [(None, f"and {len(entries) - MOST_GROUPS} more")]
    figure.legend(
        [
            Patch(facecolor=colour or "none", edgecolor="0.4" if colour else "none", lw=0.5)
            for colour, _ in entries
        ],
        [text for _, text in entries],
        loc="outside right upper",
        title="group: view factor",
        alignment="left",
    )
    return figure


def facet_colours(view: HemisphericalView) -> tuple[np.ndarray, dict]:
    """Colours of the facets, and of their groups.

    Returns
    -------
    colours : ndarray, shape (facets + 1, 3)
        Colour by facet number. That of NOTHING is the last.
    groups : dict of str to (tuple, float)
        Colour and view factor of each group, largest view factor first.
    """
    from matplotlib import colormaps

    visible = np.union1d(view.neighbour[(view.view_factor + view.solid_angle) > 0], view.map)
    share = dict(zip(view.neighbour.tolist(), view.view_factor.tolist()))
    members = {}
    for number in visible.tolist():
        group = "nothing" if number == NOTHING else view.facets.group[number]
        members.setdefault(group, []).append(number)
    members = dict(
        sorted(members.items(), key=lambda item: -sum(share.get(number, 0) for number in item[1]))
    )
    colours, groups = np.tile(PAPER, (view.facets.count + 1, 1)), {}
    hues = iter(np.arange(len(members)) % 10)
    for name, numbers in members.items():
        middle = PAPER
        if numbers != [NOTHING]:
            hue = np.array(colormaps["tab10"](next(hues))[:3])
            # Positive shades are mixed with white, negative ones with black.
            shade = np.linspace(0.45, -0.3, len(numbers) + 2)[1:-1, None]
            colours[numbers] = np.where(shade > 0, hue + shade * (1 - hue), hue * (1 + shade))
            middle = tuple(hue)
        groups[name] = middle, sum(share.get(number, 0) for number in numbers)
    return colours, groups


def edges_darkened(numbers: np.ndarray, image: np.ndarray) -> np.ndarray:
    """The image, shape (H, W, 3), with dark lines between facets."""
    edge = np.zeros(numbers.shape, dtype=bool)
    below, right = numbers[1:] != numbers[:-1], numbers[:, 1:] != numbers[:, :-1]
    # The lines are two pixels wide, because the picture has fewer pixels than the map.
    edge[1:] |= below
    edge[:-1] |= below
    edge[:, 1:] |= right
    edge[:, :-1] |= right
    return np.where(edge[..., None], EDGE * image, image)


def places(numbers: np.ndarray):
    """Yield (facet, column, row) of the labels, largest regions first.

    The label of a facet is where its number has the most room. A facet without enough room has
    none.
    """
    from scipy.ndimage import distance_transform_edt

    coarse = numbers[COARSE // 2 :: COARSE, COARSE // 2 :: COARSE]
    facets, sizes = np.unique(coarse[coarse != NOTHING], return_counts=True)
    for number in facets[np.argsort(-sizes)][:MOST_LABELS]:
        room = distance_transform_edt(np.pad(coarse == number, 1))[1:-1, 1:-1]
        row, column = np.unravel_index(np.argmax(room), room.shape)
        if room[row, column] * COARSE >= ROOM / 90 * MAP_THETA:
            yield int(number), COARSE * (column + 0.5), COARSE * (row + 0.5)
