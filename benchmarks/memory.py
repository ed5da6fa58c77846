"""Largest memory of a run."""

import ctypes
import re
from collections.abc import Callable
from pathlib import Path

import drjit as dr
import numpy as np

PROCESS = Path("/proc/self")
MB, PAGE = 1e6, 4096.0  # bytes


def peak_memory(run: Callable, *arguments) -> float:
    """Largest memory of this process during a run beyond that before it, MB.

    It is the resident memory, which Linux counts in pages of 4 kB. Memory that Dr.Jit and
    the C library keep for later arrays is released before. NaN on other systems.
    """
    dr.sync_thread()
    dr.flush_malloc_cache()
    try:
        ctypes.CDLL(None).malloc_trim(0)  # glibc keeps pages of arrays that are freed
        (PROCESS / "clear_refs").write_text("5")  # sets the largest memory to the present one
        before = resident("VmRSS")
        run(*arguments)
        dr.sync_thread()
        return max(resident("VmHWM") - before, PAGE) / MB
    except (OSError, AttributeError):
        return np.nan


def resident(name: str) -> float:
    """An entry of the process's status in bytes: VmRSS, the present memory, or VmHWM."""
    entry = re.search(rf"{name}:\s+(\d+) kB", (PROCESS / "status").read_text())
    return 1024.0 * int(entry[1])
