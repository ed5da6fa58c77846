"""The cylinder with wings and nose, a notional aircraft (thesis 3.2.3.2), as one closed skin.

The text of the thesis lacks the drawing with the dimensions (Figure 3.6). The dimensions here are
ASSUMED, so that the body fits into the 3 m IR range. The body is a cylinder with a tangent ogive as
nose, a flat tail and two plane rectangular wings. Each wing replaces one column of the cylinder's
facets. Its faces meet the cylinder along a generator, in a sharp corner.
"""

import numpy as np

from mi_lcair.scenes.build.bodies import mirrored, patch, revolve

LENGTH, NOSE_LENGTH, RADIUS = 1.2, 0.3, 0.15  # m, assumed; the length includes the nose
SPAN = 1.0  # m from tip to tip, assumed
COLUMNS = 40  # number of facets around the cylinder
ROWS = 24  # number of rows of equal length along the cylinder, without nose and tail
WING_ROWS = slice(6, 18)  # rows of the cylinder at which the wings are attached
NOSE_ROWS = 6  # number of rows along the nose
TAIL_RADII = (0, 0.05, 0.1)  # m, inner radii of the rings of the flat tail
# Stations along the span as fractions of a wing. Facets grow from 2 cm at the root to 4 cm at the
# tip.
WING_STATIONS = np.cumsum([0, *np.linspace(2, 4, 12)]) / np.linspace(2, 4, 12).sum()

# Temperatures in K, thesis Table 3.2.
TEMPERATURES = {
    "bareAl": {
        "nose": 301.7,
        "front_fuselage": 302.1,
        "rear_fuselage": 303.2,
        "left_wing_front": 303.6,
        "left_wing_rear": 303.6,
        "right_wing_front": 303.7,
        "right_wing_rear": 303.7,
    },
    "gloss_black": {
        "nose": 292.1,
        "front_fuselage": 293.1,
        "rear_fuselage": 294.2,
        "left_wing_front": 301.6,
        "left_wing_rear": 298.2,
        "right_wing_front": 304.2,
        "right_wing_rear": 299.1,
    },
}


def ogive_radius(distance):
    """Return the radius of the nose [m] at a distance [m] ahead of its base.

    The nose is an arc that is tangent to the cylinder.
    """
    arc = (RADIUS**2 + NOSE_LENGTH**2) / (2 * RADIUS)
    return np.sqrt(arc**2 - distance**2) + RADIUS - arc


def cylinder(finish):
    """Return the facets of the model in a finish of Table 3.2, "bareAl" or "gloss_black"."""
    labels = {
        region: f"f*{finish}*{kelvin}*{region}" for region, kelvin in TEMPERATURES[finish].items()
    }
    tail, shoulder = -LENGTH / 2, LENGTH / 2 - NOSE_LENGTH
    rings = np.linspace(tail, shoulder, ROWS + 1)
    side = skin([(x, RADIUS) for x in rings])
    middle = ROWS // 2
    rear, front = slice(WING_ROWS.start, middle), slice(middle, WING_ROWS.stop)
    nose = np.linspace(0, NOSE_LENGTH, NOSE_ROWS + 1)

    facets = patch(skin(list(zip(shoulder + nose, ogive_radius(nose)))), labels["nose"])
    facets += patch(side[WING_ROWS.stop :], labels["front_fuselage"]) + beside_wings(
        side, front, labels["front_fuselage"]
    )
    facets += beside_wings(side, rear, labels["rear_fuselage"]) + patch(
        side[: WING_ROWS.start + 1], labels["rear_fuselage"]
    )
    facets += patch(
        skin([(tail, radius) for radius in (*TAIL_RADII, RADIUS)]), labels["rear_fuselage"]
    )
    for part, rows in (("front", front), ("rear", rear)):
        chord = rings[rows.start : rows.stop + 1]
        facets += wing(chord, labels[f"left_wing_{part}"], edge=part)
        facets += mirrored(wing(chord, labels[f"right_wing_{part}"], edge=part))
    return facets


def skin(profile):
    """Return rings about the x axis through a profile of x and radius.

    Column 0 is centred on +y (left wing), column COLUMNS / 2 on -y (right wing).
    """
    return revolve(profile, COLUMNS, turn=-0.5)


def beside_wings(side, rows, label):
    """Return the cylinder's facets above and below the wings in `rows`."""
    strip = side[rows.start : rows.stop + 1]
    half = COLUMNS // 2
    return patch(strip[:, 1 : half + 1], label) + patch(strip[:, half + 1 :], label)


def wing(chord, label, edge):
    """Return the front or rear half of the left wing: upper and lower face, tip and outer edge.

    chord: x of its rows of vertices in ascending order [m]. edge: "front" or "rear".
    """
    # y and z of the upper corner between wing and cylinder
    root = np.array([RADIUS * np.cos(np.pi / COLUMNS), RADIUS * np.sin(np.pi / COLUMNS)])
    y, z = root[0] + (SPAN / 2 - root[0]) * WING_STATIONS, root[1]

    def points(xs, ys, zs):
        return np.stack(np.broadcast_arrays(xs, ys, zs), axis=-1)

    # Rows run along -y and follow each other toward +x, so that the outside is +z.
    upper = points(chord[:, None], y[::-1], z)
    lower = points(chord[:, None], y, -z)
    tip = points(chord[:, None], SPAN / 2, np.array([-z, z]))
    border_x, border_z = (chord[-1], [z, -z]) if edge == "front" else (chord[0], [-z, z])
    border = points(border_x, y[:, None], np.array(border_z))
    return patch(upper, label) + patch(lower, label) + patch(tip, label) + patch(border, label)
