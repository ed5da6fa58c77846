"""Tests of the channels of radiance images."""

import struct

import meshio
import numpy as np
import pandas
import pytest
import xarray
from PIL import Image

from mi_lcair import formats
from mi_lcair.errors import InputError
from mi_lcair.formats import column_of, has_value, quantity_of_channel


def test_table_with_units(tmp_path):
    columns = {
        "wavelength_um": np.array([3.0, 4.0, 5.0]),
        "target_W_sr_um": np.array([1 / 3, np.nan, 2e-30]),
        "paths": np.array([2**40, 1, 2]),
        "facet": np.array([0, 1, 2]),
        "group": np.array(["hot", "Täil", ""], object),
    }
    formats.write_netcdf(tmp_path / "a.nc", formats.table(columns, "wavelength_um", scene="cavity"))
    with xarray.open_dataset(tmp_path / "a.nc") as data:
        assert data.attrs["scene"] == "cavity"
        assert data.target_W_sr_um.attrs["units"] == "W sr-1 um-1"
        assert data.wavelength_um.attrs["units"] == "um" and data.wavelength_um.dims == (
            "wavelength_um",
        )
        assert "units" not in data.paths.attrs and data.paths.values.tolist() == [2**40, 1, 2]
        assert data.facet.dtype.kind == "i" and data.group.values.tolist() == ["hot", "Täil", ""]
        # 64 bits
        np.testing.assert_array_equal(data.target_W_sr_um, columns["target_W_sr_um"])
        assert data.sel(wavelength_um=3).target_W_sr_um == 1 / 3


def test_grid(tmp_path):
    azimuth, elevation = map(np.ravel, np.meshgrid([0.0, 90.0, 45.0], [-10.0, 0.0]))
    value = azimuth + 1000 * elevation
    columns = {
        "azimuth_deg": azimuth,
        "elevation_deg": elevation,
        "intensity_W_sr": value,
        "invalid": value.astype(int),
        "group.a/b_W_sr": value,
    }
    dataset = formats.grid(columns, ("elevation_deg", "azimuth_deg"))
    formats.write_netcdf(tmp_path / "a.nc", dataset)
    with xarray.open_dataset(tmp_path / "a.nc") as data:
        assert data.intensity_W_sr.dims == ("elevation_deg", "azimuth_deg")
        assert data.azimuth_deg.values.tolist() == [0, 45, 90]
        for name in ("intensity_W_sr", "invalid", "group.a_b_W_sr"):
            assert data[name].sel(azimuth_deg=45, elevation_deg=-10) == 45 - 10000
    # A missing point is NaN
    dataset = formats.grid({k: v[1:] for k, v in columns.items()}, ("elevation_deg", "azimuth_deg"))
    assert np.isnan(dataset.intensity_W_sr.sel(azimuth_deg=0, elevation_deg=-10))
    assert np.isnan(dataset.invalid).sum() == 1


@pytest.mark.parametrize(
    "key, dimension", [({"range_m": [1.0, 2, 3]}, "row"), ({"time_s": [0.0, 1, 2]}, "time_s")]
)
def test_rows_of_one_direction_stay_apart(tmp_path, key, dimension):
    """A sweep over ranges, and a flight: no row of theirs is lost."""
    columns = {"azimuth_deg": [5.0, 5, 7], "elevation_deg": [1.0, 1, 1], **key}
    formats.write_netcdf(tmp_path / "a.nc", formats.dataset(columns))
    with xarray.open_dataset(tmp_path / "a.nc") as data:
        assert data.azimuth_deg.dims == (dimension,)
    read = formats.read_netcdf_columns(tmp_path / "a.nc")
    assert {name: read[name].tolist() for name in columns} == columns


def test_names_that_netcdf_lacks(tmp_path):
    with pytest.raises(InputError, match="same name"):
        formats.write_netcdf(tmp_path / "a.nc", formats.table({"a/b": [1], "a_b": [2]}))
    assert not list(tmp_path.iterdir())


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
    formats.write_facets(tmp_path / "a.vtu", VERTICES, FACES, COLUMNS)
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

    formats.write_facets(tmp_path / f"a{suffix}", VERTICES, FACES, COLUMNS)
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
    formats.write_facets(tmp_path / "a.vtp", np.zeros((0, 3)), [], {"facet": np.zeros(0, int)})
    assert (tmp_path / "a.vtp").exists()


def test_another_suffix(tmp_path):
    with pytest.raises(InputError, match="does not end in .vtp or .vtu"):
        formats.write_facets(tmp_path / "a.vtk", VERTICES, FACES, COLUMNS)
    assert not list(tmp_path.iterdir())


def tags(data: bytes) -> dict:
    """Values of the first page's tags, by number, from the bytes of a little-endian TIFF file."""
    assert data[:4] == b"II*\0"
    (place,) = struct.unpack_from("<I", data, 4)
    (count,) = struct.unpack_from("<H", data, place)
    found = {}
    for k in range(count):
        tag, kind, number = struct.unpack_from("<HHI", data, place + 2 + 12 * k)
        letter = {2: "s", 3: "H", 4: "I", 5: "II"}[kind]
        form = f"<{number}{letter}" if kind != 5 else f"<{2 * number}I"
        at = place + 10 + 12 * k
        if struct.calcsize(form) > 4:
            (at,) = struct.unpack_from("<I", data, at)
        found[tag] = struct.unpack_from(form, data, at)
    return found


def test_kelvin_in_32_bits(tmp_path):
    """Read by the format's specification, not by the library that wrote it."""
    kelvin = np.linspace(250, 400, 35).reshape(5, 7)
    kelvin[0, 0] = np.nan
    formats.write_tiff(tmp_path / "a.tif", kelvin, "temperature.Y, K")
    data = (tmp_path / "a.tif").read_bytes()
    found = tags(data)
    assert found[256] == (7,) and found[257] == (5,)
    assert found[258] == (32,) and found[339] == (3,)  # bits of a sample; floating point
    assert found[259] == (1,)  # not compressed
    assert found[270][0].rstrip(b"\0") == b"temperature.Y, K"
    assert 306 not in found  # no date
    strips = b"".join(data[at : at + n] for at, n in zip(found[273], found[279]))
    np.testing.assert_array_equal(
        np.frombuffer(strips, "<f4").reshape(5, 7), kelvin.astype(np.float32)
    )


def test_pages_of_counts(tmp_path):
    counts = np.arange(24, dtype=np.uint16).reshape(2, 3, 4) * 2000
    formats.write_tiff(tmp_path / "a.tif", counts)
    with Image.open(tmp_path / "a.tif") as file:
        assert file.n_frames == 2
        for page in range(2):
            file.seek(page)
            np.testing.assert_array_equal(np.array(file), counts[page])


def test_unwritable(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        formats.write_tiff(tmp_path / "no" / "a.tif", np.zeros((2, 2)))


def test_pandas_reads_it_without_options(tmp_path):
    columns = {
        "facet": np.arange(3),
        "group": np.array(["hot", "a,b", '=1"'], object),
        "radiance_W_m2_sr": np.array([1.5, np.nan, np.float32(1) / 3], np.float32),
        "temperature_K": np.array([300.0, 1e-30, 123456.789012]),
        "reached": np.array([True, False, True]),
    }
    formats.write_csv(tmp_path / "a.csv", columns)
    frame = pandas.read_csv(tmp_path / "a.csv")
    assert list(frame) == list(columns)
    assert frame.group.tolist() == ["hot", "a,b", "'=1\""]  # no formula for a spreadsheet
    assert frame.facet.tolist() == [0, 1, 2] and frame.reached.tolist() == [1, 0, 1]
    radiance = frame.radiance_W_m2_sr.to_numpy()
    assert np.isnan(radiance[1]) and (tmp_path / "a.csv").read_text().count("nan") == 0
    # Nine digits give back every Float32
    assert np.array_equal(radiance.astype(np.float32), columns["radiance_W_m2_sr"], equal_nan=True)
    assert frame.temperature_K.to_numpy() == pytest.approx(columns["temperature_K"], rel=1e-8)


def test_all_or_nothing(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        formats.write_csv(tmp_path / "no" / "a.csv", {"a": [1]})
    with pytest.raises(ValueError):
        formats.write_csv(tmp_path / "a.csv", {"a": [1, 2], "b": [1]})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "channel, column, unit",
    [
        ("Y", "radiance_W_m2_sr", "W m-2 sr-1"),
        ("group.range.Y", "group.range_W_m2_sr", "W m-2 sr-1"),
        ("stderr.Y", "standard_error_W_m2_sr", "W m-2 sr-1"),
        ("temperature.Y", "temperature_K", "K"),
        ("range.Y", "range_m", "m"),
        ("stderr_K.Y", "standard_error_K", "K"),
        ("noise_K.Y", "noise_K", "K"),
        ("counts.Y", "counts", ""),
        ("d.plate.temperature.Y", "d.plate.temperature", "W m-2 sr-1 per unit"),
        (
            "stderr.d.plate.temperature.Y",
            "standard_error.d.plate.temperature",
            "W m-2 sr-1 per unit",
        ),
    ],
)
def test_columns_and_units(channel, column, unit):
    assert column_of(channel) == column
    assert quantity_of_channel(channel)[1] == unit


def test_a_temperature_of_0_is_no_value():
    values = np.array([0, 1, np.nan, np.inf])
    assert has_value("temperature.Y", values).tolist() == [False, True, False, False]
    assert has_value("Y", values).tolist() == [True, True, False, False]
