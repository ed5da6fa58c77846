import numpy as np
import pytest
import xarray

from mi_lcair.errors import InputError
from mi_lcair.formats import netcdf


def test_table_with_units(tmp_path):
    columns = {
        "wavelength_um": np.array([3.0, 4.0, 5.0]),
        "target_W_sr_um": np.array([1 / 3, np.nan, 2e-30]),
        "paths": np.array([2**40, 1, 2]),
        "facet": np.array([0, 1, 2]),
        "group": np.array(["hot", "Täil", ""], object),
    }
    netcdf.write(tmp_path / "a.nc", netcdf.table(columns, "wavelength_um", scene="cavity"))
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
    dataset = netcdf.grid(columns, ("elevation_deg", "azimuth_deg"))
    netcdf.write(tmp_path / "a.nc", dataset)
    with xarray.open_dataset(tmp_path / "a.nc") as data:
        assert data.intensity_W_sr.dims == ("elevation_deg", "azimuth_deg")
        assert data.azimuth_deg.values.tolist() == [0, 45, 90]
        for name in ("intensity_W_sr", "invalid", "group.a_b_W_sr"):
            assert data[name].sel(azimuth_deg=45, elevation_deg=-10) == 45 - 10000
    # A missing point is NaN
    dataset = netcdf.grid({k: v[1:] for k, v in columns.items()}, ("elevation_deg", "azimuth_deg"))
    assert np.isnan(dataset.intensity_W_sr.sel(azimuth_deg=0, elevation_deg=-10))
    assert np.isnan(dataset.invalid).sum() == 1


@pytest.mark.parametrize(
    "key, dimension", [({"range_m": [1.0, 2, 3]}, "row"), ({"time_s": [0.0, 1, 2]}, "time_s")]
)
def test_rows_of_one_direction_stay_apart(tmp_path, key, dimension):
    """A sweep over ranges, and a flight: no row of theirs is lost."""
    columns = {"azimuth_deg": [5.0, 5, 7], "elevation_deg": [1.0, 1, 1], **key}
    netcdf.write(tmp_path / "a.nc", netcdf.dataset(columns))
    with xarray.open_dataset(tmp_path / "a.nc") as data:
        assert data.azimuth_deg.dims == (dimension,)
    read = netcdf.read_columns(tmp_path / "a.nc")
    assert {name: read[name].tolist() for name in columns} == columns


def test_names_that_netcdf_lacks(tmp_path):
    with pytest.raises(InputError, match="same name"):
        netcdf.write(tmp_path / "a.nc", netcdf.table({"a/b": [1], "a_b": [2]}))
    assert not list(tmp_path.iterdir())
