"""Convex bodies in a void, or under the sky and over terrain: the sum over their faces."""

import numpy as np

from docs.studies.claims.case import Body, Case, Draw
from docs.studies.claims.lit import X, Y
from docs.studies.claims.scene_file import BLACK, FARTHEST, UP, SceneFile, diffuse, thermal
from docs.studies.claims.sources import corners
from docs.studies.claims.view_factors import to_polygon

ROUND = 24  # sides of a cone
TERRAIN = 3.0  # depth of the terrain below the body's middle, in radii of the body
MARGIN = 1.2  # half the window over the radius of a body that may grow
POINTS = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6  # of a quadrature over a triangle


def cuboid(draw: Draw) -> list[np.ndarray]:
    """Six rectangles, of any proportions."""
    half = np.array([draw.size(1e-3, 1), draw.size(1e-2, 1), 1.0])
    axes, faces = np.eye(3), []
    for k in range(3):
        for sign in (-1, 1):
            u, v = (half[j] * axes[j] for j in range(3) if j != k)
            if np.cross(u, v) @ axes[k] * sign < 0:
                v = -v
            faces.append(corners((sign * half[k] * axes[k], u, v)))
    return faces


def cone(draw: Draw) -> list[np.ndarray]:
    """A cone of ROUND sides and its base."""
    angle = 2 * np.pi * np.arange(ROUND) / ROUND
    height = draw.size(0.05, 5)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle - height / 2], axis=1)
    tip = height / 2 * UP
    sides = [np.array([a, b, tip]) for a, b in zip(ring, np.roll(ring, -1, axis=0))]
    return [np.array(sides), ring[::-1]]


def plate(draw: Draw) -> list[np.ndarray]:
    """One rectangle, of one side."""
    return [corners((np.zeros(3), X, draw.size(0.05, 1) * Y))]


SHAPES = {"cuboid": cuboid, "cone": cone, "plate": plate}


def fans(face) -> np.ndarray:
    """The triangles (n, 3, 3) of a polygon or of several."""
    polygons = face if face.ndim == 3 else face[None]
    count = polygons.shape[1]
    fan = np.array([[0, k, k + 1] for k in range(1, count - 1)])
    return polygons[:, fan].reshape(-1, 3, 3)


def body(draw: Draw) -> Case:
    """A cuboid, cone or plate; in a void, in a uniform sky, or under the sky and over terrain."""
    kind = str(draw.rng.choice(list(SHAPES), p=[0.5, 0.25, 0.25]))
    around = str(draw.rng.choice(["void", "sky", "terrain"], p=[0.4, 0.2, 0.4]))
    if kind == "plate":
        around = "terrain"
    T, bounces, rho = {}, draw.whole(1, 3), 0.0 if draw.chance(0.3) else draw.between(0.05, 0.95)
    place = draw.place()
    file = SceneFile(place)
    rotation = draw.rotation()
    faces = [face @ rotation.T for face in SHAPES[kind](draw)]
    surface = BLACK
    if rho:
        file.parts.append(f"    {diffuse(rho, 'paint')}\n")
        surface = '<ref id="paint"/> '
    group_of, triangles = [], []
    for k, face in enumerate(faces):
        name = f"face{k % 3}"
        T.setdefault(name, draw.temperature() if draw.chance(0.4) else draw.ambient())
        polygons = face if face.ndim == 3 else face[None]
        file.mesh(polygons, surface + thermal(name, T[name]))
        triangles.append(fans(face))
        group_of += [name] * len(triangles[-1])
    triangles = np.concatenate(triangles)
    edges = triangles[:, 1:] - triangles[:, :1]
    vectors = np.cross(edges[:, 0], edges[:, 1]) / 2
    area = np.linalg.norm(vectors, axis=1)
    normals = vectors / area[:, None]
    radius = float(np.linalg.norm(triangles, axis=-1).max())

    def of_sky_and_terrain(nodes):
        """Share of each triangle's hemisphere that the terrain fills."""
        if around != "terrain":
            return np.zeros(len(triangles))
        points = np.einsum("pk,tki->tpi", nodes, triangles).reshape(-1, 3)
        all_normals = np.repeat(normals, len(nodes), axis=0)
        shares = to_polygon(points, all_normals, corners(ground))
        return shares.reshape(len(triangles), len(nodes)).mean(axis=1)

    if around != "void":
        T["sky"] = draw.background()
        far = min(draw.size(30, 1e5) * radius, FARTHEST / place.scale)
        file.room(np.zeros(3), far, "sky", T["sky"])
    if around == "terrain":
        T["terrain"] = draw.ambient()
        half = 0.6 * far
        ground = (-TERRAIN * radius * UP, half * X, half * Y)
        file.rectangle(*ground, BLACK + thermal("terrain", T["terrain"], "terrain"))
    of_terrain, of_terrain_again = (
        of_sky_and_terrain(nodes) for nodes in (POINTS, np.full((1, 3), 1 / 3))
    )
    sunlit = rho > 0 and draw.band != "total" and draw.chance(0.3)
    toward_sun, facing, irradiance = UP, np.zeros(len(triangles)), None
    if sunlit:
        toward_sun = draw.direction() * [1, 1, 0] + draw.between(0.3, 2) * UP
        toward_sun /= np.linalg.norm(toward_sun)
        irradiance = file.sun(toward_sun, draw.band)
        facing = of_disc(normals, toward_sun)

    eye = draw.direction()
    if around == "terrain":
        eye[2] = max(eye[2], 0.05)
        eye /= np.linalg.norm(eye)
    half_window = draw.size(1, 300) * radius
    side = np.cross(eye, X if abs(eye[0]) < 0.9 else Y)
    file.camera(2 * radius * eye, -eye, side / np.linalg.norm(side), half_window, 4 * radius)

    def radiances(B, materials, share):
        """Radiance of each triangle without a reflection and with one, (2, n)."""
        rho = materials.get("paint.reflectance", 0.0)
        own = (1 - rho) * np.array([B[name] for name in group_of])
        received = B.get("sun", 0.0) / np.pi * facing
        received = received + share * B.get("terrain", 0.0)
        if around != "void":
            received = received + (1 - share) * B["sky"]
        return np.array([own, rho * received])

    def toward(direction) -> np.ndarray:
        """Projected areas of the triangles [m^2]; the direction is that of the placed scene."""
        local = np.asarray(direction) @ place.rotation
        return np.maximum(vectors @ local, 0) * place.scale**2

    seen = toward(place.vectors(eye))
    window = (2 * half_window * place.scale) ** 2

    def response(B, materials):
        rows = radiances(B, materials, of_terrain) @ seen / window
        return np.reshape([*rows, *[0.0] * (bounces - 1)], (-1, 1, 1))

    def second(B, materials):
        """Projected outlines of the triangles, by the shoelace formula in the window's plane."""
        up = side / np.linalg.norm(side)
        x, y = triangles @ np.cross(up, eye), triangles @ up
        outline = (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1) / 2
        shown = np.where(normals @ eye > 0, abs(outline), 0)
        total = radiances(B, materials, of_terrain_again).sum(axis=0)
        return float(total @ shown / (2 * half_window) ** 2)

    def shows(B, materials):
        """Mean radiance by the group of the face that is seen."""
        shown = radiances(B, materials, of_terrain).sum(axis=0) * seen / window
        return {name: float(shown[np.equal(group_of, name)].sum()) for name in set(group_of)}

    def view(direction, B, materials):
        shown = toward(direction)
        total = radiances(B, materials, of_terrain).sum(axis=0)
        # The back of a plate emits nothing, but hides what is behind it
        projected = toward(-direction).sum() if kind == "plate" else 0.0
        return float(total @ shown), float(shown.sum() + projected)

    target = None
    if around != "terrain" and not sunlit:
        target = Body(
            place.points(triangles.reshape(-1, 3)).reshape(-1, 3, 3),
            np.array(group_of),
            lambda B, materials: radiances(B, materials, of_terrain).sum(axis=0),
            place.vectors(eye),
            is_whole=half_window > MARGIN * radius,
        )

    def facets(B, materials):
        return radiances(B, materials, of_terrain).sum(axis=0) * seen

    return draw.case(
        f"{kind}, {around}" + (", sun" if sunlit else ""),
        file,
        T,
        bounces,
        half_window=half_window,
        materials={"paint.reflectance": rho} if rho else {},
        response=response,
        second=second,
        error=1e-5 if sunlit else 2e-6,
        second_error=2e-3 if around == "terrain" else 1e-6,
        irradiance=irradiance,
        shows=shows,
        view=view,
        body=target,
        facets=facets,
        fills_window=around == "void",
    )


def of_disc(normals, toward) -> np.ndarray:
    """Mean cosine of the directions of the sun's disc above each horizon, (N,)."""
    radius = np.radians(0.53) / 2
    side = np.cross(toward, X if abs(toward[0]) < 0.9 else Y)
    side /= np.linalg.norm(side)
    angle = 2 * np.pi * (np.arange(64) + 0.5) / 64
    rings = radius * np.sqrt((np.arange(32) + 0.5) / 32)
    ring = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * np.cross(toward, side)
    directions = toward + (rings[:, None, None] * ring).reshape(-1, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions *= 1 / np.mean(directions @ toward)  # the irradiance is that of a facing plane
    return np.maximum(normals @ directions.T, 0).mean(axis=1)
