"""An airliner with the public dimensions of the Airbus A340-300 (thesis 3.2.3.3).

The public dimensions are: length 63.69 m, span 60.30 m, fuselage diameter 5.64 m, wing sweep 30
degrees at the quarter chord. Everything else is ASSUMED from the appearance of the aircraft, such
as the places and sizes of engines and tail. Profiles are symmetrical and wings have no twist.
Engine intakes are closed by a flat disc. Flaps, gear, doors and windows are left out. All surfaces
are at 300 K, except for the exhausts.

Bodies are closed. Where parts of the aircraft join, their bodies overlap. A nacelle, the annulus of
its turbine and its exhaust are one body, so that cowl, annulus and cone meet without a gap. The
annulus is the flat end of the cowl and faces aft.
"""

import numpy as np

from mi_lcair.scenes.build.bodies import Facet, cap, loft, mirrored, patch, revolve, ring

LENGTH, SPAN, FUSELAGE_DIAMETER = 63.69, 60.30, 5.64  # m
ENGINES = (19.25, 9.37, -9.37, -19.25)  # m, y of the engines from left to right, assumed
EXHAUST_LENGTH = 6.1  # m, 20 ft in thesis 3.2.3.3
# m, radii of the core nozzle and of the exhaust cone at its base, assumed. They were chosen with
# the intensities of thesis 4.3 in view.
NOZZLE_RADIUS, EXHAUST_RADIUS = 0.55, 0.30
SKIN = "f*bareAl*300"
HOT_PARTS = "f*blackbody*800*group=hot_parts"
PLUME = "f*blackbody*500*group=plume"
NOSE = LENGTH / 2  # m, x of the nose; stations are distances aft of it in m


def airliner(widening: float = 1.0) -> dict[str, list[Facet]]:
    """Return the closed bodies by name.

    widening: factor of the exhausts' radii, which are those of the core nozzle and the cone's base.

    They are fuselage, belly, wing, tailplane and fin, and for each engine n = 1 to 4 nacelle_n and
    pylon_n.
    """
    parts = {
        "fuselage": fuselage(),
        "belly": belly(),
        "wing": wing(),
        "tailplane": tailplane(),
        "fin": fin(),
    }
    for number, lateral in enumerate(ENGINES, start=1):
        parts[f"nacelle_{number}"] = nacelle(lateral, number, widening)
        parts[f"pylon_{number}"] = pylon(lateral, number)
    return parts


# Fuselage and belly, whose cross sections are circles and ellipses.


def fuselage():
    """Return the fuselage, whose cross sections are circles.

    The nose droops. The tail cone rises, so that its upper line is nearly straight.
    """
    radius, columns = FUSELAGE_DIAMETER / 2, 36
    nose_length, tail_station, tip_radius = 7.0, 43.0, 0.25
    rings = []
    for t in 1 - np.cos(np.linspace(0, np.pi / 2, 11)):  # 0 at the tip, 1 where the cylinder begins
        size = np.sqrt(1 - (1 - t) ** 2.2)
        rings.append((nose_length * t, radius * size, -0.75 * (1 - t) ** 2))
    rings += [(station, radius, 0.0) for station in np.linspace(nose_length, tail_station, 25)[1:]]
    for t in np.linspace(0, 1, 16)[1:]:
        size = radius + (tip_radius - radius) * t**1.6
        rings.append((tail_station + (LENGTH - tail_station) * t, size, radius - 0.9 * t**2 - size))
    return loft(
        [ring(NOSE - s, r, columns, centre=(0, z)) for s, r, z in reversed(rings)],
        f"{SKIN}*fuselage",
    )


def belly():
    """Return the fairing below the wing's centre, half an ellipse under the fuselage."""
    middle, half_length, half_height, aspect, z = 27.5, 9.0, 1.45, 2.0, -1.8
    rings = []
    for t in -np.cos(np.linspace(0, np.pi, 17)):  # -1 at the aft end, 1 at the front
        size = half_height * np.sqrt(1 - abs(t) ** 3)
        rings.append(ring(NOSE - middle + half_length * t, size, 24, centre=(0, z), aspect=aspect))
    return loft(rings, f"{SKIN}*belly")


# Wings, tail and pylons, which are scaled copies of one profile.


def profile(points=16):
    """Return a closed symmetrical profile (points + 1, 2) of chord 1 and thickness 1.

    The columns are the distance ahead of the leading edge and the height. The sharp trailing edge
    (-1, 0) is the first point. The thickness is that of NACA four-digit profiles with a closed
    trailing edge.
    """
    angle = 2 * np.pi * (np.arange(points + 1) % points) / points
    aft = (1 + np.cos(angle)) / 2
    height = (
        0.2969 * np.sqrt(aft) - 0.1260 * aft - 0.3516 * aft**2 + 0.2843 * aft**3 - 0.1036 * aft**4
    )
    height *= np.where(angle < np.pi, 1, -1)
    return np.stack([-aft, height / np.ptp(height)], axis=1)


def section(leading_edge, chord, thickness, upper):
    """Return a profile in space, (points + 1, 3) in m.

    leading_edge: its station, y and z in m. chord, thickness: in m. upper: unit vector toward the
    upper side. The points run right-handed about the cross product of upper and forward.
    """
    station, y, z = leading_edge
    ahead, height = profile().T
    return (
        [NOSE - station, y, z]
        + np.outer(chord * ahead, (1, 0, 0))
        + np.outer(thickness * height, upper)
    )


def tip_to_tip(stations, label):
    """Return one body over both sides of the aircraft.

    stations: sections of the left side, (n, points, 3); the first is the root at y = 0.
    """
    left = patch(stations, label) + cap(stations[-1][::-1], label)
    return left + mirrored(left)


def between(stations, counts):
    """Return the stations (n, values) with interpolated ones between them.

    counts: numbers of intervals between each station and the next. The interpolation is linear.
    """
    rows = [
        np.linspace(a, b, count, endpoint=False)
        for a, b, count in zip(stations, stations[1:], counts)
    ]
    return np.concatenate([*rows, stations[-1:]])


WING_THICKNESS = 0.12  # thickness of the wing as a share of its chord
WING = np.array(
    [  # columns: y, station of the leading edge, chord, z; all in m
        (0.0, 20.2, 12.0, -1.65),  # inside the fuselage
        (9.9, 26.5, 7.2, -0.78),  # the kink of the trailing edge
        (29.0, 38.67, 2.55, 0.89),  # where the winglet begins
    ]
)


def wing():
    """Return both wings as one body through the fuselage.

    The dihedral is 5 degrees. The winglets turn up from the tips.
    """
    sections = [
        section((s, y, z), chord, WING_THICKNESS * chord, (0, 0, 1))
        for y, s, chord, z in between(WING, (8, 14))
    ]
    tip_chord, tip_thickness = 0.75, 0.07
    tip_y = SPAN / 2 - tip_thickness / 2 * np.sin(np.radians(75))  # the outer side is at half span
    for y, s, chord, z, thickness, cant in (
        (29.38, 38.98, 2.35, 1.00, 0.24, 30),
        (29.60, 39.25, 2.15, 1.22, 0.20, 60),
        (29.72, 39.62, 1.90, 1.60, 0.16, 75),
        (tip_y, 41.2, tip_chord, 3.20, tip_thickness, 75),
    ):
        sections.append(
            section(
                (s, y, z),
                chord,
                thickness,
                (0, -np.sin(np.radians(cant)), np.cos(np.radians(cant))),
            )
        )
    return tip_to_tip(sections, f"{SKIN}*wing")


def tailplane():
    """Return the tailplane: sweep 30 degrees at the quarter chord, dihedral 6 degrees."""
    # Columns: y, station of the leading edge, chord, z; all in m.
    stations = np.array([(0.0, 53.2, 6.2, 1.15), (9.7, 59.6, 2.2, 2.15)])
    sections = [
        section((s, y, z), chord, 0.1 * chord, (0, 0, 1))
        for y, s, chord, z in between(stations, (10,))
    ]
    return tip_to_tip(sections, f"{SKIN}*tailplane")


def fin():
    """Return the fin."""
    # Columns: z, station of the leading edge, chord; all in m.
    stations = np.array([(1.8, 50.8, 9.0), (11.3, 59.3, 3.4)])
    sections = [
        section((s, 0, z), chord, 0.1 * chord, (0, -1, 0))
        for z, s, chord in between(stations, (12,))
    ]
    return loft(sections, f"{SKIN}*fin")


# Engines.

# Distance aft of the front and radius, in m. The first point is the rim of the disc that closes the
# intake.
COWL = [
    (0.0, 0.98),
    (0.08, 1.07),
    (0.3, 1.14),
    (0.8, 1.19),
    (1.6, 1.20),
    (2.4, 1.16),
    (3.1, 1.05),
    (3.8, 0.89),
    (4.5, 0.71),
    (5.1, NOZZLE_RADIUS),
]


def engine_front(lateral):
    """Return station and z [m] of the middle of a nacelle's front.

    It lies ahead of the wing's leading edge and below it. lateral: y of the engine [m].
    """
    y, leading_edge, _, z = WING.T
    return np.interp(abs(lateral), y, leading_edge) - 4.7, np.interp(abs(lateral), y, z) - 1.75


def nacelle(lateral, number, widening):
    """Return cowl (300 K), turbine annulus (800 K) and exhaust cone (500 K) as one body."""
    columns = 24
    station, z = engine_front(lateral)
    nozzle, base = (COWL[-1][0], widening * COWL[-1][1]), widening * EXHAUST_RADIUS
    cone = [(nozzle[0] + EXHAUST_LENGTH * t, base * (1 - t)) for t in np.linspace(0, 1, 9)]
    disc = [(0.0, 0.0), (0.0, 0.5), COWL[0]]

    def surface(aft_and_radius, label):
        path = [(NOSE - station - aft, radius) for aft, radius in reversed(aft_and_radius)]
        return patch(revolve(path, columns, centre=(lateral, z)), label)

    return (
        surface([*disc, *COWL[1:-1], nozzle], f"{SKIN}*nacelle_{number}")
        + surface([nozzle, cone[0]], f"{HOT_PARTS}*engine_{number}")
        + surface(cone, f"{PLUME}*engine_{number}")
    )


def pylon(lateral, number):
    """Return the pylon, which reaches from inside the nacelle into the wing."""
    station, z = engine_front(lateral)
    nose, top = station + 4.7, z + 1.75  # station and z of the wing's leading edge
    # Columns: z, station of the leading edge, chord; all in m.
    stations = np.array([(z + 0.6, station + 1.0, 3.6), (top, nose + 0.15, 3.2)])
    sections = [
        section((s, lateral, z), chord, 0.11 * chord, (0, -1, 0))
        for z, s, chord in between(stations, (4,))
    ]
    return loft(sections, f"{SKIN}*pylon_{number}")
