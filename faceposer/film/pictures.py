"""Films without a video codec: folders of pictures, and animated GIFs."""

import re
import warnings
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from faceposer.errors import FacePoserError
from faceposer.files.images import open_image
from faceposer.files.paths import can_enter, files_in
from faceposer.files.reading import open_file
from faceposer.files.sample_rates import USUAL_RATE
from faceposer.film.film import FilmFrame, Span, check_size, reduced_size, usual_rate
from faceposer.geometry.texture_images import DECODER_ERRORS
from faceposer.photo.reading import PHOTO_SUFFIXES, inspect_photo, read_photo

# Seconds for which a frame of a GIF is shown that states none, as browsers do.
_UNSTATED = 0.1
_MOST_BYTES = 1 << 30


class PictureFolder:
    """The pictures of a folder in the order of the numbers in their names, one for each frame."""

    def __init__(self, path: Path, rate: float | None = None) -> None:
        """Find the pictures in ``path``, at ``rate`` per second.

        Raises:
            FacePoserError: If there are none, or the first cannot be read.
        """
        self.path = path
        if not can_enter(path):
            raise FacePoserError(f"The folder '{path}' cannot be read; change its permissions.")
        self._files = sorted(files_in(path, *PHOTO_SUFFIXES), key=_in_order)
        if not self._files:
            raise FacePoserError(
                f"The folder '{path}' has no pictures; give a folder of JPEG or PNG files, one for each frame."
            )
        self.size = inspect_photo(self._files[0]).size
        self.rate = USUAL_RATE if rate is None else rate
        assumed = f"A folder of pictures has no rate; {USUAL_RATE:g} frames per second were assumed."
        self.notes: tuple[str, ...] = () if rate is not None else (assumed,)

    @property
    def n_frames(self) -> int:
        """Number of pictures."""
        return len(self._files)

    def frames(self, span: Span, largest: int) -> Iterator[FilmFrame]:
        """Yield the frames of a part; see ``Film``."""
        first, last = span.numbers(self.rate)
        size: tuple[int, int] | None = None
        for number, file in enumerate(self._files):
            if not first <= number < last:
                continue
            pixels = read_photo(file, largest)
            found = (pixels.shape[1], pixels.shape[0])
            size = size or found
            if found != size:
                raise FacePoserError(
                    f"The picture '{file}' has another size than those before it; give pictures of one size."
                )
            yield FilmFrame(number, pixels)


class AnimatedImage:
    """An animated GIF, whose frames are shown for times of their own."""

    def __init__(self, path: Path, rate: float | None = None) -> None:
        """Read the times of the frames of ``path``, to sample them at ``rate``.

        Raises:
            FacePoserError: If it cannot be read.
        """
        self.path = path
        with _Opened(path) as image:
            self.size = (image.width, image.height)
            check_size(path, self.size)
            count = int(getattr(image, "n_frames", 1))
            seconds = []
            for k in range(count):
                image.seek(k)
                seconds.append(float(image.info.get("duration") or 0.0) / 1000.0 or _UNSTATED)
        self._times = np.concatenate([[0.0], np.cumsum(seconds)])
        self.rate = usual_rate(1.0 / float(np.median(seconds))) if rate is None else rate
        self.notes: tuple[str, ...] = ()

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return max(round(float(self._times[-1]) * self.rate), 1)

    def frames(self, span: Span, largest: int) -> Iterator[FilmFrame]:
        """Yield the frames of a part; see ``Film``."""
        first, last = span.numbers(self.rate)
        ends = [round(time * self.rate) for time in self._times.tolist()]
        ends[-1] = max(ends[-1], 1)
        with _Opened(self.path) as image:
            for k, (begin, end) in enumerate(pairwise(ends)):
                # A picture is shown until the next one.
                numbers = range(max(begin, first), int(min(end, last)))
                if not numbers:
                    continue
                image.seek(k)
                picture = image.convert("RGB").resize(reduced_size(self.size, largest), Image.Resampling.LANCZOS)
                pixels = np.ascontiguousarray(np.asarray(picture, dtype=np.uint8))
                yield from (FilmFrame(number, pixels) for number in numbers)


class _Opened:
    """An image that is open; its errors are reported as ``FacePoserError``."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> Image.Image:
        try:
            self._file = open_file(self._path, _MOST_BYTES)
        except FileNotFoundError as error:
            raise FacePoserError(f"There is no film '{self._path}'; check the path.") from error
        except OSError as error:
            raise FacePoserError(f"The film '{self._path}' cannot be read: {error.strerror}.") from error
        try:
            with warnings.catch_warnings():
                # Pillow's warning has another limit than ours.
                warnings.simplefilter("ignore", Image.DecompressionBombWarning)
                return open_image(self._file)
        except BaseException as error:
            self._file.close()
            raise self._damaged(error) from error

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._file.close()
        if isinstance(error, Exception) and not isinstance(error, FacePoserError):
            raise self._damaged(error) from error

    def _damaged(self, error: BaseException) -> BaseException:
        if isinstance(error, (OSError, UnidentifiedImageError, Image.DecompressionBombError, *DECODER_ERRORS)):
            return FacePoserError(f"The film '{self._path}' is damaged or no GIF; copy it again, or save it as MP4.")
        return error


def _in_order(path: Path) -> list[tuple[int, int, str]]:
    """Return the key by which names are sorted as people number them: 9 before 10."""
    parts = re.split(r"(\d+)", path.name.lower())
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in parts]
