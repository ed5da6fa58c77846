"""Texts of OBJ files whose areas, volumes and flaws are known."""

CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
SIDES = [
    (0, 1, 3, 2),
    (4, 6, 7, 5),
    (0, 4, 5, 1),
    (2, 3, 7, 6),
    (0, 2, 6, 4),
    (1, 5, 7, 3),
]  # -x +x -y +y -z +z, outward
SKY = (
    "elevation_deg,wavelength_um,radiance_W_m2_sr_um\n"
    + "".join(  # radiances that fall evenly from 1 to 0.5 at the zenith
        f"{elevation},{step / 20},{1 - elevation / 180}\n"
        for elevation in (0, 45, 90)
        for step in range(150, 251)
    )
)


def obj(points, faces, label="f*bareAl*300*"):
    """An object of its own vertices; faces count from 0. Negative indices, so that texts can be
    strung together.
    """
    return "".join(
        [
            f"o {label}\n" if label else "o Cube\n",
            *("v {:.9g} {:.9g} {:.9g}\n".format(*point) for point in points),
            *("f " + " ".join(str(index - len(points)) for index in face) + "\n" for face in faces),
        ]
    )


def cube(at=(0, 0, 0), size=1, flip=(), without=(), again=(), label="f*bareAl*300*"):
    """A box; the sides `flip` face inward, `without` are missing, `again` exist twice."""
    points = [[a + size * x for a, x in zip(at, corner)] for corner in CORNERS]
    sides = [side[::-1] if number in flip else side for number, side in enumerate(SIDES)]
    chosen = [number for number in range(6) if number not in without] + list(again)
    return obj(points, [sides[number] for number in chosen], label)
