"""A floor under lamps, the sun, a sky and a sheet of plume, all at once or some of them."""

from functools import cache

import numpy as np

from docs.studies.claims.case import Case, Draw, converged
from docs.studies.claims.lit import Lamps, X, Y, rectangles_above, turned_to_front
from docs.studies.claims.scene_file import PIXELS, UP, SceneFile, diffuse, plume, thermal
from docs.studies.claims.seen import clipped_area
from docs.studies.claims.sources import add_spotted, corners
from docs.studies.claims.view_factors import on_rectangle, parallel_rectangles, to_polygon

TRIES = 30  # directions of the sun that are drawn until the lamps' shadows miss the floor
PENUMBRA = 0.02  # width of the edge of a shadow, in distances; twice that of the sun's disc


def combined(draw: Draw) -> Case:
    """The floor fills the window, or is a small part of it, at which paths are then aimed."""
    is_part = draw.chance(0.4)
    half_floor = draw.size(1e-2, 0.5) if is_part else draw.size(1.5, 10)
    reach, up, rho = min(half_floor, np.sqrt(2)), draw.up(), draw.between(0.05, 0.95)
    file, T = SceneFile(draw.place(100.0)), {}
    floor, surface = (np.zeros(3), half_floor * X, half_floor * Y), diffuse(rho, "floor")
    of_hot, cold = np.zeros((1, 1)), "floor"
    if draw.chance(0.4):
        way = "texture" if draw.chance(0.5) else "facets"
        spot, cold = add_spotted(draw, file, "floor", floor, T, way, surface).items()
        of_hot, cold = shares_of_pixels(corners(spot[1]), up), cold[0]
    else:
        T["floor"] = draw.background()
        file.rectangle(*floor, surface + thermal("floor", T["floor"]))
    rectangles = rectangles_above(
        draw, str(draw.rng.choice(["parallel", "perpendicular", "inclined"])), reach
    )
    lamps = Lamps(draw, file, rectangles, T)
    points = np.concatenate([corners(rectangle) for rectangle in rectangles])
    if draw.chance(0.7):
        T["room"] = draw.background()
        extent = 2 + half_floor * np.sqrt(2) + np.linalg.norm(points, axis=1).max()
        file.room(np.zeros(3), draw.size(3, 1e6) * extent, "room", T["room"])
    toward, irradiance = sun(draw, file, rectangles, reach)
    eye = 0.5 * lamps.lowest
    sheet, through = None, 1.0
    if not is_part and draw.chance(0.5):
        through, T["plume"] = draw.between(0.1, 0.95), draw.temperature()
        sheet = sheet_below(draw, eye, points, toward)
        file.rectangle(*sheet, plume(through) + thermal("plume", T["plume"]))
    bounces = draw.whole(1, 3)
    file.camera(eye * UP, -UP, up, 1.0, 4 * eye, lens="" if is_part else draw.lens())

    def shares(points):
        of_sheet = 0 * points[:, 0]
        if sheet is not None:
            of_sheet = to_polygon(points, UP, corners(sheet))
        return [*lamps.shares(points), of_sheet]

    middle = (np.zeros(3), Y) if is_part else (np.zeros(3), up)
    received = converged(shares, *middle, half_floor if is_part else 1.0)
    if is_part:
        received = received.mean(axis=(1, 2), keepdims=True)
    covered = half_floor**2 if is_part else 1.0  # share of the window
    if is_part:
        of_hot = of_hot.mean(keepdims=True)

    def response(B, materials, received=received):
        *of_lamps, blocked, of_sheet = received
        rho = materials["floor.reflectance"]
        light = through * np.einsum("k,khw->hw", [B[name] for name in lamps.names], of_lamps)
        light = light + through * B.get("sun", 0.0) / np.pi * toward[2]
        light = light + of_sheet * (1 - through) * B.get("plume", 0.0)
        light = light + (1 - of_sheet + through * (of_sheet - blocked)) * B.get("room", 0.0)
        own = covered * B[cold] + of_hot * (B.get("floor@hot", B[cold]) - B[cold])
        first = (1 - through) * B.get("plume", 0.0) + through * (1 - rho) * own
        once = through * rho * covered * light
        first, once = np.broadcast_arrays(first, once)
        return np.array([first, once] + [0 * once] * (bounces - 1))

    @cache
    def factors():
        half = half_floor if is_part else 1.0
        right, upward = (X, Y) if is_part else (np.cross(-UP, up), np.asarray(up))
        window = turned_to_front((np.zeros(3), half * right, half * upward), UP)
        of_sheet = 0.0
        if sheet is not None:
            z, limits = sheet[0][2], (-sheet[1][0], sheet[1][0])
            if up[1] == 1:
                of_sheet = parallel_rectangles((-1, 1), (-1, 1), limits, limits, z)
            else:
                nodes, weights = on_rectangle(*window, 30)
                of_sheet = weights @ to_polygon(nodes, UP, corners(sheet))
        return np.reshape([*lamps.factors(window), of_sheet], (-1, 1, 1))

    def second(B, materials):
        return float(response(B, materials, factors()).mean(axis=(1, 2)).sum())

    names = {"sun": irradiance, "plume": sheet, "room": T.get("room")}
    parts = [name for name, value in names.items() if value is not None]
    return draw.case(
        ", ".join(["small floor" if is_part else "floor", *parts]),
        file,
        T,
        bounces,
        materials={"floor.reflectance": rho},
        response=response,
        second=second,
        second_error=1e-3,
        error=1e-5 if irradiance else 2e-6,
        irradiance=irradiance,
        shows="floor" if sheet is None else "plume",
        fills_window=not is_part,
    )


def sun(draw: Draw, file: SceneFile, rectangles: list, reach: float) -> tuple:
    """Direction and irradiance of a sun that the rectangles do not hide from the floor's part.

    The irradiance is None without one, as in the band total or where no direction does.
    """
    for _ in range(TRIES if draw.band != "total" and draw.chance(0.6) else 0):
        toward = draw.direction()
        toward[2] = abs(toward[2]) + 0.3
        toward /= np.linalg.norm(toward)
        for points in map(corners, rectangles):
            shadow = (points - points[:, 2:] / toward[2] * toward)[:, :2]
            edge = PENUMBRA * points[:, 2].max() / toward[2] ** 2 + reach
            if np.all((shadow.min(axis=0) < edge) & (shadow.max(axis=0) > -edge)):
                break
        else:
            return toward, file.sun(toward, draw.band)
    return UP, None


def sheet_below(draw: Draw, eye: float, points, toward) -> tuple:
    """A rectangle below the camera through which all light to the window goes.

    points: corners of the lamps, the lowest of which is twice as high as the camera.
    """
    z = eye * draw.between(0.2, 0.8)
    to_lamps = z / (2 * eye) * abs(points[:, :2]).max()
    to_sun = 1.1 * z * np.linalg.norm(toward[:2]) / toward[2]
    half = 1.05 * (np.sqrt(2) + max(to_lamps, to_sun)) * draw.size(1, 5)
    return z * UP, half * X, half * Y


def shares_of_pixels(polygon, up) -> np.ndarray:
    """Share of each pixel that a polygon of the plane z = 0 covers, (H, W) from the upper left."""
    plane = polygon @ np.array([np.cross(-UP, up), up]).T
    middle = (np.arange(PIXELS) + 0.5) / PIXELS * 2 - 1
    areas = [[clipped_area(plane - [x, y], 1 / PIXELS) for x in middle] for y in -middle]
    return np.array(areas) * PIXELS**2 / 4
