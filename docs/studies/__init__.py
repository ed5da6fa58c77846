"""Studies: scripts that write pages of docs/ or measure at length, each run as `python -m docs.studies.NAME`.

They are in neither the wheel nor the tests.
"""

import mi_lcair  # before Mitsuba, so that Dr.Jit finds an LLVM that it can use
