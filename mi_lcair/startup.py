"""What must be ready before Dr.Jit and Mitsuba are imported: LLVM, kernel cache, messages."""

import atexit
import ctypes
import glob
import logging
import os
import re
import shutil
import stat
import sys
import tempfile
from contextlib import suppress
from functools import wraps
from pathlib import Path

from mi_lcair.errors import InputError, printable

# Variants of Mitsuba that can render thermal scenes; the first is set if none is
VARIANTS = ("llvm_ad_mono", "cuda_ad_mono", "metal_ad_mono")

# The folder in which Dr.Jit keeps compiled kernels: tried before `drjit` is imported
# -----------------------------------------------------------------------------------
# Where a kernel cannot be written, Dr.Jit 1.5 reports it and tries again for ever, deaf to Ctrl-C.
# A folder without room is therefore replaced by one that has some, or the cache is switched off.
#
# Dr.Jit runs the kernels that it finds in the folder. Nobody else may therefore write there.

CACHE_VARIABLE = "DRJIT_CACHE_DIR"
OFF = os.devnull  # no folder: Dr.Jit then says that it keeps no kernels
ROOM = 2**26  # bytes that must be free; a large scene's kernels take a few million
HAS_OWNERS = os.name == "posix"  # whether files have owners and modes
PROBE = 2**20  # bytes written as a trial, which meet quotas and limits that the free space hides


def prepare_kernel_cache() -> None:
    """Name a folder for kernels to Dr.Jit in DRJIT_CACHE_DIR, where its own choice has no room.

    Candidates in order: the user's DRJIT_CACHE_DIR or ~/.drjit, and one in the system's temporary
    folder. The choice of another than the first is one logged line.
    """
    preferred = Path(os.environ.get(CACHE_VARIABLE) or Path.home() / ".drjit")
    reason = trouble(preferred)
    if reason is None:
        return
    replacement = _temporary()
    os.environ[CACHE_VARIABLE] = OFF if replacement is None else str(replacement)
    logging.getLogger(__name__).warning(
        "%s",
        printable(
            f"kernel cache {preferred}: {reason}; "
            + (
                "kernels are compiled anew in each run"
                if replacement is None
                else f"{replacement} is used instead"
            )
        ),
    )


def _temporary() -> Path | None:
    """A private folder among the temporary files; None if it has no room.

    Its name is the same in each run, so that kernels can be used again. Anybody may have made a
    folder or a link of that name before. One that is not private is passed over, and a new folder
    serves until the process ends.
    """
    folder = Path(tempfile.gettempdir()) / f"drjit-{os.getuid() if HAS_OWNERS else ''}"
    try:
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        if not _is_private(folder):
            folder = Path(tempfile.mkdtemp(prefix=f"{folder.name}-"))
            atexit.register(shutil.rmtree, folder, ignore_errors=True)
    except OSError:
        return None
    return folder if trouble(folder) is None else None


def _is_private(folder: Path) -> bool:
    """Whether a path is a folder, no link, that belongs to the user and is closed to others."""
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode):
        return False
    return not HAS_OWNERS or (
        status.st_uid == os.getuid() and stat.S_IMODE(status.st_mode) == 0o700
    )


def trouble(folder: Path) -> str | None:
    """Why kernels cannot be kept in a folder, or None; the folder is made if it is absent."""
    probe = folder / f".{os.getpid()}.probe"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if HAS_OWNERS:
            status = folder.stat()
            if status.st_uid not in (os.getuid(), 0):
                return "it belongs to another user, and its kernels are run"
            for mode, who in ((stat.S_IWOTH, "all users"), (stat.S_IWGRP, "others of its group")):
                if status.st_mode & mode:
                    return f"{who} may write there, and its kernels are run; chmod go-w {folder}"
        free = shutil.disk_usage(folder).free
        if free < ROOM:
            return f"only {free / 2**20:.0f} MB are free, {ROOM >> 20} MB are needed"
        try:
            probe.write_bytes(bytes(PROBE))
        finally:
            probe.unlink(missing_ok=True)
    except OSError as error:
        return error.strerror or type(error).__name__
    return None


# LLVM for Dr.Jit: found and tried before `drjit` is imported, or replaced afterwards
# -----------------------------------------------------------------------------------
# Dr.Jit opens the one library that DRJIT_LIBLLVM_PATH names, at its own import. With LLVM 15 and 16
# it aborts the process at the first render, so each candidate is loaded and asked for its version
# first. A Dr.Jit that was imported earlier and found an old LLVM is started again with a new one.

OLDEST = 17
LLVM_VARIABLE = "DRJIT_LIBLLVM_PATH"
WHEEL = "karellen-llvm-core"
# Dr.Jit's functions that end it, start it, and count the objects of a kind in its registry
LLVM_FUNCTIONS = ("_Z12jit_shutdowni", "_Z8jit_initj", "_Z21jit_registry_id_boundPKcS0_")
BACKENDS = 0b110  # Dr.Jit's bits of CUDA and LLVM, with which it starts at its import
# Kinds of Mitsuba's objects that Dr.Jit numbers in its registry
OBJECTS = (
    *("BSDF", "Emitter", "Film", "Integrator", "Medium", "Mesh", "PhaseFunction"),
    *("ReconstructionFilter", "Sampler", "Sensor", "Shape", "Texture", "Volume"),
)
SYSTEM = (
    "/usr/lib/*-linux-gnu/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM.dylib",
    "C:/Program Files/LLVM/bin/LLVM-C.dll",
)
INSTALL = {
    "linux": f"pip install '{WHEEL}<24', or on Debian: apt-get install libllvm19",
    "darwin": "brew install llvm",
    "win32": "the LLVM release from llvm.org",
}


def prepare_llvm():
    """Load the first LLVM that is new enough and name it to Dr.Jit in DRJIT_LIBLLVM_PATH.

    Candidates in order: the user's DRJIT_LIBLLVM_PATH, the wheel karellen-llvm-core, the system's
    libraries. A variable that cannot be used is reported in one logged line and passed over.

    Raises ImportError, one line that says what to install, if there is no such LLVM or libatomic is
    missing.
    """
    if sys.platform == "linux":
        _require_libatomic()
    rejected = []
    for path in _candidates():
        reason = _rejection(path)
        if reason is None:
            os.environ[LLVM_VARIABLE] = path
            return
        rejected.append(f"{path}: {reason}")
        if path == os.environ.get(LLVM_VARIABLE):
            logging.getLogger(__name__).warning(
                "%s=%s is passed over: %s", LLVM_VARIABLE, path, reason
            )
    tried = f" (tried {'; '.join(rejected)})" if rejected else ""
    raise ImportError(
        f"no LLVM {OLDEST} or newer found{tried}; install one: {INSTALL.get(sys.platform, 'LLVM')}"
    )


def prepare_loaded():
    """Give an already imported Dr.Jit an LLVM that is new enough, if it has none.

    Dr.Jit is shut down and started again by the C functions that do this at its import and at the
    end of the process. Its arrays stay valid. Mitsuba's objects do not, because they lose their
    numbers in Dr.Jit's registry.

    Raises ImportError, one line, if objects of Mitsuba exist, or if Dr.Jit found no library of LLVM
    at all: it looks for one only once in a process.
    """
    import drjit

    version = drjit.detail.llvm_version()[0]  # -1 if it has none
    if version >= OLDEST:
        return
    obstacle = _restart_drjit()
    if drjit.detail.llvm_version()[0] < OLDEST:
        library = f"LLVM {version}" if version > 0 else "no LLVM"
        raise ImportError(
            f"drjit was imported before mi_lcair and found {library}, where {OLDEST} or newer is "
            f"needed{obstacle}: import mi_lcair first, or set {LLVM_VARIABLE}"
        )


def _restart_drjit() -> str:
    """Shut Dr.Jit down and start it with another LLVM; otherwise, say what forbids it.

    Nothing happens if the library of Dr.Jit lacks the functions.
    """
    import drjit

    try:
        (path,) = glob.glob(os.path.join(drjit.__path__[0], "libdrjit-core.*"))
        shut_down, start, count = (ctypes.CDLL(path)[name] for name in LLVM_FUNCTIONS)
    except (ValueError, OSError, AttributeError):
        return ""
    variants = sys.modules["mitsuba"].variants() if "mitsuba" in sys.modules else ()
    if any(count(variant.encode(), kind.encode()) for variant in variants for kind in OBJECTS):
        return ", and Mitsuba has created objects with it"
    prepare_llvm()
    shut_down(0)
    start(BACKENDS)
    return ""


def _require_libatomic():
    try:
        ctypes.CDLL("libatomic.so.1")
    except OSError:
        raise ImportError(
            "libatomic.so.1 is missing, Dr.Jit needs it; "
            "install it, on Debian: apt-get install libatomic1"
        ) from None


def _candidates():
    """Paths of LLVM libraries, the preferred one first; each is searched only when needed."""
    if os.environ.get(LLVM_VARIABLE):
        yield os.environ[LLVM_VARIABLE]
    yield from _in_wheel()
    libraries = {os.path.realpath(path) for pattern in SYSTEM for path in glob.glob(pattern)}
    yield from sorted(
        libraries,
        key=lambda path: [int(digits) for digits in re.findall(r"\d+", path)],
        reverse=True,
    )


def _in_wheel():
    import importlib.metadata  # 50 ms, not needed where the user names a library

    try:
        files = importlib.metadata.files(WHEEL) or ()
    except importlib.metadata.PackageNotFoundError:
        return set()
    # Listed are one file and links to it; `pip install --target` leaves the file out, it is then
    # refused like any other.
    return {os.path.realpath(file.locate()) for file in files if file.name.startswith("libLLVM")}


def _rejection(path):
    """Reason why the library at `path` cannot be used; None if it can, and it stays loaded."""
    # The wheel links its own C++ runtime only where its start-up hook may write, so that is loaded
    # by its full name. Not with RTLD_GLOBAL: its libc++abi would then take Mitsuba's exceptions and
    # end the process.
    runtime = os.path.join(os.path.dirname(os.path.realpath(path)), "x86_64-unknown-linux-gnu")
    try:
        for name in ("libunwind", "libc++abi", "libc++"):
            if os.path.exists(library := os.path.join(runtime, f"{name}.so.1.0")):
                ctypes.CDLL(library)
        library = ctypes.CDLL(path)
    except OSError as error:
        return str(error)
    if not hasattr(library, "LLVMGetVersion"):
        return f"older than LLVM {OLDEST}"  # the call came with LLVM 16
    major = ctypes.c_uint()
    library.LLVMGetVersion(ctypes.byref(major), None, None)
    return None if major.value >= OLDEST else f"LLVM {major.value}, older than {OLDEST}"


# What is changed in Mitsuba when it has been imported: two functions, its log, and one thread
# --------------------------------------------------------------------------------------------
# `mi.render` and `mi.traverse` take what `mi_lcair.load` returns. Mitsuba's functions take objects
# of its own classes only. `mi.render` asserts the class and passes the scene on to C++, so that no
# class written in Python can stand for it. Both functions are therefore replaced by ones that pass
# on the `mi` of a loaded scene, and anything else as it is.
#
# Log messages go to Python's logging, so that stdout has only results.
#
# On one core Mitsuba's OpenEXR waits forever for the lines of a picture, so that Dr.Jit gets a
# second thread there.

FUNCTIONS = ("render", "traverse")
THREADS = Path("/proc/self/task")  # Linux lists the threads of this process here


def take_loaded_scenes() -> None:
    """Let `mi.render` and `mi.traverse` take a `Scene`, in all variants."""
    import mitsuba as mi

    for name in FUNCTIONS:
        function = _with_scene(getattr(mi.util, name))
        setattr(mi.util, name, function)
        setattr(mi, name, function)


def _with_scene(function):
    """The function that gets the `mi` of each argument that has one, in the argument's place."""

    def of(value):
        return getattr(value, "mi", value)

    @wraps(function)
    def taking_scene(*arguments, **options):
        options = {name: of(value) for name, value in options.items()}
        return function(*map(of, arguments), **options)

    return taking_scene


# "2026-01-31 12:00:00 WARN  main  [PLYMesh] " before the text of a message
PREFIX = re.compile(r"^\S+ \S+ +[A-Z]+ +(\S+ +)?\[[^]]*\] *")


def check_variant(suited) -> None:
    """Raise InputError unless `suited`, a function of its name, is true of Mitsuba's variant."""
    import mitsuba as mi

    if not suited(mi.variant()):
        raise InputError(
            f"variant {mi.variant()} cannot render thermal scenes; set one of {', '.join(VARIANTS)}"
        )


def log_to_python() -> None:
    """Send Mitsuba's messages to the logger "mitsuba" of Python's logging, and nowhere else.

    Warnings then appear on stderr, unless the program configures logging.
    """
    import mitsuba as mi

    levels = {
        mi.LogLevel.Trace: logging.DEBUG,
        mi.LogLevel.Debug: logging.DEBUG,
        mi.LogLevel.Info: logging.INFO,
        mi.LogLevel.Warn: logging.WARNING,
        mi.LogLevel.Error: logging.ERROR,
    }
    log = logging.getLogger("mitsuba")

    class PythonLogging(mi.Appender):
        def append(self, level, text):
            log.log(levels[level], "%s", printable(PREFIX.sub("", text)))

        def log_progress(self, *_):
            pass  # the commands draw their own bars

    mi.logger().clear_appenders()
    mi.logger().add_appender(PythonLogging())


def avoid_one_thread() -> None:
    """Let Dr.Jit have two threads, even on one core.

    After each kernel a thread of Dr.Jit asks for more work for 20 ms, without sleep. On one core it
    would take every second moment of the program then. Its priority there is the lowest.
    """
    import drjit

    if drjit.thread_count() > 1:
        return
    before = {*THREADS.glob("*")}
    drjit.set_thread_count(2)
    for thread in {*THREADS.glob("*")} - before:
        os.setpriority(os.PRIO_PROCESS, int(thread.name), 19)
