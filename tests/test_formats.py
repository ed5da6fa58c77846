"""Tests of the channels of radiance images."""

import base64
import re
import struct
import xml.etree.ElementTree as ElementTree

import meshio
import numpy as np
import pandas
import pytest
import xarray
from PIL import Image

from mi_lcair import formats
from mi_lcair.errors import InputError
from mi_lcair.formats import (
    column_of,
    has_value,
    or_nan,
    pixel_axes,
    quantity_of_channel,
    spectral_channel,
    wavelengths_of,
)


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


def test_a_checksum_is_that_of_what_was_written(tmp_path):
    columns = {"facet": [0, 1], "group": ["a", "b"], "range_m": [1.5, np.nan]}
    made = formats.table(columns, title="two")
    stated = formats.checksum(made)
    formats.write_netcdf(tmp_path / "a.nc", made.assign_attrs(checksum=stated))
    assert formats.read_attributes(tmp_path / "a.nc") == {"title": "two", "checksum": stated}
    read = formats.read(tmp_path / "a.nc")
    assert formats.checksum(read) == stated and re.fullmatch("[0-9a-f]{16}", stated)
    for name, other in (("facet", [0, 2]), ("group", ["a", "c"]), ("range_m", [1.5, 2.0])):
        changed = formats.table(columns | {name: other}, title="two")
        assert formats.checksum(changed) != stated, name
    assert formats.checksum(read.assign_attrs(title="2")) != stated
    (tmp_path / "b.nc").write_bytes(b"no netCDF")
    with pytest.raises(InputError, match="b.nc: cannot be read as netCDF-3"):
        formats.read(tmp_path / "b.nc")


def test_the_largest_integers_of_netcdf(tmp_path):
    """Integers of 32 bits, and Float64 beyond."""
    columns = {"a": [2**31 - 1, 0], "b": [2**31, 0], "c": [-(2**31), 0]}
    formats.write_netcdf(tmp_path / "a.nc", formats.table(columns))
    kinds = {name: values.dtype.kind for name, values in formats.read(tmp_path / "a.nc").items()}
    assert kinds == {"a": "i", "b": "f", "c": "f"}
    read = formats.read_columns(tmp_path / "a.nc")
    assert {name: read[name].tolist() for name in columns} == columns


def test_a_trend_is_a_grid():
    columns = {"azimuth_deg": [0, 90, 0, 90], "elevation_deg": [5, 5, 10, 10]}
    trend = formats.dataset(columns | {"intensity_W_sr": [1, 2, 3, 4]})
    assert trend.intensity_W_sr.values.tolist() == [[1, 2], [3, 4]]
    assert formats.dataset({"facet": [3, 5], "area_m2": [1, 2]}).area_m2.dims == ("facet",)
    assert formats.dataset({"area_m2": [1, 2]}).area_m2.dims == ("row",)


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
    types = re.search('Name="types".*?>(.*?)<', (tmp_path / "a.vtu").read_text())[1]
    assert np.frombuffer(base64.b64decode(types), "<i8", -1, 8).tolist() == [5, 9, 7]  # VTK's


def test_polydata_holds_texts(tmp_path):
    """Read by the format's specification: a header of 8 bytes, then the numbers, in base64."""
    formats.write_facets(tmp_path / "a.vtp", VERTICES, FACES, COLUMNS)
    tree = ElementTree.parse(tmp_path / "a.vtp")
    found = {each.get("Name"): each for each in tree.iter() if each.tag.endswith("Array")}

    def numbers(name):
        content = base64.b64decode(found[name].text)
        assert struct.unpack_from("<Q", content) == (len(content) - 8,)
        return np.frombuffer(
            content, {"Int64": "<i8", "Float64": "<f8"}[found[name].get("type")], -1, 8
        )

    assert found["Points"].get("NumberOfComponents") == "3"
    np.testing.assert_array_equal(numbers("Points"), VERTICES.ravel())
    assert numbers("connectivity").tolist() == sum(FACES, [])
    assert numbers("offsets").tolist() == [3, 7, 12] and "types" not in found
    assert numbers("group_number").tolist() == [1, 0, 2] and numbers("seen").tolist() == [1, 0, 1]
    codes = bytes(map(int, found["group"].text.split()))
    assert codes == b"wing\0fuselage\0wing--<&\0"
    piece = next(tree.iter("Piece"))
    assert (piece.get("NumberOfPoints"), piece.get("NumberOfPolys")) == ("8", "3")


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


@pytest.mark.parametrize("suffix", ["usd", "usda", "usdc"])
def test_usd(tmp_path, suffix):
    """A mesh of the same polygons, with each column over its faces."""
    Usd = pytest.importorskip("pxr.Usd")
    columns = COLUMNS | {"by_a.b_K": [1.5, 2, 3], "type": ["model", "sky", "terrain"]}
    formats.write_facets(tmp_path / f"a.{suffix}", VERTICES, FACES, columns)
    stage = Usd.Stage.Open(str(tmp_path / f"a.{suffix}"))
    values = {a.GetName(): a.Get() for a in stage.GetDefaultPrim().GetAuthoredAttributes()}
    points, corners = np.array(values["points"]), np.array(values["faceVertexIndices"])
    expected = np.concatenate([VERTICES[face] for face in FACES])
    assert np.array_equal(points[corners], expected.astype(np.float32))
    assert list(values["faceVertexCounts"]) == [3, 4, 5]
    assert values["subdivisionScheme"] == "none" and values["extent"][0] == (0, 0, 0)
    own = {name.removeprefix("primvars:"): list(v) for name, v in values.items() if ":" in name}
    colours = np.array(own.pop("displayColor"))
    assert (colours[1] == 0.5).all() and colours[0].sum() > colours[2].sum()  # NaN, hot, cold
    np.testing.assert_array_equal(own.pop("thermal:kelvin"), columns["temperature_K"])
    assert own == {
        "facets:facet": [0, 1, 2],
        "facets:radiance_W_m2_sr": [1, 2, 3],
        "facets:seen": [True, False, True],
        "facets:by_a_b_K": [1.5, 2, 3],
        "thermal:group": ["wing", "fuselage", "wing--<&"],
        "thermal:type": ["f", "s", "t"],
    }
    formats.write_facets(tmp_path / f"b.{suffix}", np.zeros((0, 3)), [], {"facet": np.zeros(0)})
    assert Usd.Stage.Open(str(tmp_path / f"b.{suffix}")).GetDefaultPrim()


def test_another_suffix(tmp_path):
    with pytest.raises(InputError, match="does not end in .vtp, .vtu, .usd"):
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


def test_counts_in_one_file(tmp_path):
    """Page by page, and at most as many as 32-bit offsets reach: 4 GiB less 16 MiB."""
    counts = np.arange(24, dtype=np.uint16).reshape(2, 3, 4) * 2000
    with formats.stack(tmp_path / "a.tif") as add:
        for page in counts:
            add(page)
    with Image.open(tmp_path / "a.tif") as file:
        assert file.n_frames == 2
        for page in range(2):
            file.seek(page)
            np.testing.assert_array_equal(np.array(file), counts[page])
    formats.check_fits("a.tif", 65280, 256, 128)
    message = "65281 pages of 256 x 128 pixels have 4.0 GiB, and a TIFF at most 4.0; write fewer"
    with pytest.raises(InputError, match=message):
        formats.check_fits("a.tif", 65281, 256, 128)


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
    assert ",123456.789," in (tmp_path / "a.csv").read_text()
    assert frame.temperature_K.to_numpy() == pytest.approx(columns["temperature_K"], rel=1e-8)


def test_columns_of_a_file(tmp_path):
    """Numbers, also where some are missing, and texts."""
    (tmp_path / "a.csv").write_text("# made\nrange_m,name,error_m\n1.5,a,0.1\n2,3,\n")
    read = formats.read_columns(tmp_path / "a.csv")
    assert read["range_m"].tolist() == [1.5, 2] and read["name"].tolist() == ["a", "3"]
    np.testing.assert_array_equal(read["error_m"], [0.1, np.nan])


def test_envi(tmp_path):
    """Band after band in 32 bits, and the header that says so."""
    cube = np.arange(24, dtype=float).reshape(2, 3, 4) / 7
    formats.write_envi(tmp_path / "a.hdr", cube, [8.0, 8.25], "radiance")
    stored = np.fromfile(tmp_path / "a.img", "<f4")
    np.testing.assert_array_equal(stored.reshape(2, 3, 4), cube.astype(np.float32))
    first, *lines = (tmp_path / "a.hdr").read_text().splitlines()
    header = dict(line.split(" = ") for line in lines)
    sizes = {"samples": "4", "lines": "3", "bands": "2", "header offset": "0"}
    kind = {"data type": "4", "byte order": "0", "interleave": "bsq"}
    assert first == "ENVI" and header.items() >= (sizes | kind).items()
    assert header["wavelength"] == "{8, 8.25}" and header["fwhm"] == "{0.25, 0.25}"


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
        ("S0.8075,000000nm", "S0.8075,000000nm_W_m2_sr_um", "W m-2 sr-1 um-1"),
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
    np.testing.assert_array_equal(or_nan("range.Y", values), [np.nan, 1, np.nan, np.nan])


def test_channels_of_wavelengths():
    """Of all channels those of a spectral image, by rising wavelength."""
    assert spectral_channel(8.075) == "S0.8075,000000nm"
    names = ["S0.10500,5nm", "Y", "S0.8075,000000nm", "stderr.S0.8075,000000nm"]
    assert wavelengths_of(names) == pytest.approx({names[2]: 8.075, names[0]: 10.5005})
    assert list(wavelengths_of(names)) == [names[2], names[0]]


def test_centres_of_pixels():
    """Two rows and four columns in a window of 8 m x 6 m."""
    assert list(pixel_axes((2, 4))) == ["row", "column"]
    axes = pixel_axes((2, 4), (8.0, 6.0))
    values = {"row": [0, 1], "column": [0, 1, 2, 3], "x_m": [-3, -1, 1, 3], "y_m": [1.5, -1.5]}
    assert {name: places.tolist() for name, (_, places) in axes.items()} == values
    assert [axes[name][0] for name in ("x_m", "y_m")] == ["column", "row"]
