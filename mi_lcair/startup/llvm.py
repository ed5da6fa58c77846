"""LLVM for Dr.Jit: found and tried before `drjit` is imported, or replaced afterwards.

Dr.Jit opens the one library that DRJIT_LIBLLVM_PATH names, at its own import. With LLVM 15 and 16
it aborts the process at the first render, so each candidate is loaded and asked for its version
first. A Dr.Jit that was imported earlier and found an old LLVM is started again with a new one.
"""

import ctypes
import glob
import logging
import os
import re
import sys

OLDEST = 17
VARIABLE = "DRJIT_LIBLLVM_PATH"
WHEEL = "karellen-llvm-core"
# Dr.Jit's functions that end it, start it, and count the objects of a kind in its registry
FUNCTIONS = ("_Z12jit_shutdowni", "_Z8jit_initj", "_Z21jit_registry_id_boundPKcS0_")
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


def prepare():
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
            os.environ[VARIABLE] = path
            return
        rejected.append(f"{path}: {reason}")
        if path == os.environ.get(VARIABLE):
            logging.getLogger(__name__).warning("%s=%s is passed over: %s", VARIABLE, path, reason)
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
            f"needed{obstacle}: import mi_lcair first, or set {VARIABLE}"
        )


def _restart_drjit() -> str:
    """Shut Dr.Jit down and start it with another LLVM; otherwise, say what forbids it.

    Nothing happens if the library of Dr.Jit lacks the functions.
    """
    import drjit

    try:
        (path,) = glob.glob(os.path.join(drjit.__path__[0], "libdrjit-core.*"))
        shut_down, start, count = (ctypes.CDLL(path)[name] for name in FUNCTIONS)
    except (ValueError, OSError, AttributeError):
        return ""
    variants = sys.modules["mitsuba"].variants() if "mitsuba" in sys.modules else ()
    if any(count(variant.encode(), kind.encode()) for variant in variants for kind in OBJECTS):
        return ", and Mitsuba has created objects with it"
    prepare()
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
    if os.environ.get(VARIABLE):
        yield os.environ[VARIABLE]
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
