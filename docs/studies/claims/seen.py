"""Black sources in direct sight, behind plumes and in mirrors: areas are all that matters."""

from collections import defaultdict

import numpy as np

from docs.studies.claims.case import Case, Draw, Unsuitable
from docs.studies.claims.lit import X, Y, turned_to_front
from docs.studies.claims.scene_file import BLACK, PIXELS, UP, SceneFile, mirror, plume, thermal

EYE = 0.5 * UP  # of the camera, whose window reaches from -1 to 1


def below_line(offset, half_x: float, half_y: float, angle: float):
    """Share of the rectangle +-half_x, +-half_y with x cos + y sin < offset.

    It is the distribution of a sum of two uniform numbers.
    """
    p, q = sorted([abs(half_x * np.cos(angle)), abs(half_y * np.sin(angle))], reverse=True)
    if q < 1e-9 * p:
        return np.clip((offset + p) / (2 * p), 0, 1)
    square = lambda t: np.maximum(t, 0) ** 2 / 2
    terms = square(offset + p + q) - square(offset + p - q) - square(offset - p + q)
    return np.clip((terms + square(offset - p - q)) / (4 * p * q), 0, 1)


def clipped_area(polygon, half: float) -> float:
    """Area of a convex polygon, (V, 2), within the square +-half (Sutherland and Hodgman)."""
    points = [np.asarray(p, float) for p in polygon]
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
        kept = []
        for a, b in zip(points, points[1:] + points[:1]):
            da, db = half - sign * a[axis], half - sign * b[axis]
            if da >= 0:
                kept.append(a)
            if (da > 0) != (db > 0):
                kept.append(a + da / (da - db) * (b - a))
        points = kept
        if not points:
            return 0.0
    x, y = np.transpose(points)
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)


def black_scene(draw: Draw, T: dict, up) -> SceneFile:
    """A black plate that fills the window, and a camera above it."""
    file = SceneFile(draw.place())
    file.rectangle(np.zeros(3), 2 * X, 2 * Y, BLACK + thermal("plate", T["plate"]))
    file.camera(EYE, -UP, up, 1.0, 4.0)
    return file


def padded(rows, bounces: int) -> np.ndarray:
    """The rows (K, H, W) with zeros for further reflections."""
    rows = np.asarray(rows, float)
    return np.concatenate([rows, np.zeros((bounces + 1 - len(rows), *rows.shape[1:]))])


def stripes(draw: Draw) -> Case:
    """Hot stripes on a cold plate, along the film or at an angle, at heights of their own."""
    T, bounces = {"plate": draw.background(), "stripes": draw.temperature()}, draw.whole(0, 2)
    count = int(draw.rng.choice([1, 2, 7, 64, 512]))
    angle = draw.rng.choice([0.0, np.pi / 2, 1e-3, draw.between(0, np.pi)], p=[0.3, 0.2, 0.1, 0.4])
    if count == 1:
        first = -1 + 2 * (draw.whole(1, 511) + 0.13) / 512
        starts, width = np.array([first]), draw.between(0.1, 3)
    else:
        period = 3 / count
        starts = -1.5 + period * (np.arange(count) + draw.between(0, 1))
        width = period * draw.between(0.05, 0.95)
    up = Y
    file = black_scene(draw, T, up)
    across = np.array([np.cos(angle), np.sin(angle), 0.0])
    along = np.array([-np.sin(angle), np.cos(angle), 0.0])
    heights = draw.rng.uniform(1e-3, 0.2, len(starts)) if draw.chance(0.3) else 0.01 + 0 * starts
    edges = [(start * across, (start + width) * across) for start in starts]
    polygons = [
        np.array([a - 3 * along, b - 3 * along, b + 3 * along, a + 3 * along]) + z * UP
        for (a, b), z in zip(edges, heights)
    ]
    file.mesh(polygons, BLACK + thermal("stripes", T["stripes"]))

    middle = (np.arange(PIXELS) + 0.5) / PIXELS * 2 - 1  # of pixels, to the right and downward
    x, y = np.meshgrid(middle, -middle)
    offsets = starts[:, None, None] - (x * np.cos(angle) + y * np.sin(angle))
    half = 1 / PIXELS
    share = (
        below_line(offsets + width, half, half, angle) - below_line(offsets, half, half, angle)
    ).sum(axis=0)

    def response(B, materials):
        return padded([share * B["stripes"] + (1 - share) * B["plate"]], bounces)

    def second(B, materials):
        hot = sum(clipped_area(polygon[:, :2], 1.0) for polygon in polygons) / 4
        return hot * B["stripes"] + (1 - hot) * B["plate"]

    def shows(B, materials):
        hot = share.mean()
        return {"stripes": hot * B["stripes"], "plate": (1 - hot) * B["plate"]}

    kind = "stripes, " + ("along the film" if angle in (0, np.pi / 2) else "at an angle")
    parts = {"materials": {}, "response": response, "second": second, "shows": shows}
    return draw.case(kind, file, T, bounces, **parts)


def specks(draw: Draw) -> Case:
    """Small sources on a plate, some of them out of sight: below it or beside the window."""
    T, bounces, up = {"plate": draw.background()}, draw.whole(0, 2), draw.up()
    file = black_scene(draw, T, up)
    area = 0.0
    shares = {}
    for k in range(draw.whole(1, 4)):
        side = draw.size(1e-4, 0.1)
        seen = draw.chance(0.7)
        name = f"speck{k}"
        T[name] = draw.temperature(300)
        middle = np.array([-0.75 + 0.5 * k, draw.between(-0.6, 0.6), 0.0]) / np.sqrt(2)
        if not seen:
            middle = middle + (3 * X if draw.chance(0.5) else 0)
        z = 1e-3 if seen else -draw.size(1e-3, 1)
        turn = draw.between(0, np.pi) if draw.chance(0.5) else 0.0
        u = side * np.array([np.cos(turn), np.sin(turn), 0.0])
        v = side * np.array([-np.sin(turn), np.cos(turn), 0.0])
        file.rectangle(middle + z * UP, u, v, BLACK + thermal(name, T[name]))
        shares[name] = seen * side**2
        area += seen * side**2

    def response(B, materials):
        total = (1 - area) * B["plate"] + sum(share * B[name] for name, share in shares.items())
        return padded(np.reshape(total, (1, 1, 1)), bounces)

    def second(B, materials):
        """The excess of each speck over the plate."""
        excess = [shares[name] * (B[name] - B["plate"]) for name in shares]
        return B["plate"] + sum(excess)

    def shows(B, materials):
        return {name: s * B[name] for name, s in ({"plate": 1 - area} | shares).items()}

    kind = "specks, " + ("seen" if area else "unseen")
    parts = {"materials": {}, "response": response, "second": second, "shows": shows}
    return draw.case(kind, file, T, bounces, **parts)


def layers(draw: Draw) -> Case:
    """Plumes in front of each other that fill parts of the window, before a plate or a mirror.

    Every ray goes straight through them, is reflected by the mirror, and returns through them to a
    black ceiling behind the camera.
    """
    count, bounces = draw.whole(1, 5), draw.whole(1, 3)
    reflectance = draw.between(0.3, 1) if draw.chance(0.6) else 0.0
    T = {f"plume{k}": draw.temperature() for k in range(count)}
    T["ceiling" if reflectance else "plate"] = draw.background()
    file = SceneFile(draw.place())
    if reflectance:
        file.rectangle(np.zeros(3), 2 * X, 2 * Y, mirror(reflectance))
        ceiling = turned_to_front((UP, 2 * X, 2 * Y), -UP)
        file.rectangle(*ceiling, BLACK + thermal("ceiling", T["ceiling"]))
    else:
        file.rectangle(np.zeros(3), 2 * X, 2 * Y, BLACK + thermal("plate", T["plate"]))
    file.camera(0.8 * UP, -UP, Y, 1.0, 4.0)
    through = [draw.between(0.02, 0.98) for _ in range(count)]
    sheets = []  # limits in x and y, from the top to the bottom
    for k in range(count):
        limits = np.sort(draw.rng.uniform(-1.3, 1.3, (2, 2)), axis=1)
        z = 0.7 * (1 - (k + draw.between(0.1, 0.9)) / count)
        middle, half = limits.mean(axis=1), np.diff(limits, axis=1)[:, 0] / 2
        inside = plume(through[k]) + thermal(f"plume{k}", T[f"plume{k}"])
        file.rectangle(np.array([*middle, z]), half[0] * X, half[1] * Y, inside)
        sheets.append(limits)

    grid = np.linspace(-1, 1, PIXELS + 1)
    edges = [
        np.unique(np.clip([*grid, *np.ravel([sheet[axis] for sheet in sheets])], -1, 1))
        for axis in (0, 1)
    ]
    middle = [(e[1:] + e[:-1]) / 2 for e in edges]
    number = [np.minimum(((m + 1) / 2 * PIXELS).astype(int), PIXELS - 1) for m in middle]
    number[1] = PIXELS - 1 - number[1]  # rows are counted from the top

    def along_rays(x, y, B):
        """Radiance with 0 and 1 reflections of the rays through these points."""
        down, passed, first = 1.0 * np.ones_like(x), [], np.zeros_like(x)
        front = np.full(x.shape, count)  # number of the first sheet on each ray
        for k, sheet in enumerate(sheets):
            covers = (sheet[0, 0] < x) & (x < sheet[0, 1]) & (sheet[1, 0] < y) & (y < sheet[1, 1])
            front = np.where(covers & (front == count), k, front)
            t = np.where(covers, through[k], 1.0)
            first = first + down * (1 - t) * B[f"plume{k}"]
            down = down * t
            passed.append((t, B[f"plume{k}"]))
        if not reflectance:
            return [first + down * B["plate"]], front
        second, up = np.zeros_like(x), reflectance * down
        for t, radiance in reversed(passed):
            second = second + up * (1 - t) * radiance
            up = up * t
        return [first, second + up * B["ceiling"]], front

    weight = np.outer(np.diff(edges[1]), np.diff(edges[0])) * PIXELS**2 / 4

    def shows(B, materials):
        cells, front = along_rays(*np.meshgrid(*middle), B)
        mean = weight * sum(cells) / PIXELS**2
        labels = [f"plume{k}" for k in range(count)] + ["other" if reflectance else "plate"]
        return {label: float(mean[front == k].sum()) for k, label in enumerate(labels)}

    def response(B, materials):
        rows = []
        for cell in along_rays(*np.meshgrid(*middle), B)[0]:
            image = np.zeros((PIXELS, PIXELS))
            np.add.at(image, np.meshgrid(*number)[::-1], weight * cell)
            rows.append(image)
        return padded(rows, bounces)

    def second(B, materials):
        """Products of the sheets' indicators: areas of the rectangles that sets of them share."""
        factor, total = {frozenset(): 1.0}, 0.0
        down, up = range(count), range(count - 1, -1, -1) if reflectance else ()
        for turn, k in [(0, k) for k in down] + [(1, k) for k in up]:
            crossed = defaultdict(float, factor)
            for sheets_before, value in factor.items():
                lost = value * (1 - through[k])
                total += reflectance**turn * lost * shared(sheets_before | {k}) * B[f"plume{k}"]
                crossed[sheets_before | {k}] -= lost
            factor = crossed
        behind = reflectance * B["ceiling"] if reflectance else B["plate"]
        return total + behind * sum(value * shared(of) for of, value in factor.items())

    def shared(numbers) -> float:
        """Share of the window that all of these sheets cover."""
        limits = np.array([[[-1, 1], [-1, 1]], *(sheets[k] for k in numbers)])
        sides = limits[..., 1].min(axis=0) - limits[..., 0].max(axis=0)
        return float(np.prod(np.maximum(sides, 0)) / 4)

    kind = "plumes, " + ("before a mirror" if reflectance else "before a plate")
    parts = {"materials": {}, "response": response, "second": second, "shows": shows}
    return draw.case(kind, file, T, bounces, **parts)


def mirrored(draw: Draw) -> Case:
    """A part of the window shows a mirror, and in it a source behind the camera."""
    T, bounces, up = {"plate": draw.background()}, draw.whole(1, 3), draw.up()
    file = black_scene(draw, T, up)
    reflectance, half = draw.between(0.5, 1), draw.between(0.1, 0.7)
    file.rectangle(0.01 * UP, half * X, half * Y, mirror(reflectance))
    T["speck"] = draw.temperature(300)
    side = half * draw.size(1e-3, 0.5)
    if side > 0.9 * half:
        raise Unsuitable
    height = draw.size(0.7, 100)
    x, y = (draw.between(-1, 1) * (half - side) for _ in range(2))
    speck = turned_to_front((np.array([x, y, height]), side * X, side * Y), -UP)
    file.rectangle(*speck, BLACK + thermal("speck", T["speck"]))

    def response(B, materials):
        rows = [(1 - half**2) * B["plate"], reflectance * side**2 * B["speck"]]
        return padded(np.reshape(rows, (-1, 1, 1)), bounces)

    def second(B, materials):
        """Areas of the mirror and of the speck's image by clipping, in the turned window."""
        right = np.cross(-UP, up)

        def area(middle, a):
            corners = [
                middle + s * a * X + t * a * Y for s, t in ((1, 1), (-1, 1), (-1, -1), (1, -1))
            ]
            return clipped_area([(p @ right, p @ up) for p in corners], 1.0) / 4

        of_mirror, image = area(np.zeros(3), half), area(np.array([x, y, 0.0]), side)
        return (1 - of_mirror) * B["plate"] + reflectance * image * B["speck"]

    def shows(B, materials):
        plate, of_mirror = response(B, materials)[:2, 0, 0]
        return {"plate": plate, "other": of_mirror}

    parts = {"materials": {}, "response": response, "second": second, "shows": shows}
    return draw.case("mirror", file, T, bounces, **parts)
