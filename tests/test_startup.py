"""Start-up: LLVM is chosen before drjit is imported, plugins are registered with mitsuba, and
nothing aborts.

Each test starts a Python of its own, because what is tried is what the first import in a process
does.
"""

import os
import shutil
import subprocess
import sys
import zipfile
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from types import SimpleNamespace

import pytest

import mi_lcair
from mi_lcair import startup

ROOT = Path(__file__).resolve().parents[1]
LLVM_14 = Path("/usr/lib/x86_64-linux-gnu/libLLVM-14.so.1")
LLVM_15 = Path("/usr/lib/x86_64-linux-gnu/libLLVM-15.so.1")
needs_llvm_15 = pytest.mark.skipif(not LLVM_15.exists(), reason="no LLVM 15 on this machine")

# LLVM 15 and 16 pass a plain sum and abort the process at `minimum`, so that is what shows that
# LLVM works.
COMPUTE = (
    "import drjit as dr; "
    "assert dr.minimum(dr.llvm.Float([1, 2, 3]), 2).numpy().tolist() == [1, 2, 2]\n"
)
SANDFORD_ROBERTSON = {
    "type": "sandford_robertson",
    "epsilon": 0.1,
    "rho_d": 0.2,
    "b": 0.3,
    "e": 0.2,
}


def python(code, *path, variable=None):
    """Run `code` in a fresh Python that searches the folders `path` (default: the checkout) before
    its own.
    """
    environment = {key: value for key, value in os.environ.items() if key != startup.LLVM_VARIABLE}
    environment["PYTHONPATH"] = os.pathsep.join(map(str, path or (ROOT,)))
    if variable is not None:
        environment[startup.LLVM_VARIABLE] = str(variable)
    return subprocess.run(
        [sys.executable, "-P", "-c", code],
        env=environment,
        capture_output=True,
        text=True,
    )


@pytest.fixture
def usable_llvm(monkeypatch):
    """Path of the LLVM that is chosen when the user names none."""
    monkeypatch.setenv(startup.LLVM_VARIABLE, "")
    startup.prepare_llvm()
    return os.environ[startup.LLVM_VARIABLE]


# LLVM
# ------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_finds_llvm_by_itself():
    done = python("import mi_lcair\n" + COMPUTE)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize(
    "variable", ["/nowhere/libLLVM.so", pytest.param(LLVM_15, marks=needs_llvm_15)]
)
def test_unusable_variable_is_passed_over_with_one_line(variable):
    done = python("import mi_lcair\n" + COMPUTE, variable=variable)
    assert done.returncode == 0, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"{startup.LLVM_VARIABLE}={variable} is passed over: ")


@pytest.mark.slow
def test_usable_variable_comes_first(usable_llvm, tmp_path):
    link = tmp_path / "libLLVM.so"
    link.symlink_to(usable_llvm)
    done = python(
        f"import mi_lcair, os\n{COMPUTE}print(os.environ['{startup.LLVM_VARIABLE}'])", variable=link
    )
    assert (done.stdout.strip(), done.stderr) == (str(link), "")


@pytest.mark.slow
@pytest.mark.parametrize("variable", [None, pytest.param(LLVM_15, marks=needs_llvm_15)])
def test_no_usable_llvm_is_one_line_that_says_what_to_install(variable):
    done = python(
        "from mi_lcair import startup\n"
        "startup.WHEEL, startup.SYSTEM = 'a-wheel-that-nobody-has', ()\n"
        "try: import mitsuba\n"
        "except ImportError as error: print(error)",
        variable=variable,
    )
    assert done.returncode == 0, done.stderr
    (line,) = done.stdout.splitlines()
    assert line.startswith("no LLVM 17 or newer found") and "; install one: " in line


def test_version_is_asked_of_the_library(usable_llvm, monkeypatch):
    """LLVM 16 answers with its version too; here what answers is too old because more is asked."""
    monkeypatch.setattr(startup, "OLDEST", 99)
    monkeypatch.setattr(startup, "SYSTEM", ())
    with pytest.raises(
        ImportError, match=r"^no LLVM 99 or newer found \(tried .*: LLVM \d\d, older than 99"
    ):
        startup.prepare_llvm()


def test_missing_libatomic_is_one_line_that_says_what_to_install(monkeypatch):
    def load(name):
        raise OSError(f"{name}: cannot open shared object file")

    monkeypatch.setattr(startup.sys, "platform", "linux")
    monkeypatch.setattr(startup.ctypes, "CDLL", load)
    with pytest.raises(
        ImportError, match=r"^libatomic.so.1 is missing.* apt-get install libatomic1$"
    ):
        startup.prepare_llvm()


RENDER = "assert mi_lcair.render(mi_lcair.load('two_plates', resolution=4), spp=4).mean > 0\n"
OLD_LLVMS = {  # Mitsuba itself refuses llvm_ad_mono with LLVM 14
    "import drjit": LLVM_14,
    "import mitsuba as mi": LLVM_15,
    "import mitsuba as mi; mi.set_variant('llvm_ad_mono')": LLVM_15,
    "import mitsuba as mi; mi.set_variant('llvm_ad_rgb', 'scalar_rgb')": LLVM_14,
}


@pytest.mark.slow
@pytest.mark.parametrize("first", OLD_LLVMS)
def test_old_llvm_of_an_imported_drjit_is_replaced(first):
    variable = OLD_LLVMS[first]
    if not variable.exists():
        pytest.skip(f"no {variable.name}")
    done = python(
        f"{first}\nimport os; del os.environ['{startup.LLVM_VARIABLE}']\nimport mi_lcair\n"
        "import mitsuba; mitsuba.set_variant('llvm_ad_mono')\n" + COMPUTE + RENDER,
        variable=variable,
    )
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stderr.splitlines() if "jit_llvm_init()" not in line]
    assert lines == []  # LLVM 14 is reported by Dr.Jit itself, at its import


@pytest.mark.slow
@needs_llvm_15
def test_arrays_outlive_a_replaced_llvm():
    done = python(
        "import drjit as dr\nx = dr.llvm.ad.Float([1, 2, 3]); dr.enable_grad(x); y = x * x\n"
        "stored = dr.llvm.Float([4, 5]) * 2; dr.eval(stored)\n"
        f"import os; del os.environ['{startup.LLVM_VARIABLE}']\nimport mi_lcair\n"
        "dr.backward(y); print(dr.grad(x), dr.minimum(stored, 9))",
        variable=LLVM_15,
    )
    assert done.stdout == "[2, 4, 6] [8, 9]\n", done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "variable, found",
    [("/nowhere", "no LLVM"), pytest.param(LLVM_15, "LLVM 15", marks=needs_llvm_15)],
)
def test_an_llvm_that_cannot_be_replaced(variable, found):
    """Dr.Jit looks for LLVM once, and Mitsuba's objects would not survive its second start."""
    create = "mi.set_variant('llvm_ad_mono'); bsdf = mi.load_dict({'type': 'diffuse'})"
    created = "" if found == "no LLVM" else f"; {create}"
    done = python(f"import mitsuba as mi{created}\nimport mi_lcair", variable=variable)
    assert done.returncode == 1  # an exception; an abort would be negative
    last = done.stderr.splitlines()[-1]
    assert last.startswith(f"ImportError: drjit was imported before mi_lcair and found {found}, ")
    assert last.endswith(f": import mi_lcair first, or set {startup.LLVM_VARIABLE}")
    assert ("has created objects" in last) == bool(created)


@pytest.mark.slow
def test_mitsuba_imported_first_with_a_usable_llvm(usable_llvm):
    done = python(
        "import mitsuba as mi\nmi.set_variant('llvm_ad_rgb')\nimport mi_lcair\n"
        f"assert mi.variant() == 'llvm_ad_rgb'\nmi.load_dict({SANDFORD_ROBERTSON})\n" + COMPUTE,
        variable=usable_llvm,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_read_only_site_packages(tmp_path):
    """The wheel as its files lie where the start-up hook that links libc++.so.1 could not write."""
    try:
        installed = [
            file
            for file in files(startup.WHEEL)
            if not file.locate().is_symlink() and file.locate().exists()
        ]
    except PackageNotFoundError:
        pytest.skip("the wheel with LLVM is not installed")
    site = tmp_path / "lib" / "python" / "site-packages"
    for file in installed:
        if ".so" in file.name or file.name in ("METADATA", "RECORD"):
            target = site / file
            Path(os.path.normpath(target)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file.locate(), os.path.normpath(target))
    done = python(
        f"import mi_lcair, os\n{COMPUTE}print(os.environ['{startup.LLVM_VARIABLE}'])", ROOT, site
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert Path(done.stdout.strip()).is_relative_to(tmp_path)


@pytest.mark.slow
def test_exceptions_of_mitsuba_are_still_caught():
    """The wheel's C++ runtime must not take the place of the one that Mitsuba throws with."""
    done = python(
        "import mi_lcair, mitsuba as mi\n"
        "try: mi.load_dict({'type': 'no_such_plugin'})\n"
        "except RuntimeError: print('caught')"
    )
    assert done.stdout == "caught\n", done.stderr


# The cache of kernels
# ------------------------------------------------------------------------------------------------


LIMITED = (
    "import resource\n"
    "resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))\n"  # as a full disk: no file grows
    "import mi_lcair, os\n"
)


@pytest.mark.slow
def test_kernels_that_cannot_be_written(tmp_path, monkeypatch):
    """Dr.Jit would try again for ever; here the cache is off, and a line says so."""
    monkeypatch.setenv(startup.CACHE_VARIABLE, str(tmp_path))
    render = "mi_lcair.render(mi_lcair.load('two_plates', resolution=4), spp=2)\n"
    done = python(LIMITED + render)
    assert done.returncode == 0, done.stderr
    assert done.stderr.startswith(f"kernel cache {tmp_path}: File too large; kernels are compiled")
    assert list(tmp_path.iterdir()) == []


def test_a_disk_without_room(tmp_path, monkeypatch, caplog):
    """The temporary folder takes the place of the cache's own, or nothing does."""
    own, other = tmp_path / "own", tmp_path / "tmp"
    other.mkdir()
    free = {"own": 2**20, "tmp": 2**40}
    usage = lambda folder: SimpleNamespace(free=free[Path(folder).relative_to(tmp_path).parts[0]])
    monkeypatch.setattr(startup.shutil, "disk_usage", usage)
    monkeypatch.setattr(startup.tempfile, "gettempdir", lambda: str(other))
    monkeypatch.setenv(startup.CACHE_VARIABLE, str(own))
    startup.prepare_kernel_cache()
    assert Path(os.environ[startup.CACHE_VARIABLE]).parent == other
    assert caplog.messages[-1].startswith(
        f"kernel cache {own}: only 1 MB are free, 64 MB are needed; {other}"
    )
    monkeypatch.setenv(startup.CACHE_VARIABLE, str(own))
    free["tmp"] = 0
    startup.prepare_kernel_cache()
    assert os.environ[startup.CACHE_VARIABLE] == os.devnull
    assert caplog.messages[-1].endswith("kernels are compiled anew in each run")


@pytest.fixture
def temporary_cache(tmp_path, monkeypatch):
    """The predictable folder that takes the place of a cache that cannot be written."""
    no_folder = tmp_path / "file"
    no_folder.touch()
    monkeypatch.setenv(startup.CACHE_VARIABLE, str(no_folder))
    monkeypatch.setattr(startup.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(startup.atexit, "register", lambda *call, **options: None)
    return tmp_path / f"drjit-{os.getuid()}"


def prepared() -> Path:
    startup.prepare_kernel_cache()
    return Path(os.environ[startup.CACHE_VARIABLE])


def test_a_cache_among_the_temporary_files_is_private(temporary_cache):
    for _ in range(2):
        assert prepared() == temporary_cache
        assert temporary_cache.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("mode", [0o777, 0o755, 0o770])
def test_a_cache_that_others_may_enter(temporary_cache, mode):
    """Compiled kernels are run: a folder that others prepared is not used."""
    temporary_cache.mkdir()
    temporary_cache.chmod(mode)
    folder = prepared()
    assert folder != temporary_cache and folder.stat().st_mode & 0o777 == 0o700


def test_a_cache_that_is_a_link_or_a_file(temporary_cache, tmp_path):
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    for target in ("elsewhere", "nowhere"):
        temporary_cache.symlink_to(tmp_path / target)
        assert prepared().resolve() not in (temporary_cache, tmp_path / target)
        temporary_cache.unlink()
    temporary_cache.touch()
    assert prepared().is_dir()


def test_a_cache_of_another_user(temporary_cache, monkeypatch):
    temporary_cache.mkdir(mode=0o700)
    lstat = Path.lstat
    other = lambda path: SimpleNamespace(st_mode=lstat(path).st_mode, st_uid=os.getuid() + 1)
    monkeypatch.setattr(Path, "lstat", other)
    assert prepared() != temporary_cache


@pytest.mark.parametrize(
    "mode, who", [(0o777, "all users may"), (0o775, "others of its group may"), (0o755, None)]
)
def test_a_cache_in_which_others_may_write(tmp_path, mode, who):
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(mode)
    trouble = startup.trouble(tmp_path / "open")
    assert trouble is None if who is None else trouble.startswith(who)


def test_a_cache_of_another_user(tmp_path, monkeypatch):
    status = tmp_path.stat()
    other = SimpleNamespace(st_uid=os.getuid() + 1, st_mode=status.st_mode)
    monkeypatch.setattr(Path, "stat", lambda *_, **__: other)
    assert startup.trouble(tmp_path).startswith("it belongs to another user")


@pytest.mark.skipif(os.getuid() == 0, reason="root may write anywhere")
def test_a_cache_that_is_read_only(tmp_path, monkeypatch):
    tmp_path.chmod(0o500)
    monkeypatch.setenv(startup.CACHE_VARIABLE, str(tmp_path))
    assert startup.trouble(tmp_path) == "Permission denied"


def test_a_cache_with_room_is_left_alone(tmp_path, monkeypatch, caplog):
    monkeypatch.setenv(startup.CACHE_VARIABLE, str(tmp_path / "new"))
    startup.prepare_kernel_cache()
    assert os.environ[startup.CACHE_VARIABLE] == str(tmp_path / "new") and not caplog.messages
    assert list((tmp_path / "new").iterdir()) == []


# Plugins
# ------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_plugins_follow_the_variant():
    done = python(
        "import mi_lcair, mitsuba as mi\n"
        "from mi_lcair.plugins.paths import launch, path_tracer\n"
        "assert mi.variant() == 'llvm_ad_mono'\n"
        "for variant in ('llvm_ad_mono', 'llvm_ad_rgb', 'scalar_rgb', 'llvm_ad_mono'):\n"
        "    mi.set_variant(variant)\n"
        "    if variant != 'scalar_rgb': "
        f"print(isinstance(mi.load_dict({SANDFORD_ROBERTSON}), mi.BSDF))\n"
        "print(launch.Launch is path_tracer.Launch)"
    )
    assert done.stdout.split() == ["True"] * 4, done.stderr


@pytest.mark.slow
def test_functions_that_take_scenes_stay_when_the_variant_changes():
    done = python(
        "import mi_lcair, mitsuba as mi\n"
        "mi.set_variant('llvm_ad_rgb')\n"
        "assert mi.traverse(mi.load_dict({'type': 'sphere'})).keys()\n"
        "mi.set_variant('llvm_ad_mono')\n"
        "scene = mi_lcair.load('two_plates', resolution=4)\n"
        "assert mi.util.render is mi.render and mi.traverse(scene).keys()\n"
        "print(mi.render(scene, spp=4).shape)"
    )
    assert done.stdout == "(4, 4, 1)\n", done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "first, other", [("llvm_ad_mono", "scalar_rgb"), ("llvm_ad_rgb", "llvm_ad_rgb")]
)
def test_derivatives_after_another_variant(first, other, usable_llvm):
    """A scene that was loaded before keeps its surfaces and its derivatives."""
    done = python(
        f"import mitsuba as mi; mi.set_variant('{first}')\n"
        "from mi_lcair.api.estimates import sensitivities\n"
        "import mi_lcair; mi.set_variant('llvm_ad_mono')\n"
        "scene = mi_lcair.load('two_plates', resolution=4)\n"
        "names = [name for name in mi_lcair.parameters(scene) if 'blackbody' in name]\n"
        "surfaces, before = len(scene.surfaces()), sensitivities(scene, names, spp=16)\n"
        f"mi.set_variant('{other}'); mi.set_variant('llvm_ad_mono')\n"
        "assert len(scene.surfaces()) == surfaces > 0\n"
        "for again in (scene, mi_lcair.load('two_plates', resolution=4)):\n"
        "    print(abs(sensitivities(again, names, spp=16).derivative - before.derivative).max())",
        variable=usable_llvm,
    )
    assert done.stdout.split() == ["0.0", "0.0"], done.stderr


@pytest.mark.slow
def test_plugins_imported_before_mitsuba():
    done = python(f"import mi_lcair.plugins, mitsuba as mi\nmi.load_dict({SANDFORD_ROBERTSON})")
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["checkout", "installed"])
def test_foreign_packages_stay_foreign(layout, tmp_path):
    """Ours are mi_lcair.plugins and nothing else; whatever lies beside an installed mi_lcair is no
    part of it.
    """
    for name in ("plugins", "photometry"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("FOREIGN = True\n")
    path = (tmp_path, ROOT)
    if layout == "installed":
        path = (tmp_path,)
        shutil.copytree(ROOT / "mi_lcair", tmp_path / "mi_lcair")
    done = python(
        "import sys, importlib.util, mi_lcair, mitsuba\n"
        "assert 'plugins' not in sys.modules\n"
        "assert importlib.util.find_spec('mi_lcair.photometry') is None\n"
        "import plugins\n"
        "assert plugins.FOREIGN and not hasattr(mi_lcair.plugins, 'FOREIGN')\n"
        "print(mi_lcair.plugins.__file__)",
        *path,
    )
    assert done.returncode == 0, done.stderr
    ours = tmp_path / "mi_lcair" / "plugins" if layout == "installed" else ROOT / "plugins"
    assert Path(done.stdout.strip()).parent.resolve() == ours


def test_help_loads_no_renderer_and_no_charts():
    done = python(
        "import sys\n"
        "from mi_lcair.cli import main\n"
        "sys.argv = ['mi-lcair', '--help']\n"
        "try: main()\n"
        "except SystemExit as status: assert not status.code\n"
        "print({'mitsuba', 'drjit', 'matplotlib', 'colour'} & set(sys.modules))"
    )
    assert done.stdout.startswith("Usage: mi-lcair") and done.stdout.endswith("set()\n"), (
        done.stderr
    )


def test_the_package_is_a_program():
    done = subprocess.run(
        [sys.executable, "-m", "mi_lcair", "scenes"], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0 and "\ncavity: " in done.stdout, done.stderr
    done = subprocess.run(
        [sys.executable, "-m", "mi_lcair", "render", "no_such_scene", "-o", "x.exr"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2 and done.stderr.count("\n") == 1


@pytest.mark.slow
def test_wheel_is_typed(tmp_path):
    """The wheel has py.typed above the annotated modules of all four folders."""
    pytest.importorskip("hatchling")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert {
        "mi_lcair/py.typed",
        "mi_lcair/plugins/integrators/bounce_path.py",
        "mi_lcair/fitting/estimation.py",
        "mi_lcair/scenes/cavity.xml",
    } <= {*names}


def test_public_names_resolve():
    assert set(mi_lcair.__all__) <= set(dir(mi_lcair))
    for name in mi_lcair.__all__:
        assert getattr(mi_lcair, name), name
    with pytest.raises(AttributeError, match="no attribute 'lode'"):
        _ = mi_lcair.lode
