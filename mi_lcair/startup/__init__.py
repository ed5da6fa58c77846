"""What must be ready before Dr.Jit and Mitsuba are imported: LLVM, kernel cache, messages."""
