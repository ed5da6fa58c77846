"""Benchmarks for asv, which follow the renderer's performance from commit to commit.

Each figure is a count, a size or a ratio of two times of one process, so that it depends little on
the machine. CONTRIBUTING.md says how to run them.
"""

import mi_lcair  # imported before Mitsuba, so that Dr.Jit loads a suitable LLVM
