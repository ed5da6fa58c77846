"""The command line: what it prints, what it refuses, how it exits. The renderer behind it is replaced by stand-ins."""
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

import mi_lcair
from mi_lcair.cli import main
from mi_lcair.errors import InputError, unknown
from mi_lcair.rendering.image import read_exr, write_exr

CHECKOUT = Path(mi_lcair.__file__).parents[1]
HEAVY = ("mitsuba", "drjit", "matplotlib", "colour", "scipy", "OpenEXR", "numpy", "tqdm")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("MI_LCAIR_DEBUG", raising=False)
    return tmp_path


def run(*args):
    return CliRunner().invoke(main, [str(arg) for arg in args])


def refused(*args):
    """The message of a call that must end with exit 2, one line on stderr and nothing on stdout."""
    result = run(*args)
    assert (result.exit_code, result.stdout, result.stderr.count("\n")) == (2, "", 1), result.output
    assert result.stderr.startswith("mi-lcair: ")
    return result.stderr


class Renderer:
    """Stands for mi_lcair.load, render and signature: records what it is asked for, or raises `error`."""
    error = None
    reached = None
    invalid = 0

    def load(self, scene, /, **parameters):
        self.loaded = (scene, parameters)
        return "the scene"

    def render(self, scene, **sampling):
        self.asked(scene, **sampling)
        return SimpleNamespace(channels={"Y": np.full((2, 3), 5, np.float32)}, header={"band": "MWIR", "spp": 16},
                               band=SimpleNamespace(name="MWIR", label="MWIR 3-5 um"), spp=16, mean=np.float32(5.25),
                               rms_error=0.0125, reached=self.reached, invalid=self.invalid, paths=96, seconds=1.5)

    def signature(self, scene, **sampling):
        self.asked(scene, **sampling)
        return SimpleNamespace(as_dict=lambda: {
            "band": "total", "intensity": 22.0755, "standard_error": 0.0021, "by_bounce": [20.0, 22.0],
            "by_group": {"hot": 21.0, "self": 1.0755}, "by_seen": {"plate": 22.0755}, "seconds": 1.5, "paths": 2**32})

    def asked(self, scene, progress, **sampling):
        assert scene == "the scene"
        self.sampling = sampling
        progress(1, 4)
        progress(4, 4)
        if self.error:
            raise self.error


@pytest.fixture
def renderer(monkeypatch):
    renderer = Renderer()
    for name in ("load", "render", "signature"):
        monkeypatch.setitem(vars(mi_lcair), name, getattr(renderer, name))
    return renderer


# ------------------------------------------------------------------- start and help

def test_help_loads_nothing_heavy():
    """The help of the program and of every command answers before anything slow is imported; so does a bad option."""
    code = f"""
import sys
from mi_lcair.cli import COMMANDS, main
calls = [["--help"], ["--version"]] + [[name, "--help"] for name in COMMANDS] + [["render", "x", "-o", "x.exr", "--spp", "0"]]
for args in calls:
    try:
        main(args)
    except SystemExit as end:
        assert end.code == (2 if "--spp" in args else 0), (args, end.code)
heavy = [name for name in {HEAVY} if name in sys.modules]
assert not heavy, heavy
"""
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True, capture_output=True, text=True,
                   env={**os.environ, "PYTHONPATH": str(CHECKOUT)})


def test_help_and_version():
    for args in ([], ["--help"]):
        result = run(*args)
        assert result.exit_code == 0 and "render" in result.stdout and "..." not in result.stdout.split("Commands:")[1]
    assert run("--version").stdout == f"mi-lcair {mi_lcair.__version__}\n"


# ------------------------------------------------------------------- render

def test_render_passes_on_every_option(renderer, folder):
    result = run("render", "cavity", "-D", "opening=8", "-D", "text=a=b", "-s", 1, "--spp", 64, "--tolerance", "2.5%",
                 "--max-spp", 4096, "--seed", 7, "-o", "out.exr")
    assert result.exit_code == 0, result.output
    assert renderer.loaded == ("cavity", {"opening": "8", "text": "a=b"})
    assert renderer.sampling == {"sensor": 1, "spp": 64, "tolerance": 0.025, "max_spp": 4096, "seed": 7}
    channels, header = read_exr("out.exr")
    assert (channels["Y"].shape, header) == ((2, 3), {"band": "MWIR", "spp": 16})


def test_render_defaults(renderer):
    assert run("render", "cavity", "-o", "out.exr").exit_code == 0
    assert renderer.sampling == {"sensor": 0, "spp": None, "tolerance": None, "max_spp": None, "seed": 0}


def test_render_prints_what_it_made(renderer):
    result = run("render", "cavity", "-o", "out.exr")
    assert result.stdout == """\
image              out.exr, 3 x 2 pixels, MWIR 3-5 um
mean radiance      5.25 W m^-2 sr^-1
standard error     1.25% of the mean (rms over the pixels)
samples per pixel  16
time               1.50 s
"""
    assert result.stderr == ""  # no progress bar where stderr is no terminal


@pytest.mark.parametrize("reached, words", [(True, "0.01 reached"), (False, "0.01 NOT reached")])
def test_render_says_what_went_short(renderer, reached, words):
    renderer.reached, renderer.invalid = reached, 3
    lines = run("render", "cavity", "--tolerance", "0.01", "-o", "out.exr").stdout.splitlines()
    assert lines[-2:][0].split(maxsplit=2)[2].startswith("3 NaN or infinite")
    assert lines[-1].split(maxsplit=1)[1].startswith(words)


def test_render_json(renderer):
    result = run("render", "cavity", "-o", "out.exr", "--json")
    assert json.loads(result.stdout) == {"file": "out.exr", "band": "MWIR", "mean": 5.25, "rms_error": 0.0125, "spp": 16,
                                         "reached": None, "invalid": 0, "paths": 96, "seconds": 1.5}


@pytest.mark.parametrize("args, reason", [
    (["--spp", "0"], "--spp"), (["--spp", "many"], "--spp"), (["--spp", "-4"], "--spp"),
    (["--tolerance", "0"], "'0' is not a fraction"), (["--tolerance", "-1%"], "fraction"),
    (["--tolerance", "nan"], "fraction"), (["--tolerance", "1%%"], "fraction"), (["--tolerance", "5"], "fraction"),
    (["--tolerance", "%"], "fraction"), (["--tolerance", "100%"], "fraction"),
    (["--tolerance", "1%", "--max-spp", "0"], "--max-spp"), (["--max-spp", "64"], "--max-spp needs --tolerance"),
    (["-D", "opening"], "'opening' is not of the form key=value"), (["-D", "=8"], "key=value"),
    (["-s", "-1"], "--sensor"), (["-s", "front"], "--sensor"), (["--seed", "-1"], "--seed"),
    (["--seed", str(2**32)], "--seed"), (["-t", "0"], "--threads"),
    (["--variant", "scalar_rgb"], "'llvm_ad_mono', 'cuda_ad_mono'"), (["--nonsense"], "--nonsense"),
    (["second"], "second"),
])
def test_bad_options(renderer, folder, args, reason):
    message = refused("render", "cavity", "-o", "out.exr", *args)
    assert reason in message and "mi-lcair render --help" in message
    assert not hasattr(renderer, "loaded") and list(folder.iterdir()) == []


@pytest.mark.parametrize("args, reason", [
    ([], "Missing argument 'SCENE'"), (["cavity"], "--output"), (["cavity", "-o", "nowhere/out.exr"], "does not exist"),
    (["cavity", "-o", "out.png"], ".exr"), (["cavity", "-o", "/dev/null"], ".exr"),
])
def test_bad_output(renderer, args, reason):
    """An output that cannot be written is refused before the scene is loaded."""
    assert reason in refused("render", *args)
    assert not hasattr(renderer, "loaded")


def test_unknown_command():
    assert "unknown command 'rendr'; known: render," in refused("rendr", "cavity")


# ------------------------------------------------------------------- the error policy

IN_A_PLUGIN = """[parser.cpp:1718] At "my scene.xml" (line 4, col 9): failed to instantiate bsdf plugin of type \
"sandford_robertson": Traceback (most recent call last):
  File "sandford_robertson.py", line 16, in __init__
{}"""


def caused(error, cause):
    error.__cause__ = cause
    return error


@pytest.mark.parametrize("error, status, message", [
    (InputError("b is\n 2"), 2, "b is 2"),
    (unknown("scene", "cavty", ["furnace", "cavity"]), 2, "unknown scene 'cavty'; known: cavity, furnace"),
    (RuntimeError(IN_A_PLUGIN.format("InputError: b = 2: outside 0..1")), 2,
     '"my scene.xml" (line 4, col 9): b = 2: outside 0..1'),
    (RuntimeError(IN_A_PLUGIN.format("mi_lcair.errors.InputError: b")), 2, '"my scene.xml" (line 4, col 9): b'),
    (RuntimeError(IN_A_PLUGIN.format("KeyError: 'x'")), 1, "\"my scene.xml\" (line 4, col 9): KeyError: 'x'"),
    (RuntimeError(IN_A_PLUGIN.format("KeyboardInterrupt")), 130, "interrupted"),
    (RuntimeError("Traceback (most recent call last):\n  File x\nInputError: b"), 2, "b"),
    (caused(RuntimeError("dr.while_loop(): see above"), InputError("b = 2")), 2, "b = 2"),
    (caused(RuntimeError("dr.while_loop(): see above"), KeyError("x")), 1,
     "RuntimeError: dr.while_loop(): see above (KeyError: 'x')"),
    (caused(InputError("not a number: 'x'"), ValueError("float")), 2, "not a number: 'x'"),
    (ZeroDivisionError("division\nby zero"), 1, "ZeroDivisionError: division by zero"),
    (MemoryError(), 1, "MemoryError:"),
    (OSError(28, "No space left on device"), 1, "OSError: [Errno 28] No space left on device"),
    (KeyboardInterrupt(), 130, "interrupted"),
])
def test_errors_are_one_line(renderer, folder, error, status, message):
    """Whatever ends a render, there is one line, the right status and no file."""
    renderer.error = error
    result = run("render", "cavity", "-o", "out.exr")
    assert (result.exit_code, result.stdout, result.stderr.strip()) == (status, "", f"mi-lcair: {message}")
    assert list(folder.iterdir()) == []


def test_tracebacks_on_request(renderer, monkeypatch):
    monkeypatch.setenv("MI_LCAIR_DEBUG", "1")
    renderer.error = ZeroDivisionError("division by zero")
    assert run("render", "cavity", "-o", "out.exr").exception is renderer.error


def test_interrupt_from_outside(folder):
    """A real SIGINT during a render: exit 130, one line, no file."""
    code = """
import sys, time, mi_lcair
mi_lcair.load = lambda scene: scene
def render(scene, **sampling):
    print("rendering", flush=True)
    time.sleep(60)
mi_lcair.render = render
from mi_lcair.cli import main
main(["render", "cavity", "-o", "out.exr"])
"""
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               env={**os.environ, "PYTHONPATH": str(CHECKOUT)})
    assert process.stdout.readline() == "rendering\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert (process.returncode, errors.strip()) == (130, "mi-lcair: interrupted")
    assert list(folder.iterdir()) == []


def test_a_reader_that_leaves_is_no_news():
    """`mi-lcair ... | head -0`: quiet."""
    reader, writer = os.pipe()
    os.close(reader)
    process = subprocess.run([sys.executable, "-c", "from mi_lcair.cli import main; main()", "--help"], stdout=writer,
                             stderr=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(CHECKOUT)})
    os.close(writer)
    assert (process.returncode, process.stderr) == (1, b"")


# ------------------------------------------------------------------- variant and threads

@pytest.fixture
def machine(monkeypatch):
    """Stands for mitsuba and drjit; a variant 'cuda_ad_mono' fails as it does without a GPU."""
    seen = SimpleNamespace(calls=[])

    def set_variant(name):
        if name == "cuda_ad_mono":
            raise ImportError("jit_init_thread_state(): the CUDA backend hasn't been initialized.")
        seen.calls.append(name)

    for name, function in (("mitsuba", set_variant), ("drjit", seen.calls.append)):
        module = ModuleType(name)
        setattr(module, {"mitsuba": "set_variant", "drjit": "set_thread_count"}[name], function)
        monkeypatch.setitem(sys.modules, name, module)
    return seen


def test_variant_and_threads(renderer, machine):
    assert run("render", "cavity", "-o", "out.exr", "--variant", "llvm_ad_mono", "-t", 2).exit_code == 0
    assert machine.calls == ["llvm_ad_mono", 2]


def test_a_variant_without_its_hardware(renderer, machine):
    assert "needs an NVIDIA GPU" in refused("render", "cavity", "-o", "out.exr", "--variant", "cuda_ad_mono")
    assert not hasattr(renderer, "loaded")


# ------------------------------------------------------------------- signature, scenes, chart

def test_signature_table(renderer):
    result = run("signature", "two_plates", "--spp", 4)
    assert renderer.sampling["spp"] == 4
    rows = [line.split() for line in result.stdout.splitlines()]
    assert ["intensity", "22.0755", "W/sr"] in rows and ["standard", "error", "0.0021", "W/sr"] in rows
    assert ["0", "20"] in rows and ["1", "22"] in rows and ["hot", "21"] in rows and ["plate", "22.0755"] in rows


def test_signature_json(renderer):
    result = run("signature", "two_plates", "--json")
    assert json.loads(result.stdout) == renderer.signature("the scene", progress=lambda *_: None).as_dict()


@pytest.fixture
def bundled(monkeypatch):
    module = ModuleType("mi_lcair.scenes")
    module.names = lambda: ["cavity", "two_plates"]
    module.path = lambda name: Path("/scenes") / f"{name}.xml"
    module.parameters = lambda name: {"opening": "8", "band": "total"} if name == "cavity" else {}
    monkeypatch.setitem(sys.modules, "mi_lcair.scenes", module)
    monkeypatch.setitem(vars(mi_lcair), "scenes", module)


def test_scenes(bundled):
    lines = run("scenes").stdout.splitlines()
    assert lines[:2] == ["cavity      opening=8 band=total", "two_plates"]
    assert json.loads(run("scenes", "--json").stdout) == {
        "cavity": {"path": "/scenes/cavity.xml", "parameters": {"opening": "8", "band": "total"}},
        "two_plates": {"path": "/scenes/two_plates.xml", "parameters": {}}}


# ------------------------------------------------------------------- show

@pytest.fixture
def image():
    pixels = np.arange(12, dtype=np.float32).reshape(3, 4)
    channels = {"Y": pixels, "bounce00.Y": pixels, "bounce01.Y": pixels, "temperature.Y": pixels}
    write_exr("image.exr", channels, {"scene": "cavity", "band": "MWIR"})
    return channels


@pytest.fixture
def pictures(monkeypatch):
    """What show asks the picture module to draw."""
    drawn = []
    monkeypatch.setattr("mi_lcair.rendering.picture.save_picture",
                        lambda path, channels, title, log: drawn.append((str(path), list(channels), title, log)))
    return drawn


@pytest.mark.parametrize("args, expected", [
    ([], ("image.png", ["Y"], "cavity, MWIR", False)),
    (["-c", "temperature.Y", "-o", "t.PNG", "--log"], ("t.PNG", ["temperature.Y"], "cavity, MWIR", True)),
    (["-c", "bounce*", "-c", "*"], ("image.png", ["bounce00.Y", "bounce01.Y", "Y", "temperature.Y"], "cavity, MWIR", False)),
])
def test_show(image, pictures, args, expected):
    result = run("show", "image.exr", *args)
    assert (result.exit_code, result.stdout, pictures) == (0, expected[0] + "\n", [expected])


def test_show_writes_a_picture(image, folder):
    assert run("show", "image.exr", "-c", "temperature.Y").exit_code == 0
    assert (folder / "image.png").read_bytes().startswith(b"\x89PNG")


def test_show_images_of_other_programs(pictures):
    """No header of ours: the file's name is the title."""
    write_exr("photo.exr", {"R": np.ones((2, 2))}, {})
    assert "unknown channel 'Y'; known: R" in refused("show", "photo.exr")
    assert run("show", "photo.exr", "-c", "R").exit_code == 0
    assert pictures == [("photo.png", ["R"], "photo", False)]


@pytest.mark.parametrize("args, reason", [
    (["missing.exr"], "No such file"), ([], "Missing argument 'FILE.exr'"), (["text.exr"], "not an OpenEXR image"),
    (["image.exr", "-c", "tmperature.Y"], "unknown channel 'tmperature.Y'; known: temperature.Y,"),
    (["image.exr", "-o", "nowhere/a.png"], "does not exist"), (["image.exr", "-o", "a.jpg"], ".png"),
])
def test_show_refuses(image, folder, args, reason):
    (folder / "text.exr").write_text("no image")
    before = sorted(folder.iterdir())
    assert reason in refused("show", *args)
    assert sorted(folder.iterdir()) == before
