"""A diffuse floor that receives radiation from black sources: one reflection is all there is."""

from functools import cache

import numpy as np

from docs.studies.claims.case import Case, Draw, Unsuitable, converged
from docs.studies.claims.scene_file import BLACK, UP, SceneFile, diffuse, mirror, thermal
from docs.studies.claims.sources import add_source, corners
from docs.studies.claims.view_factors import (
    by_areas,
    midpoints,
    on_rectangle,
    parallel_rectangles,
    perpendicular_rectangles,
    to_polygon,
)

X, Y = np.eye(3)[:2]


def normal_of(rectangle) -> np.ndarray:
    normal = np.cross(rectangle[1], rectangle[2])
    return normal / np.linalg.norm(normal)


def turned_to_front(rectangle, toward) -> tuple:
    """The rectangle with its front side toward a direction."""
    centre, u, v = rectangle
    return (centre, u, v) if normal_of(rectangle) @ toward > 0 else (centre, -u, v)


def reflected(shares, blocked, names, room: bool, bounces: int):
    """Response of a floor that receives these shares, (n, H, W), from the sources `names`.

    blocked: share of each direction that the sources take from the room, (H, W).
    """

    def response(B, materials):
        rho = materials["floor.reflectance"]
        received = np.einsum("k,khw->hw", [B[name] for name in names], shares)
        if room:
            received = received + (1 - blocked) * B["room"]
        rows = [np.full_like(received, (1 - rho) * B["floor"]), rho * received]
        return np.array(rows + [0 * received] * (bounces - 1))

    return response


def whole_less_part(shares, front) -> list:
    """Shares of a part and of the rest of a whole, from those of the part and the whole."""
    part, whole = shares
    return [part * front, (whole - part) * front]


def floor_scene(draw: Draw, half_floor: float, rho: float, floor: float) -> SceneFile:
    file = SceneFile(draw.place())
    inside = diffuse(rho, "floor") + thermal("floor", floor)
    file.rectangle(np.zeros(3), half_floor * X, half_floor * Y, inside)
    return file


def room_around(draw: Draw, file: SceneFile, reach: float, temperatures: dict) -> bool:
    """Maybe a black room around everything, of up to a million times the scene's size."""
    if draw.chance(0.3):
        return False
    temperatures["room"] = draw.ambient()
    file.room(np.zeros(3), draw.size(3, 1e6) * reach, "room", temperatures["room"])
    return True


class Lamps:
    """Rectangular sources above a floor that do not hide each other.

    rectangles: the whole ones. sources: the rectangle of each radiance of each of them by name, see
    `add_source`. names: of all radiances.
    """

    def __init__(self, draw: Draw, file: SceneFile, rectangles: list, T: dict):
        self.rectangles = rectangles
        self.sources = [add_source(draw, file, f"lamp{k}", r, T) for k, r in enumerate(rectangles)]
        self.names = [name for parts in self.sources for name in parts]

    @property
    def lowest(self) -> float:
        """Height of the lowest corner."""
        return min(corners(rectangle)[:, 2].min() for rectangle in self.rectangles)

    def shares(self, points) -> list:
        """Share of each radiance in the upper hemispheres of points, and that of all lamps."""
        of_parts, blocked = [], 0.0
        for parts, rectangle in zip(self.sources, self.rectangles):
            front = (points - rectangle[0]) @ normal_of(rectangle) > 0
            share = [to_polygon(points, UP, corners(part)) for part in parts.values()]
            blocked = blocked + share[-1]
            of_parts += [share[0] * front] if len(share) == 1 else whole_less_part(share, front)
        return [*of_parts, blocked]

    def factors(self, window) -> list:
        """The same as means over a rectangle, by integrals over both areas."""
        received, taken = [], 0.0
        for parts in self.sources:
            share = [by_areas(window, part, 6) for part in parts.values()]
            received += share if len(share) == 1 else whole_less_part(share, 1.0)
            centre, u, v = list(parts.values())[-1]
            taken += share[-1] + by_areas(window, (centre, -u, v), 6)
        return [*received, taken]


def rectangles_above(draw: Draw, turn: str, reach: float = 1.0) -> list:
    """One to three rectangles above a floor: parallel to it, perpendicular or inclined.

    reach: size of the floor's part that counts.
    """
    height, side = reach * draw.size(0.2, 10), reach * draw.size(1e-3, 1)
    side = min(side, 2 * height)
    rectangles = []
    for k in range(draw.whole(1, 3) if turn == "parallel" else 1):
        centre = np.array([*(reach * draw.between(-1.5, 1.5) for _ in range(2)), height])
        u, v = side * X, side * draw.between(0.2, 1) * Y
        if turn == "parallel":
            centre[0] += 4 * side * k
            rectangle = turned_to_front((centre, u, v), -UP)
        elif turn == "perpendicular":
            rectangle = turned_to_front((centre, u, v[1] * UP), -Y * np.sign(centre[1]))
        else:
            axes = draw.rotation()
            rectangle = turned_to_front((centre, axes @ u, axes @ v), -UP * reach - centre)
        if corners(rectangle)[:, 2].min() < 0.05 * height:
            raise Unsuitable
        rectangles.append(rectangle)
    ends = np.array([corners(rectangle)[:, 0] for rectangle in rectangles])
    if np.any(ends.max(axis=1)[:-1] > ends.min(axis=1)[1:]):
        raise Unsuitable
    return rectangles


def lamp(draw: Draw) -> Case:
    """A floor and one to three rectangles above it, parallel, perpendicular or inclined."""
    rho, half_window = draw.between(0.05, 0.95), 1.0
    T = {"floor": draw.background()}
    half_floor = half_window * draw.size(1.5, 10)
    file, up = floor_scene(draw, half_floor, rho, T["floor"]), draw.up()
    turn = str(draw.rng.choice(["parallel", "perpendicular", "inclined"]))
    lamps = Lamps(draw, file, rectangles_above(draw, turn), T)
    farthest = max(np.linalg.norm(corners(r), axis=1).max() for r in lamps.rectangles)
    room = room_around(draw, file, half_floor * np.sqrt(2) + farthest, T)
    bounces = draw.whole(1, 3)
    eye = 0.5 * lamps.lowest
    file.camera(eye * UP, -UP, up, half_window, 4 * eye, lens=draw.lens())
    *of_lamps, blocked = converged(lamps.shares, np.zeros(3), up, half_window)
    window = (np.zeros(3), half_window * np.cross(-UP, up), half_window * up)
    factors = cache(lambda: lamps.factors(turned_to_front(window, UP)))

    def second(B, materials):
        rho = materials["floor.reflectance"]
        *received, taken = factors()
        total = received @ np.array([B[name] for name in lamps.names])
        if room:
            total += (1 - taken) * B["room"]
        return (1 - rho) * B["floor"] + rho * total

    return draw.case(
        f"lamp, {turn}",
        file,
        T,
        bounces,
        half_window=half_window,
        materials={"floor.reflectance": rho},
        response=reflected(of_lamps, blocked, lamps.names, room, bounces),
        second=second,
        second_error=1e-3,
        shows="floor",
    )


def in_mirror(draw: Draw) -> Case:
    """A source that lights the floor by way of a mirror above it alone.

    The mirror also shows the floor. Two reflections are followed, so that of the floor only its own
    emission returns, which is the same everywhere.
    """
    rho, reflectance = draw.between(0.05, 0.95), draw.between(0.5, 1)
    T, up, half_floor = {"floor": draw.background()}, draw.up(), draw.size(4, 10)
    file = floor_scene(draw, half_floor, rho, T["floor"])
    height, side, low = draw.between(1, 3), draw.size(1e-3, 0.3), 0.01
    file.rectangle(*turned_to_front((height * UP, 500 * X, 500 * Y), -UP), mirror(reflectance))
    place = np.array([2.0, draw.between(-1, 1), low])
    T["lamp"] = draw.temperature(300)
    file.rectangle(place, side * X, side * Y, BLACK + thermal("lamp", T["lamp"]))
    file.camera(0.5 * height * UP, -UP, up, 1.0, 4 * height, lens=draw.lens())
    image = turned_to_front((place * [1, 1, 0] + (2 * height - low) * UP, side * X, side * Y), -UP)
    images = {"lamp": image, "floor": (2 * height * UP, half_floor * X, -half_floor * Y)}
    lamp_share, whole = converged(
        lambda points: [to_polygon(points, UP, corners(part)) for part in images.values()],
        np.zeros(3),
        up,
        1.0,
    )

    def response(B, materials, shares=(lamp_share, whole)):
        rho = materials["floor.reflectance"]
        own = (1 - rho) * B["floor"]
        returned = shares[0] * B["lamp"] + (shares[1] - shares[0]) * own
        return np.array([own + 0 * returned, 0 * returned, rho * reflectance * returned])

    @cache
    def factors():
        window = turned_to_front((np.zeros(3), np.cross(-UP, up), np.asarray(up)), UP)
        return [np.full((1, 1), by_areas(window, part, 6)) for part in images.values()]

    def second(B, materials):
        return float(response(B, materials, factors()).sum())

    return draw.case(
        "lamp, in a mirror",
        file,
        T,
        2,
        materials={"floor.reflectance": rho},
        response=response,
        second=second,
        second_error=1e-4,
        shows="floor",
        unlimited=lambda B, materials: np.nan,
    )


def ball(draw: Draw) -> Case:
    """A floor and a black sphere above it."""
    rho, T, up = draw.between(0.05, 0.95), {"floor": draw.background()}, draw.up()
    half_floor = draw.size(1.5, 10)
    file = floor_scene(draw, half_floor, rho, T["floor"])
    radius = draw.size(1e-3, 1)
    centre = np.array([draw.between(-2, 2), draw.between(-2, 2), radius + draw.size(0.2, 5)])
    T["ball"] = draw.temperature()
    file.sphere(centre, radius, BLACK + thermal("ball", T["ball"]))
    room = room_around(draw, file, centre[2] + half_floor, T)
    bounces, eye = draw.whole(1, 3), 0.5 * (centre[2] - radius)
    file.camera(eye * UP, -UP, up, 1.0, 4 * eye, lens=draw.lens())

    def shares(points):
        d = centre - points
        return [radius**2 * d[:, 2] / np.linalg.norm(d, axis=1) ** 3]

    (share,) = converged(shares, np.zeros(3), up, 1.0)

    @cache
    def from_ball():
        """The same share from the elements of the sphere, by reciprocity."""
        (z, wz), (turn, wt) = midpoints(40), midpoints(10)
        level = np.sqrt(1 - (2 * z - 1) ** 2)[:, None]
        angle = 2 * np.pi * turn
        normals = np.stack(
            [
                level * np.cos(angle),
                level * np.sin(angle),
                np.broadcast_to(2 * z[:, None] - 1, (len(z), len(turn))),
            ],
            axis=-1,
        ).reshape(-1, 3)
        window = corners((np.zeros(3), np.cross(-UP, up), up))
        shares = to_polygon(centre + radius * normals, normals, window)
        return float(np.outer(wz, wt).ravel() @ shares * np.pi * radius**2)

    def second(B, materials):
        rho = materials["floor.reflectance"]
        around = (1 - from_ball()) * B["room"] if room else 0.0
        return (1 - rho) * B["floor"] + rho * (from_ball() * B["ball"] + around)

    return draw.case(
        "ball",
        file,
        T,
        bounces,
        materials={"floor.reflectance": rho},
        response=reflected(share[None], share, ["ball"], room, bounces),
        second=second,
        second_error=2e-4,
        shows="floor",
    )


def box(draw: Draw) -> Case:
    """The floor of a box with black walls and maybe a lid, all at their own temperatures."""
    rho, T, up = draw.between(0.05, 0.95), {"floor": draw.background()}, draw.up()
    a, b, height = 1.0, draw.size(0.3, 3), draw.size(0.1, 5)  # half sides, and the walls' height
    file = SceneFile(draw.place(2.0))
    file.rectangle(np.zeros(3), a * X, b * Y, diffuse(rho, "floor") + thermal("floor", T["floor"]))
    half = height / 2 * UP
    sides = {
        f"wall{k}": turned_to_front((s * size * axis + half, other, half), -s * axis)
        for k, (s, axis, size, other) in enumerate(
            [(-1, X, a, b * Y), (1, X, a, b * Y), (-1, Y, b, a * X), (1, Y, b, a * X)]
        )
    }
    if draw.chance(0.5):
        sides["lid"] = turned_to_front((height * UP, a * X, b * Y), -UP)
    for name, rectangle in sides.items():
        T[name] = draw.temperature() if draw.chance(0.5) else draw.ambient()
        file.rectangle(*rectangle, BLACK + thermal(name, T[name]))
    half_window = draw.between(0.2, 0.99) * min(a, b) / (1 if up[1] == 1 else np.sqrt(2))
    bounces, eye = draw.whole(1, 3), 0.5 * height
    file.camera(eye * UP, -UP, up, half_window, 4 * eye, lens=draw.lens())
    names = list(sides)
    shares = converged(
        lambda points: [to_polygon(points, UP, corners(sides[name])) for name in names],
        np.zeros(3),
        up,
        half_window,
    )

    @cache
    def factors():
        """Closed forms, or for a turned window the means over its points."""
        w = half_window
        if up[1] != 1:
            window = turned_to_front((np.zeros(3), w * np.cross(-UP, up), w * up), UP)
            return [by_areas(window, sides[name], 6) for name in names]
        size = {"wall0": (a, b), "wall1": (a, b), "wall2": (b, a), "wall3": (b, a)}
        return [
            parallel_rectangles((-w, w), (-w, w), (-a, a), (-b, b), height)
            if name == "lid"
            else perpendicular_rectangles(
                (size[name][0] - w, size[name][0] + w),
                (-w, w),
                (-size[name][1], size[name][1]),
                (0, height),
            )
            for name in names
        ]

    def second(B, materials):
        rho = materials["floor.reflectance"]
        total = sum(factor * B[name] for factor, name in zip(factors(), names))
        return (1 - rho) * B["floor"] + rho * total

    return draw.case(
        "box",
        file,
        T,
        bounces,
        half_window=half_window,
        materials={"floor.reflectance": rho},
        response=reflected(shares, 0, names, False, bounces),
        second=second,
        second_error=1e-4,
        shows="floor",
    )


def keyhole(draw: Draw) -> Case:
    """A source above a black screen with a hole: the spot that it lights is within the window."""
    rho, T, up = draw.between(0.05, 0.95), {"floor": draw.background()}, draw.up()
    file = floor_scene(draw, draw.size(1.5, 10), rho, T["floor"])
    screen, height = draw.between(0.2, 1), draw.between(1.2, 3)
    hole, side = draw.size(1e-3, 0.1), draw.size(1e-3, 0.2)
    if np.sqrt(2) * height / (height - screen) * (hole + side) > 0.9:
        raise Unsuitable
    T["lamp"] = draw.temperature(300)
    file.rectangle(
        *turned_to_front((height * UP, side * X, side * Y), -UP),
        BLACK + thermal("lamp", T["lamp"]),
    )
    outer = 50.0
    middle, width = (outer + hole) / 2, (outer - hole) / 2
    for sign in (-1, 1):
        for centre, u, v in (
            (sign * middle * X, width * X, outer * Y),
            (sign * middle * Y, hole * X, width * Y),
        ):
            file.rectangle(*turned_to_front((centre + screen * UP, u, v), -UP), BLACK)
    bounces, eye = draw.whole(1, 3), 0.5 * screen
    file.camera(eye * UP, -UP, up, 1.0, 4 * eye, lens=draw.lens())
    square = (-side, side)
    opening = (-hole, hole)
    to_hole = parallel_rectangles(square, square, opening, opening, height - screen)
    points, weights = on_rectangle(height * UP, side * X, -side * Y, 16)
    hole_corners = corners((screen * UP, hole * X, hole * Y))
    by_points = weights @ to_polygon(points, -UP, hole_corners)
    if min(side, hole) < 0.02 * (height - screen):
        to_hole = by_points  # the closed form cancels
    share = by_points * side**2  # of the window's hemispheres, on average

    def second(B, materials):
        rho = materials["floor.reflectance"]
        return (1 - rho) * B["floor"] + rho * to_hole * side**2 * B["lamp"]

    return draw.case(
        "keyhole",
        file,
        T,
        bounces,
        materials={"floor.reflectance": rho},
        response=reflected(np.full((1, 1, 1), share), 0, ["lamp"], False, bounces),
        second=second,
        second_error=1e-6,
        shows="floor",
    )


def shadow(draw: Draw) -> Case:
    """A floor in the sun with the shadow of a small square within the window."""
    rho, T, up = draw.between(0.05, 0.95), {"floor": draw.background()}, draw.up()
    if draw.band == "total":
        draw.band = "MWIR"
    file = floor_scene(draw, draw.size(1.5, 10), rho, T["floor"])
    elevation, azimuth = np.radians(draw.between(30, 90)), draw.between(0, 2 * np.pi)
    toward = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    side, height = draw.size(1e-3, 0.3), draw.between(0.05, 0.3)
    if np.sqrt(2) * side + height / np.tan(elevation) > 0.9:
        raise Unsuitable
    file.rectangle(height * UP, side * X, side * Y, BLACK)
    irradiance = file.sun(toward, draw.band)
    bounces, eye = draw.whole(1, 3), 0.5 * height
    file.camera(eye * UP, -UP, up, 1.0, 4 * eye, lens=draw.lens())
    lit = 1 - side**2

    def response(B, materials):
        rho = materials["floor.reflectance"]
        rows = [(1 - rho) * B["floor"], rho / np.pi * B["sun"] * toward[2] * lit]
        return np.array(rows + [0.0] * (bounces - 1)).reshape(-1, 1, 1)

    def second(B, materials):
        """Area of the shadow from the projected corners, by the shoelace formula."""
        rho = materials["floor.reflectance"]
        points = corners((height * UP, side * X, side * Y))
        x, y = (points - points[:, 2:] / toward[2] * toward)[:, :2].T
        dark = abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2 / 4
        return (1 - rho) * B["floor"] + rho / np.pi * B["sun"] * toward[2] * (1 - dark)

    return draw.case(
        "shadow",
        file,
        T,
        bounces,
        materials={"floor.reflectance": rho},
        response=response,
        second=second,
        error=1e-5,
        shows="floor",
        irradiance=irradiance,
    )
