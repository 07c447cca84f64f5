"""Video files, rendered frame by frame and written atomically: GIF, and MP4 by the program ffmpeg."""

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
from faceposer.render.images import shared_palette, with_palette, write_palette_images

Pixels = NDArray[np.uint8]
#: Function that renders the frame with the given index, shape (height, width, 3).
RenderFrame = Callable[[int], Pixels]

#: Highest frame rate: GIF delays are hundredths of a second, and browsers show a delay of 1 as 10.
MAX_GIF_RATE = 50.0
# Longest delay in hundredths of a second, which GIF stores in 16 bits.
_LONGEST_DELAY = 65535
_GIF_COLOURS = 255
# Number of characters of ffmpeg's log that a message quotes.
_QUOTED_LOG = 200


def write_gif(path: Path, render: RenderFrame, count: int, rate: float) -> Generator[float, None, None]:
    """Write ``count`` frames as an endless GIF, yielding the completed share after each.

    Delays are rounded to hundredths of a second such that the total duration is kept.

    Raises:
        FacePoserError: If the file cannot be written, or frames would last longer than GIF can store.
    """
    ends = np.round(100.0 * np.arange(count + 1) / rate).astype(int)
    if np.diff(ends).max() > _LONGEST_DELAY:
        raise FacePoserError(
            f"A GIF shows a frame for {_LONGEST_DELAY / 100:.0f} seconds at most, which {rate:g} frames per second "
            "exceed; choose a higher rate."
        )
    samples = sorted({0, count // 4, count // 2, count - 1})
    palette = shared_palette([Image.fromarray(render(i)) for i in samples], _GIF_COLOURS, keep_rare=True)
    images = []
    for i in range(count):
        images.append(with_palette(Image.fromarray(render(i)), palette))
        yield (i + 1) / (count + 1)
    write_palette_images(path, images, (10 * np.diff(ends)).tolist())


def write_mp4(
    path: Path, render: RenderFrame, count: int, rate: float, size: tuple[int, int]
) -> Generator[float, None, None]:
    """Write ``count`` frames of ``size``, two even numbers, as MP4, yielding the completed share after each.

    Raises:
        FacePoserError: If there is no ffmpeg, or it cannot write the file; the message quotes its log.
    """
    program = find_ffmpeg()
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", f"{rate:.6g}", "-i", "-"]
    target = ["-an", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"]
    with atomic_file(path, "video") as temporary, tempfile.TemporaryFile() as log:
        # Fails with the reason of the system, unlike ffmpeg, where no file can be created.
        temporary.touch()
        process = subprocess.Popen(
            [program, "-y", "-loglevel", "error", *source, *target, str(temporary)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=log,
        )
        assert process.stdin is not None
        try:
            for i in range(count):
                process.stdin.write(render(i).tobytes())
                yield (i + 1) / (count + 1)
            process.stdin.close()
            if process.wait() != 0:
                raise _failure(path, temporary, log)
        except BrokenPipeError as error:
            process.wait()
            raise _failure(path, temporary, log) from error
        finally:
            # Closing flushes the buffer, which fails if ffmpeg has ended.
            with suppress(OSError):
                process.stdin.close()
            if process.poll() is None:
                process.kill()
                process.wait()


def _failure(path: Path, temporary: Path, log: IO[bytes]) -> FacePoserError:
    log.seek(0)
    text = " ".join(log.read().decode("utf-8", "replace").replace(str(temporary), str(path)).split())
    reason = text[-_QUOTED_LOG:] or "no reason given"
    return FacePoserError(f"ffmpeg cannot write the video '{path}' ({reason}); write a .gif instead.")
