"""Values of the options of ``faceposer evaluate``; each function raises ArgumentTypeError with one sentence."""

import argparse
from pathlib import Path

from faceposer.cli.arguments import number, whole_number

#: Least number of examples from which all techniques can learn.
MIN_EXAMPLES = 200
#: Kinds of constraints that a study samples.
KINDS = ("point", "distance", "stroke")
#: Largest number of trials, constraints or examples, and largest seed.
MAX_COUNT = 100_000

Counts = tuple[str, tuple[int, ...]]


def performer(text: str) -> tuple[str, tuple[Path, ...]]:
    """Return name and takes of a performer from ``NAME=CSV,CSV``."""
    name, equals, files = text.partition("=")
    paths = tuple(dict.fromkeys(Path(file.strip()) for file in files.split(",") if file.strip()))
    if not equals or not name.strip() or not paths:
        raise argparse.ArgumentTypeError(f"'{text}' must have the form NAME=CSV,CSV, for example anna=one.csv,two.csv")
    return name.strip(), paths


def names(text: str) -> tuple[str, ...]:
    """Return the names in a list that is separated by commas."""
    found = tuple(name for name in (part.strip() for part in text.split(",")) if name)
    if not found:
        raise argparse.ArgumentTypeError("give at least one name; separate several by commas")
    return found


def kinds(text: str) -> tuple[str, ...]:
    """Return the distinct kinds of constraints in a list."""
    for name in names(text):
        kind_of_constraint(name)
    return tuple(dict.fromkeys(names(text)))


def kind_of_constraint(name: str) -> str:
    """Return ``name`` if it is a kind of constraint."""
    if name not in KINDS:
        raise argparse.ArgumentTypeError(f"'{name}' is not a kind of constraint; choose from {', '.join(KINDS)}")
    return name


def count(text: str) -> int:
    """Return a number from 1 to ``MAX_COUNT``."""
    return _between(text, 1)


def examples(text: str) -> int:
    """Return a number of examples, from ``MIN_EXAMPLES`` to ``MAX_COUNT``."""
    return _between(text, MIN_EXAMPLES)


def _between(text: str, least: int) -> int:
    found = whole_number(text, least, MAX_COUNT)
    if found is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from {least} to {MAX_COUNT}")
    return found


def counts(text: str) -> Counts:
    """Return a kind with its numbers from ``KIND=N,N``."""
    kind, equals, numbers = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"'{text}' must have the form KIND=N,N, for example point=1,4")
    return kind_of_constraint(kind.strip()), tuple(
        dict.fromkeys(count(part.strip()) for part in numbers.split(",") if part.strip())
    )


def trials(text: str) -> tuple[str | None, int]:
    """Return the number of trials of a kind, or of all kinds (None), from ``KIND=N`` or ``N``."""
    kind, equals, number = text.rpartition("=")
    return (kind_of_constraint(kind.strip()) if equals else None, count(number.strip()))


def seeds(text: str) -> tuple[int, ...]:
    """Return the distinct seeds in a list."""
    texts = names(text)
    for seed in texts:
        if whole_number(seed, 0, MAX_COUNT) is None:
            raise argparse.ArgumentTypeError(f"'{seed}' is not a seed, a number from 0 to {MAX_COUNT}")
    return tuple(dict.fromkeys(int(seed) for seed in texts))


def noises(text: str) -> tuple[float, ...]:
    """Return the distinct noises in a list, in pixels from 0 to 100."""
    found = []
    for part in names(text):
        noise = number(part)
        if not 0.0 <= noise <= 100.0:
            raise argparse.ArgumentTypeError(f"'{part}' is not a number of pixels from 0 to 100")
        found.append(noise)
    return tuple(dict.fromkeys(found))
