"""Tests of the command line and of `render`: arguments, output, errors and exit status."""

import inspect
import json
import os
import signal
import subprocess
import sys
from io import StringIO
from pathlib import Path
from types import ModuleType, SimpleNamespace

import click
import numpy as np
import pytest

import mi_lcair
from mi_lcair.cli import COMMANDS, PURPOSES, options
from mi_lcair.cli.options import progress_bar
from mi_lcair.errors import InputError, unknown
from mi_lcair.rendering.images.files import read_exr
from tests.detection.disc_scenario import write_disc

CHECKOUT = Path(mi_lcair.__file__).parents[1]
HEAVY = ("mitsuba", "drjit", "matplotlib", "colour", "scipy", "OpenEXR", "numpy", "tqdm")


# ---- start and help


def test_options_of_a_function():
    """They have the types, defaults and texts of the signature and docstring that Python sees."""
    names = "emissivity", "reflected", "sigma", "image"
    command = click.command("x")(options.of("temperature", *names)(lambda **_: None))
    emissivity, reflected, sigma, image = command.params
    signature = inspect.signature(mi_lcair.temperature).parameters
    assert sigma.default == signature["sigma"].default and sigma.type is click.FLOAT
    assert image.required and not emissivity.required and not reflected.required
    for option in command.params:
        words = " ".join(mi_lcair.temperature.__doc__.split())
        assert option.help and option.help.replace("--", "`").split("`")[0] in words
    (paths,) = click.command("x")(options.of("exchange", "paths")(lambda **_: None)).params
    default = inspect.signature(mi_lcair.exchange).parameters["paths"].default
    assert paths.default == default and paths.opts == ["--paths"] and paths.type.min == 1


@pytest.mark.slow
def test_a_signature_loads_what_it_uses():
    """No part of SciPy, which takes longer than the render, and no detection."""
    code = """
import sys
from mi_lcair.cli import main
try:
    main(["signature", "cavity", "--tolerance", "1%"])
except SystemExit as end:
    assert end.code == 0
unused = ("scipy.special", "scipy.sparse", "scipy.optimize", "mi_lcair.detection", "matplotlib")
loaded = [name for name in sys.modules if name.startswith(unused)]
assert not loaded, loaded
"""
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


@pytest.mark.slow
def test_help_loads_nothing_heavy():
    """Help and the message for a bad option need no slow imports."""
    code = f"""
import sys
from mi_lcair.cli import COMMANDS, main
calls = [["--help"], ["--version"], ["render", "x", "-o", "x.exr", "--spp", "0"]]
calls += [[name, "--help"] for name in COMMANDS]
for args in calls:
    try:
        main(args)
    except SystemExit as end:
        assert end.code == (2 if "--spp" in args else 0), (args, end.code)
heavy = [name for name in {HEAVY} if name in sys.modules]
assert not heavy, heavy
"""
    subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        check=True,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
    )


@pytest.mark.slow
def test_a_scene_that_does_not_exist_is_named_before_the_renderer_is_imported(tmp_path):
    """Alone, and as the target of a scenario."""
    write_disc(tmp_path)
    scenario = (tmp_path / "disc.toml").read_text()
    (tmp_path / "far.toml").write_text(scenario.replace("disc.xml", "no_such.xml"))
    code = """
import sys
from mi_lcair.cli import main
calls = [["signature", "no_such.xml"], ["render", "no_such.xml", "-o", "x.exr"]]
calls += [["contrast", "far.toml"], ["image", "far.toml", "-o", "x.exr"]]
for args in calls:
    try:
        main(args)
    except SystemExit as end:
        assert end.code == 2, (args, end.code)
assert 'mitsuba' not in sys.modules
"""
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
    )
    assert done.returncode == 0, done.stderr
    lines = done.stderr.splitlines()
    assert len(lines) == 4 and all("no_such" in line for line in lines)


def test_help_and_version(run):
    for args in ([], ["--help"]):
        result = run(*args)
        assert (
            result.exit_code == 0
            and "render" in result.stdout
            and "..." not in result.stdout.split("Options:")[1]
        )
    for option in ("--version", "-V"):
        assert run(option).stdout == f"mi-lcair {mi_lcair.__version__}\n"


def test_commands_are_grouped_by_purpose(run):
    """Each command stands once, below a purpose, with one line of what it does."""
    lines = run().stdout.split("Options:")[1].splitlines()
    assert set(PURPOSES) <= {line.rstrip(":") for line in lines}
    listed = [line.split()[0] for line in lines if line.startswith("  ") and "-" not in line[:5]]
    assert [name for name in listed if name in COMMANDS] == list(COMMANDS)


@pytest.mark.parametrize("command", [[], *([name] for name in COMMANDS)])
def test_short_options_of_every_command(run, command):
    assert run(*command, "-h").stdout == run(*command, "--help").stdout
    assert "-q, --quiet" in run(*command, "-h").stdout


@pytest.mark.parametrize(
    "command, old, new",
    [("audit", "--photons", "--paths"), ("exchange", "--rays", "--paths")]
    + [(command, "--resume", "--overwrite") for command in ("sweep", "trend")]
    + [(command, "--plot", "--output") for command in ("trend", "contrast", "image", "flight")]
    + [(command, "--plot", "--output") for command in ("budget", "invert", "fit")]
    + [("signature", "--plot", "--spectrum")],
)
def test_a_former_option_names_the_present_one(refused, command, old, new):
    message = refused(command, "x", old, 8)
    assert f"Did you mean {new}?" in message.replace("'", "")


@pytest.mark.parametrize("old", ["--photons", "--rays"])
def test_a_former_option_is_not_named_where_there_never_was_one(refused, old):
    assert "--paths" not in refused("render", "x", old, 8)


@pytest.mark.parametrize("args", [["-q", "render"], ["render", "-q"]])
def test_quiet_prints_no_notes_and_no_progress(run, refused, renderer, args, monkeypatch):
    renderer.remarks = ["material gloss: scaled down beyond 88 degrees"]
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    quiet = run(*args, "cavity", "-o", "out.exr")
    assert quiet.exit_code == 0 and quiet.stderr == ""
    assert "mean radiance" in quiet.stdout
    assert "material gloss" in run("render", "cavity", "-o", "out.exr").stderr
    refused(*args, "cavity", "-o", "out.png")  # errors are printed


def test_python_m_mi_lcair():
    done = subprocess.run(
        [sys.executable, "-m", "mi_lcair", "render"],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
    )
    assert done.returncode == 2 and done.stderr.startswith("mi-lcair: Missing argument 'SCENE'")


# ---- render


def test_render_passes_on_every_option(run, renderer, folder):
    result = run(
        "render",
        "cavity",
        "-D",
        "opening=8",
        "-D",
        "text=a=b",
        "-s",
        1,
        "--spp",
        64,
        "--seed",
        7,
        "-o",
        "out.exr",
    )
    assert result.exit_code == 0, result.output
    assert renderer.loaded == ("cavity", {"opening": "8", "text": "a=b"})
    sampling = {"sensor": 1, "spp": 64, "tolerance": None, "max_spp": None, "seed": 7}
    sampling |= {"parts": False, "truth": False, "bins": 0, "errors_um": (), "max_bounces": None}
    assert renderer.sampling == sampling
    channels, header = read_exr("out.exr")
    assert (channels["Y"].shape, header) == ((2, 3), {"band": "MWIR", "spp": 16})


def test_render_passes_on_a_tolerance(run, renderer):
    args = ("render", "cavity", "--tolerance", "2.5%", "--max-spp", 4096, "-o", "out.exr")
    assert run(*args).exit_code == 0
    sampling = {"sensor": 0, "spp": None, "tolerance": 0.025, "max_spp": 4096, "seed": 0}
    sampling |= {"parts": False, "truth": False, "bins": 0, "errors_um": (), "max_bounces": None}
    assert renderer.sampling == sampling


SAMPLED = [
    ("render", "cavity", "-o", "out.exr"),
    ("signature", "cavity"),
    ("trend", "cavity", "--azimuth", 0, "-o", "out.csv"),
    ("contrast", "a340_landing/position_1"),
    ("image", "a340_landing/position_1", "-o", "out.exr"),
    ("budget", "cavity", "-u", "sigma.toml"),
]


@pytest.mark.parametrize("command", SAMPLED, ids=lambda command: command[0])
def test_samples_and_a_tolerance_exclude_each_other(refused, renderer, folder, command):
    """--spp means the same in every command, and is refused beside a tolerance before any work."""
    message = refused(*command, "--spp", 4, "--tolerance", "1%")
    assert "--spp sets a fixed number of samples; --tolerance" in message
    assert not hasattr(renderer, "loaded") and not list(folder.iterdir())


def test_render_defaults(run, renderer):
    assert run("render", "cavity", "-o", "out.exr").exit_code == 0
    assert renderer.sampling == {
        "sensor": 0,
        "spp": None,
        "tolerance": None,
        "max_spp": None,
        "seed": 0,
        "bins": 0,
        "parts": False,
        "truth": False,
        "errors_um": (),
        "max_bounces": None,
    }


def test_render_through_an_atmosphere(run, refused, folder):
    result = run(
        "render",
        "cylinder_ir_range",
        "-D",
        "resolution=8",
        "--spp",
        2,
        "--atmosphere",
        "us_standard",
        "--range",
        800,
        "-o",
        "out.exr",
    )
    assert result.exit_code == 0, result.output
    channels, header = read_exr("out.exr")
    assert {"apparent.Y", "path.Y"} < set(channels) and (
        header["atmosphere"],
        header["atmosphere_range_m"],
    ) == ("us_standard", "800")
    (folder / "out.exr").unlink()
    assert "known: us_standard" in refused(
        "render", "cylinder_ir_range", "--atmosphere", "us_standart", "-o", "out.exr"
    )
    assert "name one" in refused("render", "cylinder_ir_range", "--range", 800, "-o", "out.exr")
    assert "range = 0 m" in refused(
        "render", "cylinder_ir_range", "--atmosphere", "us_standard", "--range", 0, "-o", "out.exr"
    )
    assert not list(folder.iterdir())


def test_render_prints_what_it_made(run, renderer):
    result = run("render", "cavity", "-o", "out.exr")
    assert (
        result.stdout
        == """\
image              3 x 2 pixels, MWIR 3-5 um
mean radiance      5.25 W m^-2 sr^-1
error              the rms standard error over the pixels is 1.2 % of the mean
samples per pixel  16
file               out.exr
time               1.50 s
"""
    )
    # stderr is no terminal and shows no progress bar
    assert result.stderr == "next: mi-lcair show out.exr\n"


@pytest.mark.parametrize(
    "results, row",
    [
        (
            {"reached": True},
            "tolerance          1 % reached: the rms standard error over the pixels is 1.2 % of "
            "the mean",
        ),
        (
            {"reached": False},
            "tolerance          1 % NOT reached: the rms standard error over the pixels is 1.2 % "
            "of the mean; raise --max-spp",
        ),
        ({"closure_error": 0.0123}, "closure error      0.012 W m^-2 sr^-1 (estimated)"),
        (
            {"rms_error": None, "reached": False},
            "tolerance          1 % NOT reached: the rms standard error over the pixels is "
            "unknown; raise --max-spp",
        ),
    ],
)
def test_render_says_what_went_short(run, renderer, results, row):
    renderer.results = results
    assert (
        row in run("render", "cavity", "--tolerance", "0.01", "-o", "out.exr").stdout.splitlines()
    )


@pytest.mark.parametrize("json", [[], ["--json"]])
def test_invalid_samples_are_noted(run, renderer, json):
    renderer.results = {"invalid": 3}
    told = run("render", "cavity", "-o", "out.exr", *json).stderr
    note = told.splitlines()[0]
    assert note == "mi-lcair: warning: 3 of 96 samples were NaN or infinite and are ignored"


def test_remarks_on_the_scene_go_to_stderr(run, renderer):
    renderer.remarks = ["material gloss: scaled down beyond 88 degrees"]
    result = run("render", "cavity", "-o", "out.exr", "--json")
    (note,) = result.stderr.splitlines()
    assert note == "mi-lcair: warning: material gloss: scaled down beyond 88 degrees"
    assert json.loads(result.stdout)["spp"] == 16


def test_render_writes_and_draws(run, renderer, folder):
    pixels = np.full((2, 3), 300, np.float32)
    renderer.results = {"channels": {"Y": pixels, "temperature.Y": pixels}}
    result = run("render", "cavity", "-o", "out.exr", "-o", "out.png")
    assert result.exit_code == 0 and "out.png" in result.stdout, result.output
    assert (folder / "out.png").read_bytes().startswith(b"\x89PNG")
    assert read_exr("out.exr")[1] == {"band": "MWIR", "spp": 16}


def test_render_json(run, renderer):
    result = run("render", "cavity", "-o", "out.exr", "--json")
    assert json.loads(result.stdout) == {
        "file": "out.exr",
        "kind": "render",
        "scene_name": "cavity",
        "band": "MWIR",
        "width": 3,
        "height": 2,
        "window_m": [0.3, 0.2],
        "mean_radiance_W_m2_sr": 5.25,
        "standard_error_W_m2_sr": 0.5,
        "rms_error": 0.0125,
        "by_bounce_W_m2_sr": [],
        "spp": 16,
        "tolerance": None,
        "reached": None,
        "invalid": 0,
        "closure_error_W_m2_sr": None,
        "paths": 96,
        "time_s": 1.5,
        "header": {"band": "MWIR", "spp": 16},
        "left_out": None,
        "followed": "",
        "channels": {"radiance_W_m2_sr": {"least": 5.0, "mean": 5.0, "greatest": 5.0}},
    }


@pytest.mark.parametrize(
    "args, reason",
    [
        (["--spp", "0"], "--spp"),
        (["--spp", "many"], "--spp"),
        (["--spp", "-4"], "--spp"),
        (["--tolerance", "0"], "'0' is not a fraction"),
        (["--tolerance", "-1%"], "fraction"),
        (["--tolerance", "nan"], "fraction"),
        (["--tolerance", "1%%"], "fraction"),
        (["--tolerance", "5"], "fraction"),
        (["--tolerance", "%"], "fraction"),
        (["--tolerance", "100%"], "fraction"),
        (["--tolerance", "1%", "--max-spp", "0"], "--max-spp"),
        (["--max-spp", "64"], "--max-spp needs --tolerance"),
        (["-D", "opening"], "'opening' is not of the form key=value"),
        (["-D", "=8"], "key=value"),
        (["-s", "-1"], "--sensor"),
        (["-s", "front"], "--sensor"),
        (["--seed", "-1"], "--seed"),
        (["--seed", str(2**32)], "--seed"),
        (["-t", "0"], "--threads"),
        (["--variant", "scalar_rgb"], "'llvm_ad_mono', 'cuda_ad_mono', 'metal_ad_mono'"),
        (["--nonsense"], "--nonsense"),
        (["second"], "second"),
    ],
)
def test_bad_options(refused, renderer, folder, args, reason):
    message = refused("render", "cavity", "-o", "out.exr", *args)
    assert reason in message and "mi-lcair render --help" in message
    assert not hasattr(renderer, "loaded") and list(folder.iterdir()) == []


@pytest.mark.parametrize(
    "args, reason",
    [
        ([], "Missing argument 'SCENE'"),
        (["cavity"], "--output"),
        (["cavity", "-o", "nowhere/out.exr"], "does not exist"),
        (["cavity", "-o", "out.tif"], ".exr"),
        (["cavity", "-o", "out.hdr"], "give --bins"),
        (["cavity", "-o", "/dev/null"], ".exr"),
    ],
)
def test_bad_output(refused, renderer, args, reason):
    """An output that cannot be written is refused before the scene is loaded."""
    assert reason in refused("render", *args)
    assert not hasattr(renderer, "loaded")


def test_unknown_command(refused):
    assert "unknown command 'rendr'; known: render," in refused("rendr", "cavity")


# ---- the error policy

IN_A_PLUGIN = """[parser.cpp:1718] At "my scene.xml" (line 4, col 9): \
failed to instantiate bsdf plugin of type "sandford_robertson": Traceback (most recent call last):
  File "sandford_robertson.py", line 16, in __init__
{}"""


def caused(error, cause):
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    "error, status, message",
    [
        (InputError("b is\n 2"), 2, "b is 2"),
        (
            unknown("scene", "cavty", ["furnace", "cavity"]),
            2,
            "unknown scene 'cavty'; known: cavity, furnace",
        ),
        (
            RuntimeError(IN_A_PLUGIN.format("InputError: b = 2: outside 0..1")),
            2,
            '"my scene.xml" (line 4, col 9): b = 2: outside 0..1',
        ),
        (
            RuntimeError(IN_A_PLUGIN.format("mi_lcair.errors.InputError: b")),
            2,
            '"my scene.xml" (line 4, col 9): b',
        ),
        (
            RuntimeError(IN_A_PLUGIN.format("KeyError: 'x'")),
            1,
            "RuntimeError: KeyError: \"my scene.xml\" (line 4, col 9): 'x'",
        ),
        (RuntimeError(IN_A_PLUGIN.format("KeyboardInterrupt")), 130, "interrupted"),
        (RuntimeError("Traceback (most recent call last):\n  File x\nInputError: b"), 2, "b"),
        (caused(RuntimeError("dr.while_loop(): see above"), InputError("b = 2")), 2, "b = 2"),
        (
            caused(RuntimeError("dr.while_loop(): see above"), KeyError("x")),
            1,
            "RuntimeError: dr.while_loop(): see above (KeyError: 'x')",
        ),
        (caused(InputError("not a number: 'x'"), ValueError("float")), 2, "not a number: 'x'"),
        (ZeroDivisionError("division\nby zero"), 1, "ZeroDivisionError: division by zero"),
        (MemoryError(), 1, "MemoryError:"),
        (OSError(28, "No space left on device"), 1, "OSError: [Errno 28] No space left on device"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_errors_are_one_line(run, renderer, folder, error, status, message):
    """An error during a render gives one line, the right exit status and no file."""
    renderer.error = error
    result = run("render", "cavity", "-o", "out.exr")
    assert (result.exit_code, result.stdout, result.stderr.strip()) == (
        status,
        "",
        f"mi-lcair: {message}",
    )
    assert list(folder.iterdir()) == []


def test_tracebacks_on_request(run, renderer, monkeypatch):
    monkeypatch.setenv("MI_LCAIR_DEBUG", "1")
    renderer.error = ZeroDivisionError("division by zero")
    assert run("render", "cavity", "-o", "out.exr").exception is renderer.error


def test_interrupt_from_outside(folder):
    """SIGINT during a render gives exit status 130, one line and no file."""
    code = """
import sys, time, mi_lcair
from types import SimpleNamespace
mi_lcair.load = lambda scene: SimpleNamespace(remarks=[])
def render(scene, **sampling):
    print("rendering", flush=True)
    time.sleep(60)
mi_lcair.render = render
from mi_lcair.cli import main
main(["render", "cavity", "-o", "out.exr"])
"""
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
    )
    assert process.stdout.readline() == "rendering\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate()
    assert (process.returncode, errors.strip()) == (130, "mi-lcair: interrupted")
    assert list(folder.iterdir()) == []


def test_a_reader_that_leaves_is_no_news():
    """A closed pipe, as in `mi-lcair ... | head -0`, gives no message."""
    reader, writer = os.pipe()
    os.close(reader)
    process = subprocess.run(
        [sys.executable, "-c", "from mi_lcair.cli import main; main()", "--help"],
        stdout=writer,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
    )
    os.close(writer)
    assert (process.returncode, process.stderr) == (1, b"")


# ---- variant and threads


@pytest.fixture
def machine(monkeypatch):
    """Substitute for mitsuba and drjit. Variants for GPUs fail as without one."""
    seen = SimpleNamespace(calls=[])

    def set_variant(name):
        if name != "llvm_ad_mono":
            raise ImportError("jit_init_thread_state(): the CUDA backend hasn't been initialized.")
        seen.calls.append(name)

    for name, function in (("mitsuba", set_variant), ("drjit", seen.calls.append)):
        module = ModuleType(name)
        setattr(module, {"mitsuba": "set_variant", "drjit": "set_thread_count"}[name], function)
        monkeypatch.setitem(sys.modules, name, module)
    return seen


def test_variant_and_threads(run, renderer, machine):
    assert (
        run("render", "cavity", "-o", "out.exr", "--variant", "llvm_ad_mono", "-t", 2).exit_code
        == 0
    )
    assert machine.calls == ["llvm_ad_mono", 2]


@pytest.mark.parametrize("variant", ["cuda_ad_mono", "metal_ad_mono"])
def test_a_variant_without_its_hardware(refused, renderer, machine, variant):
    message = refused("render", "cavity", "-o", "out.exr", "--variant", variant)
    assert f"'{variant}' cannot start" in message and "needs an NVIDIA GPU" in message
    assert "metal_ad_mono an Apple GPU" in message
    assert not hasattr(renderer, "loaded")


# ---- progress


def test_progress_is_drawn_on_a_terminal(monkeypatch):
    """The progress bar shows the samples done, and a total that may change."""
    terminal = StringIO()
    terminal.isatty = lambda: True
    monkeypatch.setattr(sys, "stderr", terminal)
    with progress_bar() as progress:
        progress(16, 64)
        progress(100, 128)
    assert "16/64" in terminal.getvalue() and "100/128" in terminal.getvalue()


@pytest.mark.parametrize("command", [["render", "-o", "image.exr"], ["signature"]])
@pytest.mark.parametrize("json", [[], ["--json"]])
def test_invalid_samples_are_told_of_on_stderr(run, renderer, folder, command, json):
    renderer.results = {"invalid": 3}
    result = run(command[0], "cavity", *command[1:], *json)
    assert result.exit_code == 0
    assert "mi-lcair: warning: 3 of " in result.stderr and "NaN or infinite" in result.stderr
