"""A scene of many shapes: loading takes time in proportion to their number, and nothing nests."""

from time import process_time

import mitsuba as mi
import pytest

import mi_lcair

SHAPE = """<shape type="ply"> <string name="filename" value="square.ply"/>
    <transform name="to_world"> <translate x="{x}" y="{y}"/> </transform>
    <bsdf type="material"> <string name="material" value="gloss_black"/>
        <string name="band" value="MWIR"/> </bsdf>
    <emitter type="thermal"> <string name="band" value="MWIR"/>
        <float name="temperature" value="{kelvin}"/> </emitter>
</shape>"""
SCENE = """<scene version="3.0.0"> <integrator type="bounce_path"/>
<sensor type="orthographic">
    <transform name="to_world"> <scale x="60" y="60"/>
        <lookat origin="60, 60, 50" target="60, 60, 0" up="0, 1, 0"/> </transform>
    <film type="hdrfilm"> <integer name="width" value="16"/> <integer name="height" value="16"/>
        <rfilter type="box"/> <string name="pixel_format" value="luminance"/> </film>
</sensor> {shapes} </scene>"""
ROW = 40  # shapes along x, 3 m apart


@pytest.fixture
def scene_of(tmp_path):
    """A function that writes the scene of so many squares of two triangles each."""
    square = mi.Mesh("square", 4, 2)
    parameters = mi.traverse(square)
    parameters["vertex_positions"] = [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0]
    parameters["faces"] = [0, 1, 2, 0, 2, 3]
    parameters.update()
    square.write_ply(str(tmp_path / "square.ply"))

    def write(count):
        shapes = [
            SHAPE.format(x=3 * (k % ROW), y=3 * (k // ROW), kelvin=300 + k / 100)
            for k in range(count)
        ]
        path = tmp_path / f"{count}.xml"
        path.write_text(SCENE.format(shapes="\n".join(shapes)))
        return path

    return write


@pytest.mark.slow
def test_thousand_emitters(scene_of):
    """Mitsuba creates the next object while one waits for an evaluation in its constructor. Before,
    about 490 emitters nested deeper than Python allows.
    """
    scene = mi_lcair.load(scene_of(600))
    assert len(scene.mi.emitters()) == 600
    assert {shape.id() for shape in scene.mi.shapes()} == {
        "ply",
        *(f"ply_{k}" for k in range(2, 601)),
    }
    emission = mi_lcair.render(scene, spp=16)
    scene.mi.integrator().emitter_sampling = True
    drawn = mi_lcair.render(scene, spp=16)
    # Squares in one plane do not see each other
    assert drawn.mean == pytest.approx(emission.mean, rel=1e-5) and emission.mean > 0


@pytest.mark.slow
def test_time_grows_with_the_number_of_shapes(scene_of):
    """CPU time for four times as many shapes; 16 times as much would be quadratic."""

    def seconds(path):
        times = []
        for _ in range(2):
            begin = process_time()
            mi_lcair.load(path)
            times.append(process_time() - begin)
        return min(times)

    few, many = scene_of(100), scene_of(400)
    assert seconds(many) < 8 * seconds(few)
