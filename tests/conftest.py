import mi_lcair  # noqa: F401  before any test file imports drjit or mitsuba, so that they find the right LLVM
