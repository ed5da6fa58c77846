"""Mutants of input files, and what a use of each one ends in.

`Kind` describes one kind of file: sound examples, the words of its language, and the function that
uses it. `mutants` changes an example at random, the same way for the same seed. `Worker` uses
mutants in a process of its own, because a library may end the process or never return. A mutant is
handled right if it is accepted or refused by one line.

To add a kind, add an entry to `KINDS` in tests/fuzz/kinds.py.
"""

import json
import random
import re
import select
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from mi_lcair.errors import InputError

GENTLE = 0.8  # share of mutations that exchange one value, for kinds that say what a value is
LONGEST_LINE = 1000  # characters of a refusal
MEMORY = 12 * 2**30  # bytes of address space of a worker
TRICKY_NUMBERS = (
    b"0 -1 1.5 nan inf -inf 1e39 1e-320 1e308 -0.0 4294967296 9223372036854775808 "
    b"1,5 0x10 \xd9\xa3 1_0"
).split()
TRICKY_TEXT = (
    b"",
    b"\x00",
    b"\x1b[31m",
    b"\xff",
    b"\xef\xbb\xbf",
    b"\r",
    b"\n",
    b"\xe2\x80\xa8",
    b"\xc3\xa9",
    b"$x",
    b"../..",
    b"/dev/zero",
    b"A" * 5000,
)
NUMBER = re.compile(rb"(?<![\w.])[+-]?\d+\.?\d*(?:[eE][+-]?\d+)?(?![\w.])")


@dataclass(frozen=True)
class Kind:
    """One kind of file.

    name: in reports; suffix: of the file's name; examples: contents of sound files, each non-empty;
    use: what a user does with such a file, given its path, raises InputError to refuse it and
    returns whatever; words: pieces of the file's language that mutations insert; beside: other
    files, name to content, that must lie in the same folder; may_die: whether only a process of its
    own may use it. value: pattern of a single value of the language, so that most mutations
    change nothing but a value and leave a file that can still be parsed.
    """

    name: str
    suffix: str
    examples: tuple[bytes, ...]
    use: Callable[[Path], object]
    words: tuple[bytes, ...] = ()
    beside: dict[str, bytes] | None = None
    may_die: bool = False
    value: re.Pattern | None = None


@dataclass(frozen=True)
class Verdict:
    """What a use of a file ended in.

    outcome: "accepted", "refused" (InputError of one printable line), "failed" (any other exception
    or an ill-formed line), "died" (the process ended) or "hung" (the time limit passed); message:
    its text.
    """

    outcome: str
    message: str = ""

    @property
    def is_right(self) -> bool:
        return self.outcome in ("accepted", "refused")


def mutants(kind: Kind, count: int, seed: int = 0) -> Iterator[bytes]:
    """`count` changed contents of a kind of file, each by one to four mutations of an example."""
    chance = random.Random(f"{kind.name} {seed}")
    for _ in range(count):
        content = chance.choice(kind.examples)
        for _ in range(chance.choice((1, 1, 1, 2, 4))):
            if kind.value and chance.random() < GENTLE:
                content = exchange_value(content, kind, chance)
            else:
                content = chance.choice(MUTATIONS)(content, kind.words, chance)
        yield content


def judge(kind: Kind, path: Path) -> Verdict:
    """The Verdict of using a file in this process."""
    try:
        kind.use(path)
    except InputError as error:
        return judge_line(str(error))
    except Exception as error:
        return Verdict("failed", f"{type(error).__name__}: {error}")
    return Verdict("accepted")


def judge_line(line: str) -> Verdict:
    """The Verdict of a refusal: whether its text is one printable line of bearable length."""
    if not line.isprintable():
        return Verdict("failed", f"the refusal is not one printable line: {line!r}")
    if len(line) > LONGEST_LINE:
        return Verdict("failed", f"the refusal has {len(line)} characters: {line[:200]}")
    return Verdict("refused", line)


class Worker:
    """Uses files in a process of its own, which is started again after one that died or hung.

    module: name of the module whose `KINDS` are used; seconds: time limit of one file.
    """

    def __init__(self, module: str = "tests.fuzz.kinds", seconds: float = 300.0):
        self.module, self.seconds, self.process = module, seconds, None

    def judge(self, kind: Kind, path: Path) -> Verdict:
        """The Verdict of using a file of a kind."""
        if self.process is None:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "tests.fuzz.worker", self.module],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                cwd=Path(__file__).parents[2],
            )
            self.answer(self.seconds)  # the first line says that the libraries are loaded
        self.process.stdin.write(json.dumps([kind.name, str(path)]).encode() + b"\n")
        self.process.stdin.flush()
        answer = self.answer(self.seconds)
        if isinstance(answer, bytes):
            return Verdict(*json.loads(answer))
        self.close()
        return answer

    def answer(self, seconds: float):
        """The next line of the process, or the Verdict that there will be none."""
        ready, _, _ = select.select([self.process.stdout], [], [], seconds)
        if not ready:
            return Verdict("hung", f"no answer within {seconds:g} s")
        line = self.process.stdout.readline()
        if line:
            return line
        return Verdict("died", f"the process ended with status {self.process.wait()}")

    def close(self) -> None:
        """Ends the process."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process.stdin.close()
            self.process.stdout.close()
            self.process = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def campaign(kind: Kind, folder: Path, count: int, seed: int = 0, worker: Worker | None = None):
    """Uses `count` mutants of a kind, written to a folder; yields (mutant, Verdict) for each.

    worker: the process for kinds that may end theirs; others are used in this one.
    """
    for name, content in (kind.beside or {}).items():
        (folder / name).write_bytes(content)
    path = folder / f"mutant{kind.suffix}"
    for content in mutants(kind, count, seed):
        path.write_bytes(content)
        yield content, worker.judge(kind, path) if kind.may_die else judge(kind, path)


# ---------------------------------------------------------------- Mutations


def cut(content, words, chance):
    begin, end = span(content, chance)
    return content[:begin] + content[end:]


def double(content, words, chance):
    begin, end = span(content, chance)
    return content[:end] + content[begin:end] + content[end:]


def truncate(content, words, chance):
    return content[: chance.randrange(len(content) + 1)]


def flip_bit(content, words, chance):
    if not content:
        return content
    at = chance.randrange(len(content))
    return content[:at] + bytes([content[at] ^ 1 << chance.randrange(8)]) + content[at + 1 :]


def overwrite(content, words, chance):
    """Random bytes, as many as a number has, in place of as many others."""
    at = chance.randrange(len(content) + 1)
    piece = chance.choice((b"\0" * 4, b"\xff" * 4, chance.randbytes(4)))
    return content[:at] + piece + content[at + len(piece) :]


def insert_word(content, words, chance):
    at = chance.randrange(len(content) + 1)
    return content[:at] + chance.choice((*words, *TRICKY_TEXT)) + content[at:]


def replace_number(content, words, chance):
    return replace(NUMBER, TRICKY_NUMBERS, content, chance)


def replace_word(content, words, chance):
    return replace(re.compile(rb"\w+"), (*words, *TRICKY_TEXT), content, chance)


def replace(pattern, choices, content, chance):
    found = list(pattern.finditer(content))
    if not found:
        return content
    place = chance.choice(found)
    return content[: place.start()] + chance.choice(choices) + content[place.end() :]


def exchange_value(content, kind, chance):
    """Another value of the same file, a word or a number in place of one value."""
    values = [match[0] for match in kind.value.finditer(content)]
    return replace(kind.value, (*values, *kind.words, *TRICKY_NUMBERS), content, chance)


def swap_lines(content, words, chance):
    lines = content.splitlines(keepends=True)
    if len(lines) > 1:
        a, b = chance.sample(range(len(lines)), 2)
        lines[a], lines[b] = lines[b], lines[a]
    return b"".join(lines)


def drop_line(content, words, chance):
    lines = content.splitlines(keepends=True)
    if lines:
        del lines[chance.randrange(len(lines))]
    return b"".join(lines)


def repeat_line(content, words, chance):
    lines = content.splitlines(keepends=True)
    if lines:
        at = chance.randrange(len(lines))
        lines[at : at + 1] = [lines[at]] * chance.choice((2, 3, 200))
    return b"".join(lines)


def span(content, chance):
    begin = chance.randrange(len(content) + 1)
    return begin, min(len(content), begin + chance.randrange(1, 40))


MUTATIONS = (
    cut,
    double,
    truncate,
    flip_bit,
    overwrite,
    insert_word,
    replace_number,
    replace_number,
    replace_word,
    replace_word,
    swap_lines,
    drop_line,
    repeat_line,
)
