"""Claims of shapes, heat and materials by wavelength, beside those of the scene as it was drawn."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

import mi_lcair
from docs.studies.claims import planck
from docs.studies.claims.case import Case
from docs.studies.claims.scene_file import diffuse
from docs.studies.claims.witness import Claim, Witness, student
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.motions.pose import declare
from mi_lcair.rendering.motions.table import motions_of

WINDOW_FREEDOM = 7  # degrees of freedom of an error: the randomisations less one
STRETCH = "body.stretch"
SPECTRAL = (
    '<bsdf type="material" id="{name}"> <string name="material" value="{entry}"/> <string '
    'name="materials" value="spectral.toml"/> <string name="band" value="$band"/> </bsdf>'
)
SAME = 1e-4  # distance of two points that are one vertex, in sizes of the body
STEP_UM = 1e-5  # width of a step in a spectrum


def stretched(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """The derivative with respect to a motion that stretches a whole body."""
    body, scale = case.body, rng.uniform(-1, 1, 3)
    motion = {"groups": sorted(set(body.groups.tolist())), "scale": scale.tolist()}
    declare(scene, motions_of({STRETCH: motion}))
    paths, seed = int(2 ** rng.integers(10, 16)), int(rng.integers(1000))
    result = mi_lcair.sensitivities(scene, [STRETCH], paths=paths, seed=seed)
    if result.differences[STRETCH].verdict != "smooth":
        return  # the result says that it is no derivative
    truth = body.change(body.corners * scale, case.radiances(), case.materials)
    error = student(WINDOW_FREEDOM) * result.error[1]
    yield witness.claim("derivative, motion", result.derivative[0], truth, error)


def grown(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """The derivative with respect to an outward displacement of all vertices of a group."""
    body, group = case.body, str(rng.choice(case.body.groups))
    paths, seed = int(2 ** rng.integers(10, 16)), int(rng.integers(1000))
    result = mi_lcair.shape_derivatives(scene, group, paths=paths, seed=seed)
    size = np.ptp(body.corners, axis=(0, 1)).max()
    apart, nearest = KDTree(result.positions).query(body.corners)
    displaced = np.where(apart[..., None] < SAME * size, result.normals[nearest], 0.0)
    truth = body.change(displaced, case.radiances(), case.materials)
    error = student(WINDOW_FREEDOM) * result.growth_error
    yield witness.claim("derivative, vertices", result.growth, truth, error)


def conductors(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Conductors from the groups of a convex body to the sky."""
    result = mi_lcair.exchange(
        scene, paths=int(2 ** rng.integers(6, 11)), seed=int(rng.integers(1000))
    )
    vectors = case.body.areas
    emissivity = 1 - case.materials.get("paint.reflectance", 0.0)
    # The rest goes to the ground
    values, errors = result.by_group(lambda of: of.to_sky.sum(axis=1, keepdims=True))
    for name, value, error in zip(result.facets.groups, values[:, 0], errors[:, 0]):
        of_group = vectors[case.body.groups == name]
        area, upward = np.linalg.norm(of_group, axis=1).sum(), of_group[:, 2].sum()
        truth = emissivity * (area + upward) / 2
        stated = student(WINDOW_FREEDOM) * error
        yield witness.claim("conductor to the sky", value, truth, stated)


def balance(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Temperatures of a convex body's facets between sky and ground, in a steady state."""
    sky, ground = map(float, rng.uniform(200, 350, 2))
    weather = {"sky_K": sky, "ground_K": ground, "air_K": 300.0, "h_W_m2_K": 0.0}
    run = {"rays": int(2 ** rng.integers(6, 11)), "seed": int(rng.integers(1000))}
    result = mi_lcair.heat({"target": {"scene": str(scene.path)}, "weather": weather, "run": run})
    vectors = case.body.areas
    centre = FacetTable(scene).centre[result.facets.number]
    _, number = KDTree(case.body.corners.mean(axis=1)).query(centre)
    upward = (vectors[:, 2] / np.linalg.norm(vectors, axis=1))[number]
    truths = (((1 + upward) * sky**4 + (1 - upward) * ground**4) / 2) ** 0.25
    errors = student(WINDOW_FREEDOM) * result.estimate["exchange"].contribution[0]
    for value, truth, error in zip(result.kelvin[0], truths, errors, strict=True):
        yield witness.claim("temperature of a balance", value, truth, error)


def with_spectra(case: Case, scene: Path, spectra: dict[str, list[tuple]]) -> Path:
    """A scene file with spectra, pairs of wavelength [um] and reflectance, for the materials."""
    text, entries = scene.read_text(encoding="utf-8"), []
    for name, value in case.materials.items():
        owner = name.partition(".")[0]
        table = "".join(f"{x!r},{1 - rho!r}\n" for x, rho in spectra[name])
        scene.with_name(f"{owner}.csv").write_text("wavelength_um,emissivity\n" + table)
        entries.append(f'[of_{owner}.spectral]\nemissivity = "{owner}.csv"\n')
        text = text.replace(diffuse(value, owner), SPECTRAL.format(name=owner, entry=f"of_{owner}"))
    scene.with_name("spectral.toml").write_text("".join(entries), encoding="utf-8")
    path = scene.with_name("spectral.xml")
    path.write_text(text, encoding="utf-8")
    return path


def by_wavelength(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Interval or tolerance with materials whose reflectances have a step in the band."""
    lower, upper = planck.BANDS_UM[case.band]
    middle = float(rng.uniform(0.9 * lower + 0.1 * upper, 0.1 * lower + 0.9 * upper))
    parts, spectra = [{}, {}], {}
    ends = 0.9 * lower, middle, middle + STEP_UM, upper + 1
    for name, value in case.materials.items():
        reflectances = value, float(rng.uniform(0.05, 0.95))
        for part, reflectance in zip(parts, reflectances):
            part[name] = reflectance
        spectra[name] = list(zip(ends, np.repeat(reflectances, 2).tolist()))
    path = with_spectra(case, scene.path, spectra)
    truth = 0.0
    for limits, materials in zip(((lower, middle), (middle, upper)), parts):
        pixels = case.response(case.radiances_within(*limits), materials)
        truth += float(pixels.sum(axis=0).mean()) * case.area
    spp, seed, tolerance = int(2 ** rng.integers(6, 11)), int(rng.integers(1000)), None
    if rng.random() < 0.5:
        tolerance, most = float(rng.choice([0.03, 0.01])), witness.most_spp
        result = mi_lcair.signature(path, tolerance=tolerance, max_spp=most, seed=seed)
    else:
        result = mi_lcair.signature(path, spp=spp, seed=seed)
    target = result.target
    yield witness.claim("interval, by wavelength", target.intensity, truth, target.half_width)
    if tolerance and result.reached and result.main_part == "target":
        allowed = tolerance * truth
        yield witness.claim("tolerance, by wavelength", target.intensity, truth, allowed)


def suited(case: Case) -> list:
    """The commands of this file that suit a case."""
    commands = [by_wavelength] if case.materials and case.band != "total" else []
    if case.body is not None:
        commands += [conductors, balance] + [stretched, grown] * case.body.is_whole
    return commands
