"""The process behind `mutants.Worker`: python -m tests.fuzz.worker MODULE

Reads lines [kind, path] and answers each with a line [outcome, message], both in JSON.
"""

import importlib
import json
import os
import resource
import sys
from dataclasses import astuple
from pathlib import Path

from tests.fuzz.mutants import MEMORY, judge


def main(module: str) -> None:
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # what libraries print must not look like an answer
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    kinds = {kind.name: kind for kind in importlib.import_module(module).KINDS}
    answers.write(b"ready\n")
    for line in sys.stdin:
        name, path = json.loads(line)
        verdict = judge(kinds[name], Path(path))
        answers.write(json.dumps(astuple(verdict)).encode() + b"\n")


main(sys.argv[1])
