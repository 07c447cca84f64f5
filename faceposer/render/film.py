"""Films in files, drawn frame by frame and written atomically: GIF, and MP4 through the program ffmpeg."""

import subprocess
import tempfile
from collections.abc import Callable, Generator
from contextlib import suppress
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.errors import FacePoserError
from faceposer.files.atomic import atomic_file
from faceposer.render.ffmpeg import find_ffmpeg
from faceposer.render.images import reduced, shared_palette, write_reduced

Picture = NDArray[np.uint8]
#: Draws the frame of this number, shape (height, width, 3).
Draw = Callable[[int], Picture]

#: Delays of GIF are hundredths of a second, and browsers show less than two of them as ten.
FASTEST_GIF = 50.0
# Hundredths of a second, which GIF keeps in 16 bits.
_LONGEST_DELAY = 65535
_GIF_COLOURS = 255
_SHOWN_OF_LOG = 200


def write_gif(path: Path, draw: Draw, count: int, rate: float) -> Generator[float, None, None]:
    """Write ``count`` frames as an endless GIF, and tell after each which share is done.

    Frames last whole hundredths of a second such that all of them together take the time that they should.

    Raises:
        FacePoserError: If the file cannot be written, or frames would last longer than a GIF can say.
    """
    ends = np.round(100.0 * np.arange(count + 1) / rate).astype(int)
    if np.diff(ends).max() > _LONGEST_DELAY:
        raise FacePoserError(
            f"A GIF shows a frame for {_LONGEST_DELAY / 100:.0f} seconds at most, and {rate:g} frames a second take "
            "longer; choose a higher rate."
        )
    places = sorted({0, count // 4, count // 2, count - 1})
    palette = shared_palette([Image.fromarray(draw(i)) for i in places], _GIF_COLOURS, keep_rare=True)
    pictures = []
    for i in range(count):
        pictures.append(reduced(Image.fromarray(draw(i)), palette))
        yield (i + 1) / (count + 1)
    write_reduced(path, pictures, (10 * np.diff(ends)).tolist())


def write_mp4(path: Path, draw: Draw, count: int, rate: float, size: tuple[int, int]) -> Generator[float, None, None]:
    """Write ``count`` frames of ``size``, both even, as MP4, and tell after each which share is done.

    Raises:
        FacePoserError: If there is no ffmpeg, or it cannot write the file, with what it says.
    """
    program = find_ffmpeg()
    taken = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", f"{rate:.6g}", "-i", "-"]
    made = ["-an", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"]
    with atomic_file(path, "film") as temporary, tempfile.TemporaryFile() as log:
        process = subprocess.Popen(
            [program, "-y", "-loglevel", "error", *taken, *made, str(temporary)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=log,
        )
        assert process.stdin is not None
        try:
            for i in range(count):
                process.stdin.write(draw(i).tobytes())
                yield (i + 1) / (count + 1)
            process.stdin.close()
            if process.wait() != 0:
                raise _failure(path, log)
        except BrokenPipeError as error:
            process.wait()
            raise _failure(path, log) from error
        finally:
            # Closing sends what waits, which nobody may want any more.
            with suppress(OSError):
                process.stdin.close()
            if process.poll() is None:
                process.kill()
                process.wait()


def _failure(path: Path, log: IO[bytes]) -> FacePoserError:
    log.seek(0)
    said = " ".join(log.read().decode("utf-8", "replace").split())[-_SHOWN_OF_LOG:] or "it gives no reason"
    return FacePoserError(f"The film '{path}' cannot be written by ffmpeg ({said}); write a .gif instead.")
