"""Scripts that write pages of docs/ or make long measurements.

Each is run as `python -m docs.studies.NAME`. They are in neither the wheel nor the tests.
"""

import mi_lcair  # imported before Mitsuba, so that Dr.Jit loads a suitable LLVM
