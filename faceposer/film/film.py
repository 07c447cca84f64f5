"""Films as frames at a constant rate, whatever file or folder they are in."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.numbers import plain_float
from faceposer.files.sample_rates import nearest_known

#: Suffixes of films, for dialogs and for files dropped onto the window.
FILM_SUFFIXES = (
    *(".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi", ".mpg", ".mpeg", ".wmv", ".3gp", ".mts", ".m2ts", ".ts"),
    *(".flv", ".ogv", ".mxf", ".gif"),
)
#: Most frames of which a motion is made, and the fastest rate.
MOST_FRAMES, FASTEST = 10_000, 240.0
#: Largest time in a film, in seconds.
LONGEST_SECONDS = 1e6
#: Most pixels of a frame: 8K.
MOST_PIXELS = 8192 * 4608
# Share by which the mean rate of a film may differ from that of cameras for which it is taken.
_SAME_RATE = 0.01
# Rates of television that are no whole numbers, and the share by which they are missed in files that state them.
_FRACTIONS, _EXACT = (24000 / 1001, 30000 / 1001, 60000 / 1001), 1e-5


@dataclass(frozen=True, eq=False)
class FilmFrame:
    """A frame of a film.

    Attributes:
        number: Its place at the rate of the film, counted from 0.
        pixels: Colours, top row first, shape (h, w, 3).
    """

    number: int
    pixels: NDArray[np.uint8]


@dataclass(frozen=True)
class Span:
    """A part of a film.

    Attributes:
        start: Its beginning in seconds.
        end: Its end in seconds, or None for that of the film.
    """

    start: float = 0.0
    end: float | None = None

    def numbers(self, rate: float) -> tuple[int, float]:
        """Return the first frame, and the frame before which the part ends, at ``rate``."""
        first = round(self.start * rate)
        return first, float("inf") if self.end is None else max(round(self.end * rate), first + 1)


class Film(Protocol):
    """A film that can be read from the beginning any number of times."""

    @property
    def path(self) -> Path:
        """The file or folder."""
        ...

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of its upright frames in pixels."""
        ...

    @property
    def rate(self) -> float:
        """Frames per second."""
        ...

    @property
    def n_frames(self) -> int | None:
        """Number of frames as the file states it, or None."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed, one sentence each."""
        ...

    def frames(self, span: Span, largest: int) -> Iterator[FilmFrame]:
        """Yield the frames of a part, numbered from the beginning of the film, some numbers perhaps missing.

        Args:
            span: The part.
            largest: Longer side in pixels to which larger frames are reduced.

        Raises:
            FacePoserError: If a frame cannot be read.
        """
        ...


def seconds_of(text: str) -> float:
    """Return the time ``text`` in seconds: seconds, or hours and minutes before them, separated by colons.

    Raises:
        ValueError: If it is no such time.
    """
    try:
        parts = [plain_float(part.strip()) for part in text.split(":")]
    except ValueError:
        raise ValueError(text) from None
    if len(parts) > 3 or not all(0.0 <= part <= LONGEST_SECONDS for part in parts):
        raise ValueError(text)
    return sum(part * 60.0**power for power, part in enumerate(reversed(parts)))


def usual_rate(rate: float) -> float:
    """Return the rate of cameras near ``rate``, the mean of a film, or that if none is near, up to `FASTEST`."""
    exact = min(_FRACTIONS, key=lambda fraction: abs(fraction - rate))
    return exact if abs(exact - rate) < _EXACT * rate else min(nearest_known(rate, _SAME_RATE), FASTEST)


def reduced_size(size: tuple[int, int], largest: int) -> tuple[int, int]:
    """Return ``size`` reduced in proportion so that its longer side is at most ``largest``."""
    factor = min(largest / max(size), 1.0)
    return max(round(size[0] * factor), 1), max(round(size[1] * factor), 1)


def check_size(path: Path, size: tuple[int, int]) -> None:
    """Raise FacePoserError if frames of ``size`` are too large."""
    if size[0] * size[1] > MOST_PIXELS:
        raise FacePoserError(
            f"The film '{path}' has frames of {size[0]} x {size[1]} pixels, more than {MOST_PIXELS // 10**6} million; "
            "reduce their size."
        )


def check_span(film: Film, span: Span) -> None:
    """Raise FacePoserError if ``span`` is beyond the end of ``film`` or has too many frames, as far as is known."""
    first, last = span.numbers(film.rate)
    known = film.n_frames
    if known is not None:
        if first >= known:
            raise FacePoserError(
                f"The film '{film.path}' has {known / film.rate:.2f} seconds; choose a part that begins before its end."
            )
        last = min(last, known)
    if last - first > MOST_FRAMES and np.isfinite(last):
        raise too_long(film, int(last - first))


def too_long(film: Film, n_frames: int | None = None) -> FacePoserError:
    """Return the error of a film that has ``n_frames`` or, if None, more than can be used."""
    count = f"{n_frames:,}" if n_frames is not None else f"more than {MOST_FRAMES:,}"
    return FacePoserError(
        f"The film '{film.path}' has {count} frames, and at most {MOST_FRAMES:,} are used, "
        f"{MOST_FRAMES / film.rate:.0f} seconds; choose a shorter part."
    )
