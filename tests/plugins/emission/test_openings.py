"""Openings of hollow bodies: what is drawn again, and that the mean does not change by it."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from benchmarks.methods.propagation import exact
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.emission.panels import Openings, area, lid, outlines
from mi_lcair.rendering.scene import changed
from mi_lcair.rendering.window import window_area

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
# A cube's faces, whose corners follow each other around it
FACES = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]


def cube(*faces):
    """Triangles of some faces of a unit cube."""
    quads = [CORNERS[list(FACES[face])] for face in faces]
    return np.concatenate([[quad[[0, 1, 2]], quad[[0, 2, 3]]] for quad in quads])


@pytest.mark.parametrize(
    ("faces", "edges"),
    [(range(6), []), (range(5), [4]), ((1, 3, 4, 5), [6]), ((0, 1, 2, 3), [4, 4]), ((0,), [4])],
)
def test_outlines_of_a_cube_without_some_faces(faces, edges):
    """Closed, without one face, without two that touch, a tube, and one face alone."""
    lines = outlines(cube(*faces))
    assert sorted(map(len, lines)) == edges
    for line in lines:
        steps = np.linalg.norm(line - np.roll(line, 1, axis=0), axis=1)
        np.testing.assert_allclose(steps, 1)


def test_lids_of_a_tube_have_the_area_of_its_ends():
    lids = [lid(line) for line in outlines(cube(0, 1, 2, 3))]
    assert [area(triangles) for triangles in lids] == pytest.approx([1, 1])
    assert len(lid(np.random.default_rng(1).normal(size=(100, 3)))) <= 32


def test_rays_cross_the_lids_that_geometry_says():
    """Random rays against the solution of corner + u edge_1 + v edge_2 = p + t d in Float64."""
    rng = np.random.default_rng(2)
    openings = Openings(rng.normal(size=(7, 3, 3)))
    p, d = rng.normal(size=(2, 3, 500))
    panel, distance = openings.crossed(mi.Point3f(p), mi.Vector3f(d), mi.Bool(True))
    rows = openings.panels.rows.numpy().astype(float).reshape(-1, 3, 4)[:, :, :3]
    matrix = np.stack([*np.broadcast_arrays(rows[:, None, 1], rows[:, None, 2], -d.T)], axis=3)
    u, v, t = np.moveaxis(
        np.linalg.solve(matrix, (p.T - rows[:, None, 0])[..., None])[..., 0], 2, 0
    )
    hits = (np.minimum(u, v) >= 0) & (u + v <= 1) & (t > 0)
    expected = np.where(hits.any(axis=0), hits.argmax(axis=0), 7)
    assert len(np.unique(expected)) == 8
    np.testing.assert_array_equal(panel.numpy(), expected)
    some = expected < 7
    along = np.take_along_axis(t, np.minimum(expected, 6)[None], axis=0)[0]
    np.testing.assert_allclose(distance.numpy()[some], along[some], rtol=1e-3)


def intensities(scene, paths, seeds, **settings):
    with changed(scene, emitter_sampling=False, **settings):
        return np.array(
            [mi_lcair.signature(scene, spp=paths, seed=seed).target.intensity for seed in seeds]
        )


def test_a_cavity_has_its_closed_form_and_a_hundredth_of_the_variance():
    scene = mi_lcair.load("cavity", opening=8, resolution=1)
    expected = exact.cavity_emissivity(8) * float(in_band_radiance(scene.band, 800))
    expected *= window_area(scene.sensor(0), scene.name)
    away, anyhow = (
        intensities(scene, 2**11, range(12), opening_sampling=value) for value in (True, False)
    )
    # The facets differ from the sphere by less than 2e-4
    assert away.mean() == pytest.approx(expected, rel=2e-4)
    assert away.var(ddof=1) < 0.01 * anyhow.var(ddof=1)


TUBE = """<scene version="3.0.0">
    <integrator type="bounce_path"> <integer name="max_bounces" value="6"/>
        <string name="opening_sampling" value="$opening_sampling"/> </integrator>
    <sensor type="orthographic">
        <transform name="to_world">
            <scale x="0.2" y="0.2"/> <lookat origin="2, 0.3, 0.2" target="0, 0, 0" up="0, 0, 1"/>
        </transform>
        <film type="hdrfilm"> <string name="pixel_format" value="luminance"/> <rfilter type="box"/>
            <integer name="width" value="1"/> <integer name="height" value="1"/> </film>
    </sensor>
    <shape type="ply">
        <string name="filename" value="tube.ply"/> <boolean name="face_normals" value="true"/>
        <bsdf type="twosided"> <bsdf type="sandford_robertson" id="wall">
            <float name="epsilon" value="0.3"/> <float name="rho_d" value="0.3"/>
            <float name="b" value="0.6"/> <float name="e" value="0.3"/>
        </bsdf> </bsdf>
        <emitter type="thermal"> <string name="band" value="LWIR"/>
            <float name="temperature" value="500"/> </emitter>
    </shape>
</scene>"""


@pytest.fixture
def tube(tmp_path):
    """A square tube of two-sided walls with broad lobes, open at the near end and at the side."""
    corners = cube(0, 2, 4, 5).reshape(-1, 3) - np.float32(0.5)
    mesh = mi.Mesh("tube", len(corners), len(corners) // 3)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"], parameters["faces"] = corners.ravel(), np.arange(len(corners))
    parameters.update()
    mesh.write_ply(str(tmp_path / "tube.ply"))
    (tmp_path / "tube.xml").write_text(TUBE)
    return lambda value: mi_lcair.load(tmp_path / "tube.xml", opening_sampling=value)


def test_directional_walls_and_large_openings_keep_their_mean(tube):
    """The same radiance with and without, within 3.3 standard errors of the difference: P = .1 %.

    Half of the reflections leave, so that a probability wrong by 5 % would show.
    """
    runs = [
        intensities(tube(value), 2**13, range(12), opening_sampling=value == "true")
        for value in ("true", "false")
    ]
    difference = runs[0].mean() / runs[1].mean() - 1
    error = np.hypot(*(run.std(ddof=1) / run.mean() / np.sqrt(12) for run in runs))
    assert error < 2e-3 and abs(difference) < 3.3 * error


def test_derivatives_follow_first_tries(tube):
    """A replay has the directions of the first tries only, whatever the setting."""
    gradients = []
    for value in ("true", "false"):
        scene = tube(value)
        parameters = mi.traverse(scene.mi)
        name = next(key for key, _ in parameters if key.endswith("rho_d"))
        dr.enable_grad(parameters[name])
        parameters.update()
        image = mi.render(scene.mi, parameters, spp=64, seed=3)
        dr.backward(dr.sum(image.array))
        gradients.append(float(dr.grad(parameters[name]).numpy().ravel()[0]))
    # The order in which threads add changes the last digits
    assert gradients[0] == pytest.approx(gradients[1], rel=1e-5) and gradients[0] != 0


def test_without_openings_nothing_is_drawn_again():
    furnace, plates = mi_lcair.load("furnace"), mi_lcair.load("two_plates")
    assert Openings.of(furnace.mi) is None and Openings.of(plates.mi) is not None
