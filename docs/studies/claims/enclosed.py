"""Cavities in which radiation is reflected many times."""

import numpy as np

from docs.studies.claims.case import Case, Draw
from docs.studies.claims.lit import X, Y, turned_to_front
from docs.studies.claims.scene_file import BLACK, UP, Place, SceneFile, diffuse, plume, thermal
from docs.studies.claims.sources import corners

RESOLVED = 1e-4  # side over largest coordinate of a part that Float32 resolves
RIM = 1.001  # radius of a disc in a sphere, so that no ray passes beside it


def wall(draw: Draw, T: dict, file: SceneFile, rho: float) -> None:
    """A diffuse sphere of radius 1, seen from within."""
    T["wall"] = draw.ambient()
    inside = diffuse(rho, "wall") + thermal("wall", T["wall"])
    file.sphere(np.zeros(3), 1.0, inside, inward=True)


def cavity(draw: Draw) -> Case:
    """A diffuse sphere with a black opening and a hot spot, all of it equally lit.

    Between points of a sphere the view factor is the same everywhere: an element of the wall sends
    to a cap its share of the sphere, and a disc fills the same directions as the cap behind it.
    """
    rho, T = draw.between(0.1, 0.95), {}
    file = SceneFile(draw.place(1.0))
    wall(draw, T, file, rho)
    caps = {"opening": (UP, draw.size(0.02, 1.2)), "spot": (X, draw.size(0.02, 0.3))}
    T["opening"], T["spot"] = draw.background(), draw.temperature()
    for name, (axis, angle) in caps.items():
        radius, side = RIM * np.sin(angle), Y
        disc = turned_to_front(
            (np.cos(angle) * axis, radius * np.cross(axis, side), radius * side), -axis
        )
        file.rectangle(*disc, BLACK + thermal(name, T[name]), "disk")
    share = {name: (1 - np.cos(angle)) / 2 for name, (_, angle) in caps.items()}
    free = 1 - sum(share.values())
    bounces, half_window = draw.whole(1, 16), draw.between(0.01, 0.3)
    file.camera(np.zeros(3), -UP, draw.up(), half_window, 4.0)

    def response(B, materials):
        rho = materials["wall.reflectance"]
        own = (1 - rho) * B["wall"]
        first = rho * (free * own + sum(share[name] * B[name] for name in caps))
        rows = [own, *(first * (rho * free) ** np.arange(bounces))]
        return np.reshape(rows, (-1, 1, 1))

    def second(B, materials):
        """Radiosities of wall, opening and spot, reflection by reflection, by their matrix."""
        rho = materials["wall.reflectance"]
        factors = np.zeros((3, 3))
        factors[0] = [free, *share.values()]
        emitted = np.array([(1 - rho) * B["wall"], *(B[name] for name in caps)])
        total, term = np.zeros(3), emitted
        for _ in range(bounces + 1):
            total, term = total + term, np.array([rho, 0, 0]) * (factors @ term)
        return float(total[0])

    def unlimited(B, materials):
        rho = materials["wall.reflectance"]
        received = rho * sum(share[name] * B[name] for name in caps)
        return ((1 - rho) * B["wall"] + received) / (1 - rho * free)

    return draw.case(
        "cavity",
        file,
        T,
        bounces,
        half_window,
        materials={"wall.reflectance": rho},
        response=response,
        second=second,
        unlimited=unlimited,
        shows="wall",
    )


def nested(draw: Draw) -> Case:
    """Plumes within each other in the middle of a diffuse sphere.

    Of the cos-weighted directions from the wall the share r^2 meets a concentric sphere of radius
    r, so that the wall is equally lit everywhere.
    """
    rho, T = draw.between(0.1, 0.95), {}
    file = SceneFile(draw.place(1.0))
    wall(draw, T, file, rho)
    count = draw.whole(1, 4)
    radii = np.sort(draw.rng.uniform(0.05, 0.6, count))[::-1]  # from the outermost
    through = draw.rng.uniform(0.1, 0.95, count)
    for k in range(count):
        name = f"plume{k}"
        T[name] = draw.temperature()
        inside = plume(float(through[k])) + thermal(name, T[name])
        file.sphere(np.zeros(3), float(radii[k]), inside)
    bounces, half_window = draw.whole(1, 8), draw.between(0.05, 0.45)
    file.camera(0.65 * UP, -UP, draw.up(), half_window, 4.0)

    def chords(B):
        """Transmittance and emission of chords through none, one, two, ... of the spheres."""
        t, emission = np.ones(count + 1), np.zeros(count + 1)
        for crossed in range(1, count + 1):
            order = [*range(crossed), *range(crossed - 1, -1, -1)]
            for k in order:
                emission[crossed] += t[crossed] * (1 - through[k]) * B[f"plume{k}"]
                t[crossed] *= through[k]
        return t, emission

    def differences(within) -> np.ndarray:
        """Shares of chords through exactly none, one, two, ... spheres, from those within each."""
        return -np.diff([1, *within, 0])

    from_wall = differences(radii**2)
    in_window = differences([overlap(radius, half_window) for radius in radii])

    def by_reflection(B, rho, count):
        t, emission = chords(B)
        wall, rows = (1 - rho) * B["wall"], []
        for k in range(count):
            rows.append(in_window @ t * wall + (in_window @ emission if k == 0 else 0))
            wall = rho * (from_wall @ t * wall + (from_wall @ emission if k == 0 else 0))
        return rows

    def response(B, materials):
        rho = materials["wall.reflectance"]
        return np.reshape(by_reflection(B, rho, bounces + 1), (-1, 1, 1))

    def second(B, materials):
        """Chords by quadrature over the angle at the wall and over the window."""
        rho = materials["wall.reflectance"]
        t, emission = chords(B)
        sin2 = (np.arange(100_000) + 0.5) / 100_000
        number = (sin2[:, None] < radii**2).sum(axis=1)
        pass_wall, from_plumes = t[number].mean(), emission[number].mean()
        k = np.arange(2**18)
        a, b = (half_window * (2 * ((k * s) % 1) - 1) for s in (0.75487766624, 0.56984029099))
        number = ((a**2 + b**2)[:, None] < radii**2).sum(axis=1)
        total, radiance = emission[number].mean(), (1 - rho) * B["wall"]
        for k in range(bounces + 1):
            total += t[number].mean() * radiance
            radiance = rho * (pass_wall * radiance + (from_plumes if k == 0 else 0))
        return float(total)

    def unlimited(B, materials):
        rho = materials["wall.reflectance"]
        t, emission = chords(B)
        wall = ((1 - rho) * B["wall"] + rho * from_wall @ emission) / (1 - rho * from_wall @ t)
        return in_window @ emission + in_window @ t * wall

    return draw.case(
        "nested plumes",
        file,
        T,
        bounces,
        half_window,
        materials={"wall.reflectance": rho},
        response=response,
        second=second,
        second_error=3e-3,
        unlimited=unlimited,
    )


def overlap(radius: float, half: float) -> float:
    """Share of the square +-half that the disc of this radius around its middle covers."""
    if radius >= half * np.sqrt(2):
        return 1.0
    if radius <= half:
        return np.pi * radius**2 / (2 * half) ** 2
    angle = np.arccos(half / radius)  # half the angle of each segment beyond a side
    segments = 4 * radius**2 * (angle - np.sin(2 * angle) / 2)
    return (np.pi * radius**2 - segments) / (2 * half) ** 2


def part(draw: Draw) -> Case:
    """A closed cube far from the origin of a scene that is larger still.

    The cube is well resolved if its side is more than RESOLVED of its largest coordinate.
    """
    side, distance = draw.size(1e-3, 1e3), float(draw.rng.choice([0.0, 30.0, 1e3, 1e5]))
    extent = min(1e6, max(distance, side) * draw.size(1, 1e4))
    direction, rotation = draw.direction(), draw.rotation()
    place = Place(side / 2, rotation, distance * direction)
    resolved = side > RESOLVED * (np.abs(place.shift).max() + side)
    kind = "part, " + ("resolved" if resolved else "too small")
    result = furnace(draw, place, kind, np.ones(3))
    opposite = (-extent * direction - place.shift) @ rotation / place.scale
    size = 1e-3 * extent / place.scale
    result.file.rectangle(opposite, size * X, size * Y, BLACK)
    return result


def furnace(draw: Draw, place=None, kind: str = "furnace", half=None) -> Case:
    """A closed diffuse box of one temperature, of any proportions, seen from within."""
    rho, T = draw.between(0.1, 0.95), {"wall": draw.temperature(200)}
    file = SceneFile(place or draw.place(2.0))
    if half is None:
        half = np.array([draw.size(0.1, 1), draw.size(0.1, 1), draw.size(0.1, 1)])
    sides = []
    for k in range(3):
        for sign in (-1, 1):
            u, v = (half[j] * axis for j, axis in enumerate(np.eye(3)) if j != k)
            normal = sign * np.eye(3)[k]
            sides.append(corners(turned_to_front((half[k] * normal, u, v), -normal)))
    file.mesh(sides, diffuse(rho, "wall") + thermal("wall", T["wall"]))
    bounces = draw.whole(1, 20)
    half_window = draw.between(0.3, 0.7) * min(half[:2])
    file.camera(np.zeros(3), -UP, draw.up(), half_window, 4.0)

    def response(B, materials):
        rho = materials["wall.reflectance"]
        rows = (1 - rho) * B["wall"] * rho ** np.arange(bounces + 1)
        return np.reshape(rows, (-1, 1, 1))

    def second(B, materials):
        return B["wall"] * (1 - materials["wall.reflectance"] ** (bounces + 1))

    return draw.case(
        kind,
        file,
        T,
        bounces,
        half_window,
        materials={"wall.reflectance": rho},
        response=response,
        second=second,
        unlimited=lambda B, materials: B["wall"],
        shows="wall",
    )
