"""Temperatures of facets from the cells or the nodes of a FEM mesh."""

import meshio
import numpy as np
import pytest

from mi_lcair import models3d, scenes
from mi_lcair.errors import InputError

BOX = scenes.FOLDER / "examples" / "box.obj"


def field(points):
    """A temperature that is linear in space."""
    return 300 + points @ np.array([10.0, 20.0, 40.0])


@pytest.fixture
def mesh():
    """The box as a mesh of its facets."""
    model = models3d.read(BOX)
    points = model.vertices
    faces = np.split(model.corners, model.first[1:-1])
    return meshio.Mesh(points, [("quad", np.array(faces))]), points, faces


@pytest.mark.parametrize("suffix", [".vtu", ".inp"])
def test_nodes_and_cells(mesh, tmp_path, suffix):
    grid, points, faces = mesh
    middle = np.array([points[face].mean(axis=0) for face in faces])
    grid.point_data = {"Temperature": field(points)}
    if suffix == ".inp":  # Abaqus, whose files in meshio have no fields
        grid.write(tmp_path / "fem.inp")
        with pytest.raises(InputError, match="its fields are none"):
            models3d.read(BOX, temperatures=tmp_path / "fem.inp")
        return
    grid.write(tmp_path / f"nodes{suffix}")
    model = models3d.read(BOX, temperatures=tmp_path / f"nodes{suffix}")
    np.testing.assert_allclose(model.temperature, field(middle), atol=1e-9)
    grid.point_data, grid.cell_data = {}, {"T_kelvin": [field(middle)]}
    grid.write(tmp_path / f"cells{suffix}")
    model = models3d.read(BOX, temperatures=tmp_path / f"cells{suffix}")
    np.testing.assert_allclose(model.temperature, field(middle), atol=1e-9)
    assert not any("cells" in remark for remark in model.remarks)


def test_doubtful_and_unusable(mesh, tmp_path):
    grid, points, _ = mesh
    grid.points = points * 1000  # millimetres
    grid.point_data = {"temperature": field(points)}
    grid.write(tmp_path / "mm.vtu")
    model = models3d.read(BOX, temperatures=tmp_path / "mm.vtu")
    assert any("m away" in remark for remark in model.remarks)
    grid.point_data = {"temperature": field(points), "temp_2": field(points)}
    grid.write(tmp_path / "two.vtu")
    with pytest.raises(InputError, match="needs one field"):
        models3d.read(BOX, temperatures=tmp_path / "two.vtu")
    (tmp_path / "bad.vtu").write_text("nothing")
    with pytest.raises(InputError, match="cannot be read"):
        models3d.read(BOX, temperatures=tmp_path / "bad.vtu")
