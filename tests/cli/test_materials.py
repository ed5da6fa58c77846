"""Tests of mi-lcair fit: input, output, files and errors.

All tests but one replace the fit by a substitute.
"""

import json
import math

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.fitting import estimation
from mi_lcair.physics.reflection.models import MODELS
from tests.fitting.numpy_model import brdf
from tests.fitting.results import fit_of

SCAN = "# band_um: {band}\ntheta_i_deg,theta_r_deg,brdf_per_sr\n" + "\n".join(
    f"30,{r},{2 ** -abs(r - 30) + 0.01}" for r in range(-85, 86, 5)
)
EMISSIVITY = "theta_deg,emissivity,emissivity_std\n15,0.6,0.02\n60,0.5,0.03\n"


@pytest.fixture
def files(folder):
    (folder / "mwir.csv").write_text(SCAN.format(band="3 5"))
    (folder / "lwir.csv").write_text(SCAN.format(band="8 12"))
    (folder / "emissivity.csv").write_text(EMISSIVITY)
    (folder / "dhr.csv").write_text("theta_deg,dhr\n20,0.3\n")


@pytest.fixture
def asked(monkeypatch, files):
    """Substitute for the fit. It records its arguments, and raises `asked.error`."""
    calls = []

    def fit(measurements, **options):
        calls.append((measurements, options))
        if calls_error:
            raise calls_error[0]
        return fit_of(measurements, **options)

    calls_error = []
    monkeypatch.setattr(estimation, "fit", fit)
    fit.calls, fit.errors = calls, calls_error
    return fit


# -------------------------- output --------------------------


def test_defaults(run, asked):
    assert run("fit", "mwir.csv").exit_code == 0
    ((measurements, options),) = asked.calls
    assert len(measurements.brdf) == 35 and callable(options.pop("progress"))
    assert options == {
        "model": "auto",
        "form": "auto",
        "loss": "log",
        "robust": False,
        "starts": 64,
        "seed": 0,
        "max_angle_deg": 80,
        "min_brdf": 1e-4,
        "source_half_angle_deg": None,
        "calibration": None,
    }


def test_every_option_arrives(run, asked):
    result = run(
        "fit",
        "mwir.csv",
        "--emissivity",
        "emissivity.csv",
        "--dhr",
        "dhr.csv",
        "--quantity",
        "brdf_cos",
        "--theta-r-positive",
        "source",
        "--model",
        "sandford_robertson",
        "--form",
        "thesis",
        "--loss",
        "cube_root",
        "--robust",
        "--starts",
        8,
        "--seed",
        7,
        "--max-angle-deg",
        70,
        "--min-brdf",
        0.01,
        "--source-half-angle-deg",
        0.5,
        "--calibration",
        "5 %",
    )
    assert result.exit_code == 0, result.output
    ((measurements, options),) = asked.calls
    assert measurements.brdf[0] == pytest.approx((2**-115 + 0.01) / math.cos(math.radians(85)))
    assert measurements.theta_r[0] == pytest.approx(math.radians(85))  # -85 in the file
    assert options["emissivity"].value.tolist() == [0.6, 0.5] and options["dhr"].value.tolist() == [
        0.3
    ]
    del options["emissivity"], options["dhr"], options["progress"]
    assert options == {
        "model": "sandford_robertson",
        "form": "thesis",
        "loss": "cube_root",
        "robust": True,
        "starts": 8,
        "seed": 7,
        "max_angle_deg": 70,
        "min_brdf": 0.01,
        "source_half_angle_deg": 0.5,
        "calibration": 0.05,
    }


def test_table(run, asked):
    result = run("fit", "mwir.csv", "--emissivity", "emissivity.csv")
    assert (
        result.stdout
        == """\
surface      a plate (mwir.csv)
band         3-5 um
model        Sandford-Robertson, normalized form, b = 0
points used  33
left out     2 theta_i or theta_r beyond 80 degrees
rms          0.1234 decades; sigma explains 0.0200
fit          LACK OF FIT: the model misses the data by about 12 %
emissivity   rms error 0.050
minimum      converged, relative gradient 1.0e-13; 75% of the starts reached it
time         1.25 s, of which 0.50 s to compile

parameter  value    standard error  95 % interval  verdict
epsilon    0.3      0.01            0 to 0.5       not determined by these data: any value in \
0..0.5 fits; measure the emissivity and give it to the fit
rho_d      0.33333  0.01            0 to 0.5       determined
b          0.05     0.01            0 to 0.5       at its bound 0: interval 0..0.1
e          0.1      0.01            0 to 0.5       determined

theta (deg)  emissivity  standard error  95 % interval
15           0.55        0.02            0.51 to 0.59
60           0.55        0.02            0.51 to 0.59
""".replace("a plate", "mwir")
    )
    assert result.stderr == (
        "mi-lcair: warning: mwir.csv: LACK OF FIT: the model misses the data by about 12 %\n"
        "next: mi-lcair fit mwir.csv --emissivity emissivity.csv -o mwir.json\n"
    )  # stderr is no terminal and shows no progress bar


def test_the_table_names_the_model_and_its_own_parameters(run, asked):
    """The form of a model with only one is not printed."""
    table = run("fit", "mwir.csv", "--model", "microfacet").stdout
    assert f"model        {MODELS['microfacet'].title}, b = 0\n" in table
    assert [line.split()[0] for line in table.splitlines()[-10:-5]] == [*MODELS["microfacet"].names]


def test_table_of_several_files(run, asked):
    """The facts and parameters of one fit follow those of the other."""
    lines = run("fit", "mwir.csv", "lwir.csv").stdout.splitlines()
    first, second = lines[:20], lines[21:]
    assert (first[0], second[0]) == (
        "surface      mwir (mwir.csv)",
        "surface      lwir (lwir.csv)",
    )
    assert (first[1].split(), second[1].split()) == (["band", "3-5", "um"], ["band", "8-12", "um"])
    assert first[11].startswith("epsilon ") and second[-6].startswith("e  ") and not lines[20]


def test_an_unknown_band_is_mentioned(run, asked, folder):
    (folder / "plain.csv").write_text(SCAN.partition("\n")[2])
    assert (
        "band         unknown: scenes need it; give --band 3-5, or '# band_um: 3 5' in the data"
        in run("fit", "plain.csv").stdout
    )


def test_the_band_may_come_from_an_option(run, refused, asked, folder):
    (folder / "plain.csv").write_text(SCAN.partition("\n")[2])
    assert run("fit", "plain.csv", "--band", "8-12", "-o", "fit.json").exit_code == 0
    report = json.loads((folder / "fit.json").read_text())
    assert (report["band"], report["band_um"]) == ("8-12", [8, 12])
    table = run("fit", "plain.csv", "mwir.csv", "--band", "LWIR", "--band", "2-5").stdout
    bands = [line.split()[1] for line in table.splitlines() if line.startswith("band ")]
    assert bands == ["8-12", "2-5"]  # overrides 3 5
    assert "--band is given 1 times for 2" in refused(
        "fit", "plain.csv", "mwir.csv", "--band", "3-5"
    )
    assert "band total has no wavelengths" in refused("fit", "plain.csv", "--band", "total")
    assert "unknown band" in refused("fit", "plain.csv", "--band", "WIR")


def test_console_json_and_picture_state_the_same_verdict(run, asked, folder, figures):
    result = run("fit", "mwir.csv", "--json", "-o", "fit.svg")
    quality = json.loads(result.stdout)["quality"]
    assert quality["verdict"] in run("fit", "mwir.csv").stdout
    texts = " ".join(
        " ".join(text.get_text().split())
        for part in figures[0].subfigs
        for row in part.subfigs
        for axes in row.axes
        for text in axes.texts
    )
    assert quality["verdict"] in " ".join(texts.split())
    assert (quality["lack_of_fit"], quality["reduced_chi_square"]) == (True, 7.5)


def test_json_on_stdout_and_in_the_file(run, asked, folder):
    result = run("fit", "mwir.csv", "-o", "fit.json", "--json")
    printed, file = json.loads(result.stdout), json.loads((folder / "fit.json").read_text())
    assert printed.pop("timing") == [{"seconds": 1.25, "compile_seconds": 0.5}]
    assert printed == file and file["parameters"]["rho_d"] == 1 / 3


@pytest.mark.slow
def test_files_are_written(run, asked, folder):
    before = set(folder.iterdir())
    assert run("fit", "mwir.csv", "lwir.csv", "-o", "fit.json", "-o", "fit.PNG").exit_code == 0
    assert {path.name for path in set(folder.iterdir()) - before} == {"fit.json", "fit.PNG"}
    assert list(json.loads((folder / "fit.json").read_text())["materials"]) == ["3-5", "8-12"]
    assert (folder / "fit.PNG").read_bytes().startswith(b"\x89PNG")


# -------------------------- errors --------------------------


@pytest.mark.parametrize(
    "args, reason",
    [
        ([], "Missing argument 'DATA...'"),
        (["none.csv"], "none.csv: cannot be read: No such file"),
        (["mwir.csv", "mwir.csv"], "have the same band, 3-5 um"),
        (["mwir.csv", "--emissivity", "none.csv"], "none.csv: cannot be read"),
        (["mwir.csv", "--emissivity", "dhr.csv"], "must name theta_deg and emissivity"),
        (["mwir.csv", "--dhr", "emissivity.csv"], "must name theta_deg and dhr"),
        (
            ["mwir.csv", "lwir.csv", "--emissivity", "emissivity.csv"],
            "--emissivity is given 1 times for 2 data files",
        ),
        (["emissivity.csv"], "no column theta_i_deg and no theta_r_deg and no brdf_per_sr"),
        (["mwir.csv", "--model", "phong"], "--model"),
        (["mwir.csv", "--form", "phong"], "--form"),
        (["mwir.csv", "--loss", "l1"], "--loss"),
        (["mwir.csv", "--starts", "0"], "--starts"),
        (["mwir.csv", "--max-angle-deg", "0"], "--max-angle-deg"),
        (["mwir.csv", "--max-angle-deg", "91"], "--max-angle-deg"),
        (["mwir.csv", "--min-brdf", "-1"], "--min-brdf"),
        (["mwir.csv", "--source-half-angle-deg", "90"], "--source-half-angle-deg"),
        (["mwir.csv", "--seed", "-1"], "--seed"),
        (["mwir.csv", "--quantity", "f"], "--quantity"),
        (["mwir.csv", "-o", "nowhere/fit.png"], "does not exist"),
        (
            ["mwir.csv", "-o", "fit.jpg"],
            "output 'fit.jpg' does not end in .json, .png, .svg or .pdf",
        ),
        (["mwir.csv", "--output", "fit.xml"], "output 'fit.xml' does not end in .json"),
    ],
)
def test_refused(refused, asked, folder, args, reason):
    before = set(folder.iterdir())
    assert reason in refused("fit", *args, *([] if "--output" in args else ["-o", "fit.json"]))
    assert set(folder.iterdir()) == before and asked.calls == []


@pytest.mark.parametrize(
    "error, status",
    [(InputError("3 points to fit"), 2), (ZeroDivisionError(), 1), (KeyboardInterrupt(), 130)],
)
def test_a_fit_that_fails_leaves_no_file_and_no_change(run, asked, folder, error, status):
    (folder / "fit.png").write_text("old")
    before = {path: path.read_bytes() for path in folder.iterdir()}
    asked.errors.append(error)
    result = run("fit", "mwir.csv", "-o", "fit.json", "-o", "fit.png")
    assert (result.exit_code, result.stdout, result.stderr.strip().count("\n")) == (status, "", 0)
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


# ------------------ from file to material -------------------


def test_from_a_file_to_a_material(run, folder):
    """A fit to noise-free values of an independent model returns its parameters.

    The report of the fit can be used as a material.
    """
    from mi_lcair.physics.bands import band
    from mi_lcair.physics.materials import material

    true = {"epsilon": 0.3, "rho_d": 0.2, "b": 0.4, "e": 0.15}
    rows = [
        f"{i};{r};{brdf(*np.radians([i, r]), **true)!r}"
        for i in (20, 60)
        for r in range(-75, 80, 5)
    ]
    text = "# band_um: 3 5\ntheta_i_deg;theta_r_deg;BRDF (1/sr)\n" + "\n".join(rows).replace(
        ".", ","
    ).replace("np,float64(", "").replace(")", "")
    (folder / "scan.csv").write_text(text)
    result = run("fit", "scan.csv", "-o", "fit.json", "--form", "thesis", "--starts", 8)
    assert result.exit_code == 0, result.output
    found = material("fit.json", band("MWIR"))
    assert found.parameters == pytest.approx(true, rel=1e-6)
