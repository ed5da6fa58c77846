"""`show`, `convert` and `report` of the JSON of solutions and budgets, and audits."""

import csv
import json
import shutil
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.show.kinds import read_result
from tests.detection.disc_scenario import disc, write_disc
from tests.knowing.budgets.plate_scene import plate_scene
from tests.knowing.inversion.plate import UNKNOWNS, datum, write_scene

mi.set_variant("llvm_ad_mono")
BOX = Path(__file__).parents[2] / "scenes" / "examples" / "box.obj"
SIGMA = {"sigma": {"plate.temperature": 2.0, "paint.reflectance": 0.02}}


def result_of(kind, folder):
    """A small result of this kind."""
    if kind == "solution":
        write_scene(folder)
        data = [datum(folder, "one", 1, "clear"), datum(folder, "two", 2, "cold", S=250.0)]
        unknowns = {**UNKNOWNS, "plate.temperature": {"per": []}}
        return mi_lcair.invert({"data": data, "unknowns": unknowns}, advise=False)
    scene = plate_scene(folder)
    if kind == "budget":
        group = [{"names": list(SIGMA["sigma"]), "correlation": 0.5}]
        return mi_lcair.budget(scene, SIGMA | {"correlated": group}, spp=16, draws=10)
    return mi_lcair.audit(scene, paths=64)


@pytest.mark.parametrize("kind", ["solution", "budget", "audit"])
def test_a_result_from_its_file(kind, folder, run, refused):
    """The commands show what the result in memory shows. An audit has no picture."""
    result = result_of(kind, folder)
    result.save(f"{kind}.json")
    read = read_result(f"{kind}.json")
    assert read.as_dict() == result.as_dict()
    assert read.summary() == result.summary()
    if kind == "audit":
        assert "is an audit; report shows it" in refused("show", "audit.json")
    else:
        assert run("show", f"{kind}.json").stdout == f"{kind}.png\n"
        assert (folder / f"{kind}.png").stat().st_size > 10_000
    assert run("convert", f"{kind}.json", "table.csv").exit_code == 0
    with open("table.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for name, values in result.columns().items():
        if values.dtype.kind == "f":
            numbers = [float(row[name] or "nan") for row in rows]
            np.testing.assert_allclose(numbers, values, rtol=1e-8, err_msg=name)
        elif values.dtype.kind == "U":
            assert [row[name] for row in rows] == values.tolist()
    assert run("report", f"{kind}.json", "-o", "page.html").exit_code == 0
    page = (folder / "page.html").read_text()
    assert ('<img alt="' in page) == (kind != "audit")
    title = {"solution": "plate.temperature", "budget": "Uncertainty budget"}
    assert title.get(kind, "Energy audit") in page and "How it was made" in page


def test_a_contrast_from_its_file(folder, run, refused):
    """Picture and page have the spectra and the table that the contrast in memory has."""
    write_disc(folder)
    contrast = mi_lcair.contrast(disc(folder, render__resolution=8, render__spp=16))
    contrast.save("contrast.json")
    contrast.plot("memory.png")
    assert run("show", "contrast.json").stdout == "contrast.png\n"
    assert (folder / "contrast.png").read_bytes() == (folder / "memory.png").read_bytes()
    assert run("report", "contrast.json", "-o", "page.html").exit_code == 0
    contrast.save("memory.html")
    table = (folder / "memory.html").read_text().partition("reflections up to")[2]
    assert table.partition("</table>")[0] in (folder / "page.html").read_text()
    entries = contrast.as_dict()
    del entries["spectrum"]
    (folder / "contrast.json").write_text(json.dumps(entries))
    assert "a contrast that is incomplete" in refused("show", "contrast.json", "-o", "none.png")
    assert not (folder / "none.png").exists()


def test_a_page_of_a_model(folder, run):
    shutil.copy(BOX, folder)
    assert run("report", "box.obj", "-o", "page.html").exit_code == 0
    page = (folder / "page.html").read_text()
    assert 'data-kind="model"' in page and "open edges" in page and "Model (box.obj)" in page


@pytest.mark.parametrize("command", ["convert", "report"])
def test_refuses_an_incomplete_file(folder, refused, command):
    entries = mi_lcair.audit(plate_scene(folder), paths=64).as_dict()
    del entries["shares"]
    (folder / "audit.json").write_text(json.dumps(entries))
    output = {"convert": ("t.csv",), "report": ("-o", "p.html")}[command]
    message = refused(command, "audit.json", *output)
    assert "an audit that is incomplete: entry 'shares' is missing; make it anew" in message
    assert not list(folder.glob("*.csv")) and not list(folder.glob("*.html"))
