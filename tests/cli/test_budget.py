"""Tests of mi-lcair budget: output, files, and errors before anything is rendered."""

import json

import numpy as np
import pytest

from mi_lcair.rendering.images.files import read_exr
from mi_lcair.show.kinds import read_result
from tests.detection.disc_scenario import write_disc
from tests.knowing.budgets.plate_scene import plate_scene

SIGMA = """[sigma]
"plate.temperature" = 2
"paint.reflectance" = "5 %"
[[correlated]]
names = ["plate.temperature", "paint.reflectance"]
correlation = 0.5
"""


@pytest.fixture(autouse=True)
def files(folder):
    plate_scene(folder)
    write_disc(folder)
    (folder / "sigma.toml").write_text(SIGMA)
    (folder / "disc_sigma.toml").write_text(
        '[sigma]\n"self.temperature" = 90\n[scenario]\nrange_m = "1 %"\ntransmittance = 0.02\n'
    )


@pytest.mark.slow
def test_table_and_files(run, folder):
    result = run(
        "budget", "plate.xml", "-u", "sigma.toml", "-o", "b.png", "--image", "b.exr",
        "--monte-carlo", 20,
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert lines[0].startswith("intensity of the target  ") and " W/sr (" in lines[0]
    assert any(line.startswith("monte carlo ") and "from 20 draws" in line for line in lines)
    head = next(k for k, line in enumerate(lines) if line.startswith("quantity "))
    assert lines[head].split()[-3:] == ["contribution", "W/sr", "share"]
    assert lines[head + 1].startswith("plate.temperature & paint.reflectance ")
    assert lines[head + 2].startswith("  plate.temperature ") and "310 K" in lines[head + 2]
    shares = [float(line.split()[-2]) for line in lines[head:] if line.endswith(" %")]
    assert sum(shares) == pytest.approx(100, abs=0.02)
    assert result.stderr.count("wrote ") == 2 and (folder / "b.png").stat().st_size > 10_000

    channels, header = read_exr(folder / "b.exr")
    on_plate = channels["Y"] > 0.9 * channels["Y"].max()
    by_temperature, by_paint = (
        channels[f"d.{name}.Y"] for name in ("plate.temperature", "paint.reflectance")
    )
    np.testing.assert_allclose(
        by_paint[on_plate] * -0.6, channels["Y"][on_plate], rtol=1e-3
    )  # dY/drho = -Y / (1 - rho)
    a, b = 2 * by_temperature, 0.02 * by_paint
    np.testing.assert_allclose(
        channels["sigma.Y"][on_plate], np.sqrt(a**2 + b**2 + a * b)[on_plate], rtol=1e-3
    )
    assert json.loads(header["uncertain"]) == ["plate.temperature", "paint.reflectance"]


def test_the_file_of_a_budget(run, folder):
    result = run("budget", "plate.xml", "-u", "sigma.toml", "--spp", 8, "-o", "budget.json")
    assert result.exit_code == 0, result.output
    budget = read_result("budget.json")
    assert str(budget.estimate) in result.stdout and "wrote budget.json" in result.stderr
    group = budget.estimate["plate.temperature & paint.reflectance"]
    assert group.members[0].value == 310 and group.share == max(row.share for row in budget.rows)


def test_json(run):
    result = run("budget", "plate.xml", "-u", "sigma.toml", "--spp", 8, "--json", "-D", "band=MWIR")
    data = json.loads(result.stdout)
    assert data["estimate"]["unit"] == "W/sr" and data["monte_carlo"] is None
    assert sum(row["share"] for row in data["estimate"]["contributions"]) == pytest.approx(1)
    assert data["estimate"]["contributions"][0]["members"][0]["quantity"] == "plate.temperature"
    assert np.array(data["inputs"]["covariance"]).shape == (2, 2) and len(data["checks"]) == 1


def test_scenario_and_a_note_where_the_linear_answer_fails(run):
    result = run("budget", "disc.toml", "-u", "disc_sigma.toml", "-D", "render.resolution=16")
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("contrast ") and "FAILS" in result.stdout
    notes = [line for line in result.stderr.splitlines() if "linear result is wrong" in line]
    assert len(notes) == 1 and notes[0].startswith("mi-lcair: warning: self.temperature: ")


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["plate.xml"], "nothing of plate is uncertain"),
        (["plate.xml", "-u", "no.toml"], "uncertainties 'no.toml': cannot be read"),
        (["plate.xml", "-u", "plate.xml"], "uncertainties 'plate.xml': "),
        (["plate.xml", "-u", "disc_sigma.toml"], "unknown quantity of plate 'self.temperature'"),
        (["plate.xml", "-u", "sigma.toml", "-o", "b.jpg"], "does not end in .json, .png"),
        (["plate.xml", "-u", "sigma.toml", "--image", "b.png"], "does not end in .exr"),
        (["plate.xml", "-u", "sigma.toml", "--spp", 4, "--tolerance", "1%"], "--spp sets a fixed"),
        (["plate.xml", "-u", "sigma.toml", "--monte-carlo", 2], "must be 10 or more"),
        (["plate.xml", "-u", "sigma.toml", "-s", 3], "sensor 3 does not exist"),
        (["disc.toml", "-u", "disc_sigma.toml", "--image", "b.exr"], "--image needs a scene"),
        (["disc.toml", "-u", "sigma.toml"], "unknown quantity of disc 'plate.temperature'"),
        (["nothing", "-u", "sigma.toml"], "unknown bundled scene 'nothing'"),
    ],
)  # fmt: skip
def test_what_cannot_be_used(refused, folder, arguments, message):
    before = sorted(folder.iterdir())
    assert message in refused("budget", *arguments)
    assert sorted(folder.iterdir()) == before
