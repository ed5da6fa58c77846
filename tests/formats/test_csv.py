import numpy as np
import pandas
import pytest

from mi_lcair.errors import InputError
from mi_lcair.formats import csv


def test_pandas_reads_it_without_options(tmp_path):
    columns = {
        "facet": np.arange(3),
        "group": np.array(["hot", "a,b", '=1"'], object),
        "radiance_W_m2_sr": np.array([1.5, np.nan, np.float32(1) / 3], np.float32),
        "temperature_K": np.array([300.0, 1e-30, 123456.789012]),
        "reached": np.array([True, False, True]),
    }
    csv.write(tmp_path / "a.csv", columns)
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
        csv.write(tmp_path / "no" / "a.csv", {"a": [1]})
    with pytest.raises(ValueError):
        csv.write(tmp_path / "a.csv", {"a": [1, 2], "b": [1]})
    assert not list(tmp_path.iterdir())
