"""Videos, decoded by PyAV, an optional extra that is imported when a video is opened."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.reading import open_file
from faceposer.files.sample_rates import USUAL_RATE
from faceposer.film.film import FilmFrame, Span, check_size, reduced_size, usual_rate

_MISSING = "needs PyAV, which is not installed; install it with pip install 'faceposer[film]'."
# Playlists, which may name other files and addresses, are not among them.
_CONTAINERS = (
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpeg,mpegts,asf,flv,live_flv,ogg,mxf,dv,h264,hevc,m4v,mpegvideo,"
    "gif,apng,ivf,av1,obu,y4m,yuv4mpegpipe,nut,rm,swf,wtv,wav,mp3,aac,flac"
)
_OPTIONS = {"format_whitelist": _CONTAINERS, "protocol_whitelist": "none"}
# Threads of a decoder, each of which keeps frames.
_THREADS = 2
_LEAST_RATE = 1.0
# Seconds, and share of the film, by which frames may end before the time that the file states.
_END_SECONDS, _END_SHARE = 0.5, 0.02


class Video:
    """A video file.

    Times are those of its frames: of frames that fall together at the rate, the first is used; where frames are farther
    apart, numbers are missing.
    """

    def __init__(self, path: Path, rate: float | None = None) -> None:
        """Read the properties and the first frame of ``path``, to sample it at ``rate``.

        Raises:
            FacePoserError: If PyAV is missing, or the file cannot be read or has no pictures.
        """
        self.path = path
        self.notes: tuple[str, ...] = ()
        with self._opened() as (container, stream):
            width, height = stream.codec_context.width, stream.codec_context.height
            check_size(path, (width, height))
            self._start = self._time_of(stream, stream.start_time) or 0.0
            stated = float(stream.average_rate or stream.guessed_rate or 0.0)
            if rate is None and not _LEAST_RATE <= stated < 1e5:
                self.notes = (f"The film does not state a rate; {USUAL_RATE:g} frames per second were assumed.",)
                stated = USUAL_RATE
            self.rate = usual_rate(stated) if rate is None else rate
            seconds = self._time_of(stream, stream.duration) or float(container.duration or 0) * 1e-6
            self._seconds = seconds
            self.n_frames: int | None = max(round(seconds * self.rate), 1) if seconds > 0.0 else None
            first = next(self._decoded(container, stream), None)
            if first is None:
                raise FacePoserError(f"The film '{path}' has no frames; copy it again.")
            frame = first[0]
            self._quarters = round(frame.rotation / 90.0) % 4
            shape = stream.sample_aspect_ratio
            wide = float(shape) if shape else 1.0
            # Pixels that are not square are made so.
            self._upright = (max(round(frame.width * wide), 1), frame.height) if 0.2 < wide < 5.0 else _size(frame)
            check_size(path, self._upright)
            self.size = self._upright[::-1] if self._quarters % 2 else self._upright

    def frames(self, span: Span, largest: int) -> Iterator[FilmFrame]:
        """Yield the frames of a part; see ``Film``."""
        first, last = span.numbers(self.rate)
        before = -1
        width, height = reduced_size(self._upright, largest)
        with self._opened() as (container, stream):
            if first > 0 and stream.time_base:
                from av.error import FFmpegError

                try:
                    offset = (self._start + max(span.start - 1.0 / self.rate, 0.0)) / float(stream.time_base)
                    container.seek(int(offset), stream=stream)
                except FFmpegError:  # no index: read from the beginning
                    container.seek(0)
            for frame, time in self._decoded(container, stream):
                number = round((time - self._start) * self.rate)
                if number >= last:
                    return
                if number <= before or number < first:
                    continue
                before = number
                if frame.is_corrupt:
                    raise self._damaged(number / self.rate, number > first)
                pixels = frame.to_ndarray(format="rgb24", width=width, height=height, interpolation="AREA")
                yield FilmFrame(number, self._turned(pixels))
        self._check_end((before + 1) / self.rate, last / self.rate)

    def _check_end(self, end: float, wanted: float) -> None:
        """Note it if the frames end at ``end`` seconds, long before ``wanted`` and the time that the file states."""
        stated = self._seconds
        if 0.0 < end < min(wanted, stated) - max(_END_SECONDS, _END_SHARE * stated):
            note = (
                f"The film states {stated:.2f} s, but its pictures end at {end:.2f} s; if it should go on, copy it "
                "again."
            )
            if note not in self.notes:
                self.notes = (*self.notes, note)

    def _damaged(self, at: float, started: bool) -> FacePoserError:
        """Return the error of a film that is damaged at ``at`` seconds, with frames before that if ``started``."""
        remedy = f"choose a part that ends before {at:.2f} s, or copy the film again" if started else "copy it again"
        return FacePoserError(
            f"The film '{self.path}' is damaged at frame {round(at * self.rate)} ({at:.2f} s); {remedy}."
        )

    def _turned(self, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        return np.ascontiguousarray(np.rot90(pixels, self._quarters))

    @staticmethod
    def _time_of(stream: Any, ticks: int | None) -> float | None:
        return None if ticks is None or not stream.time_base else float(ticks * stream.time_base)

    def _decoded(self, container: Any, stream: Any) -> Iterator[tuple[Any, float]]:
        """Yield frames with their times in seconds; damaged ones raise FacePoserError with their time."""
        from av.error import FFmpegError

        # Numbers of frames whose time is not stated.
        time, step = self._start, 1.0 / self.rate
        decoded = iter(container.decode(stream))
        started = False
        while True:
            try:
                frame = next(decoded)
            except StopIteration:
                return
            except FFmpegError as error:
                raise self._damaged(time - self._start, started) from error
            own = self._time_of(stream, frame.pts)
            time = own if own is not None else time + step * started
            started = True
            yield frame, time

    @contextmanager
    def _opened(self) -> Iterator[tuple[Any, Any]]:
        """Open the file, and yield its container and its video stream."""
        try:
            file = open_file(self.path)
        except FileNotFoundError as error:
            raise FacePoserError(f"There is no film '{self.path}'; check the path.") from error
        except OSError as error:
            raise FacePoserError(f"The film '{self.path}' cannot be read: {error.strerror}.") from error
        with file:
            try:
                import av
            except ImportError as error:
                raise FacePoserError(f"The film '{self.path}' {_MISSING}") from error
            av.logging.set_level(None)
            try:
                container = av.open(file, options=dict(_OPTIONS))
            except (av.error.FFmpegError, ValueError, OSError) as error:
                raise FacePoserError(
                    f"'{self.path}' is not a film that can be read, or is damaged; save it as MP4."
                ) from error
            with container:
                streams = [stream for stream in container.streams.video if not _is_cover(stream)]
                if not streams:
                    only = "only sound" if container.streams.audio else "no pictures"
                    raise FacePoserError(f"The file '{self.path}' has {only}; choose a film with pictures.")
                if streams[0].codec_context is None:
                    raise FacePoserError(
                        f"The film '{self.path}' is in a format for which there is no decoder; save it as MP4."
                    )
                streams[0].thread_count = _THREADS
                yield container, streams[0]


def _size(frame: Any) -> tuple[int, int]:
    return frame.width, frame.height


def _is_cover(stream: Any) -> bool:
    """Return True if ``stream`` is a picture of the cover of a record."""
    from av.stream import Disposition

    return bool(stream.disposition & Disposition.attached_pic)
