import meshio
import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.formats import vtk

# A triangle, a quadrilateral, and a concave pentagon that is not in a coordinate plane
VERTICES = np.array(
    [
        [0, 0, 0],
        [1, 0, 0],
        [0, 1, 0],
        [1, 1, 0],
        [2, 0, 1],
        [2, 2, 1],
        [1, 1.1, 0.5],
        [1e3, 0, 1e-9],
    ]
)
FACES = [[0, 1, 2], [0, 1, 3, 2], [1, 4, 5, 3, 6]]
COLUMNS = {
    "facet": np.arange(3),
    "group": np.array(["wing", "fuselage", "wing--<&"], object),
    "temperature_K": np.array([300.0, np.nan, 1 / 3]),
    "radiance_W_m2_sr": np.array([1, 2, 3], np.float32),
    "seen": np.array([True, False, True]),
}


def test_meshio_reads_vtu(tmp_path):
    vtk.write_facets(tmp_path / "a.vtu", VERTICES, FACES, COLUMNS)
    mesh = meshio.read(tmp_path / "a.vtu")
    np.testing.assert_array_equal(mesh.points, VERTICES)  # bit for bit
    assert [row.tolist() for block in mesh.cells for row in block.data] == FACES
    assert [block.type for block in mesh.cells] == ["triangle", "quad", "polygon"]
    for name in ("facet", "temperature_K", "radiance_W_m2_sr", "seen"):
        np.testing.assert_array_equal(np.concatenate(mesh.cell_data[name]), COLUMNS[name])
    assert np.concatenate(mesh.cell_data["group_number"]).tolist() == [1, 0, 2]
    assert "0 = fuselage, 1 = wing" in (tmp_path / "a.vtu").read_text()


@pytest.mark.parametrize("suffix", [".vtp", ".vtu"])
def test_vtk_itself_reads_it(tmp_path, suffix):
    """As ParaView does; VTK is no requirement of the tests."""
    xml = pytest.importorskip("vtkmodules.vtkIOXML")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    vtk.write_facets(tmp_path / f"a{suffix}", VERTICES, FACES, COLUMNS)
    reader = (xml.vtkXMLPolyDataReader if suffix == ".vtp" else xml.vtkXMLUnstructuredGridReader)()
    reader.SetFileName(str(tmp_path / f"a{suffix}"))
    reader.Update()
    mesh, data = reader.GetOutput(), reader.GetOutput().GetCellData()
    points = [mesh.GetPoint(k) for k in range(mesh.GetNumberOfPoints())]
    assert np.array_equal(points, VERTICES)
    cells = [mesh.GetCell(k).GetPointIds() for k in range(mesh.GetNumberOfCells())]
    assert [[ids.GetId(k) for k in range(ids.GetNumberOfIds())] for ids in cells] == FACES
    for name in ("facet", "temperature_K", "radiance_W_m2_sr", "seen"):
        np.testing.assert_array_equal(vtk_to_numpy(data.GetArray(name)), COLUMNS[name])
    if suffix == ".vtp":
        texts = data.GetAbstractArray("group")
        assert [texts.GetValue(k) for k in range(3)] == COLUMNS["group"].tolist()


def test_no_facets(tmp_path):
    vtk.write_facets(tmp_path / "a.vtp", np.zeros((0, 3)), [], {"facet": np.zeros(0, int)})
    assert (tmp_path / "a.vtp").exists()


def test_another_suffix(tmp_path):
    with pytest.raises(InputError, match="does not end in .vtp or .vtu"):
        vtk.write_facets(tmp_path / "a.vtk", VERTICES, FACES, COLUMNS)
    assert not list(tmp_path.iterdir())
