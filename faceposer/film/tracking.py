"""The face in each frame of a film: found in the first one, followed to the next ones, found again when it is lost."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.film.film import MOST_FRAMES, Film, FilmFrame, Span, too_long
from faceposer.film.shots import Shot, Thumbnail, change, shots_of, sudden, thumbnail
from faceposer.landmarks.crops import Picture
from faceposer.landmarks.points import Landmarks, find_all_landmarks, followed_landmarks, likely_landmarks
from faceposer.progress import Progress

# Longer side to which frames are reduced, and that at which small faces are read again.
_SIDE, _LARGER_SIDE = 1280, 2560
# Height of a face in frames, in pixels, below which they are read at the larger size, and below which it is too small.
_SMALL, _LEAST = 150.0, 60.0
# Least logarithm of the odds of a face that is followed, and of one that counts as another person.
_SURE = 12.0
# Frames between two thorough searches for a face, and frames after which a lost face may be anywhere.
_THOROUGH, _FORGOTTEN = 12, 30
# Distance, in heights of the face, within which a lost face is found again, and how many times larger it may be.
_NEAR, _LARGER = 0.7, 1.7
# Least height of another person's face, as a share of that which is followed.
_OTHER = 0.4


Watch = Callable[[FilmFrame, Landmarks | None], None]


@dataclass(frozen=True, eq=False)
class Track:
    """A face in a shot of a film.

    Attributes:
        size: Width and height of the frames in which it was followed, in pixels.
        numbers: The frames that were read, increasing, shape (F,).
        faces: Its landmarks in each of them, in pixels of ``size``, or None where it was not seen.
        shot: The shot.
        cuts: Frames that begin other shots of the part that was read.
        others: Number of other people seen where the face was found.
    """

    size: tuple[int, int]
    numbers: NDArray[np.int64]
    faces: tuple[Landmarks | None, ...]
    shot: Shot
    cuts: tuple[int, ...] = ()
    others: int = 0

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Mask of the frames that show the face, shape (F,)."""
        return np.array([face is not None for face in self.faces])


def _no_watch(_frame: FilmFrame, _face: Landmarks | None) -> None:
    pass


class _LargerNeeded(Exception):
    """The face is small in reduced frames."""


def track_face(film: Film, span: Span, progress: Progress | None = None, watch: Watch = _no_watch) -> Track:
    """Return the largest face of the longest shot in a part of ``film``.

    Args:
        film: The film.
        span: The part.
        progress: Progress to update.
        watch: Called with each frame and the face in it, or None.

    Raises:
        FacePoserError: If no face is found, or it is too small, or there are too many frames.
    """
    progress = progress or Progress()
    try:
        track = _Tracker(film, span, _SIDE, progress, watch).track()
    except _LargerNeeded:
        track = _Tracker(film, span, _LARGER_SIDE, progress, watch).track()
    heights = [_height(face) for face in track.faces if face is not None]
    factor = max(film.size) / max(track.size)
    if float(np.median(heights)) < _LEAST:
        raise FacePoserError(
            f"The face in '{film.path}' is {factor * float(np.median(heights)):.0f} pixels high in most frames, and at "
            f"least {factor * _LEAST:.0f} are needed; use a film in which it is larger."
        )
    return track


class _Tracker:
    """Follows the face through the frames of a part."""

    def __init__(self, film: Film, span: Span, side: int, progress: Progress, watch: Watch) -> None:
        self._film, self._span, self._side, self._progress, self._watch = film, span, side, progress, watch
        self._numbers: list[int] = []
        self._changes: list[float] = []
        self._faces: list[Landmarks | None] = []
        # Number of other faces where a face was found, by place in the list.
        self._others: dict[int, int] = {}
        self._size = (1, 1)
        self._last: Landmarks | None = None
        self._lost = 0

    def track(self) -> Track:
        film = self._film
        first, end = self._span.numbers(film.rate)
        last = min(end, film.n_frames or np.inf)
        before: Thumbnail | None = None
        for frame in film.frames(self._span, self._side):
            share = (frame.number - first) / (last - first) if np.isfinite(last) and last > first else 0.0
            self._progress.at("Finding the face", min(share, 1.0))
            if len(self._numbers) >= MOST_FRAMES:
                raise too_long(film)
            small = thumbnail(frame.pixels)
            changed = change(before, small)
            if sudden(changed, self._changes[-1] if self._changes else 0.0):
                self._last, self._lost = None, 0
            before = small
            self._size = (frame.pixels.shape[1], frame.pixels.shape[0])
            self._numbers.append(frame.number)
            self._changes.append(changed)
            self._faces.append(self._face_in(frame))
            self._watch(frame, self._faces[-1])
        if not self._numbers:
            raise FacePoserError(f"The film '{film.path}' has no frames in this part; choose another part.")
        return self._longest()

    def _face_in(self, frame: FilmFrame) -> Landmarks | None:
        picture = Picture(frame.pixels)
        face = None
        if self._last is not None and self._lost == 0:
            face = followed_landmarks(picture, self._last)
            if face is not None and not self._plausible(face):
                face = None
        if face is None:
            face = self._found_again(picture) if self._last is not None else self._first_in(picture, frame)
        if face is None:
            self._lost += 1
            return None
        self._last, self._lost = face, 0
        return _compact(face)

    def _first_in(self, picture: Picture, frame: FilmFrame) -> Landmarks | None:
        """Return the largest face of a frame before which there was none."""
        if likely_landmarks(picture, None if self._lost % _THOROUGH == 0 else 1) is None:
            return None
        found = [face for face in find_all_landmarks(frame.pixels) if face.logit >= _SURE]
        if not found:
            return None
        largest = found[0]
        if _height(largest) < _SMALL and self._side < min(max(self._film.size), _LARGER_SIDE):
            raise _LargerNeeded
        self._others[len(self._faces)] = sum(_height(face) > _OTHER * _height(largest) for face in found[1:])
        return largest

    def _found_again(self, picture: Picture) -> Landmarks | None:
        """Return the face that was lost, if one is near enough to where it was."""
        thorough = self._lost % _THOROUGH == _THOROUGH - 1
        face = likely_landmarks(picture, None if thorough else 1)
        return face if face is not None and face.logit >= _SURE and self._plausible(face) else None

    def _plausible(self, face: Landmarks) -> bool:
        """Return True if ``face`` can be the one seen last."""
        last = self._last
        if last is None or self._lost > _FORGOTTEN:
            return True
        room = 1.0 + self._lost / 10.0
        height = _height(last)
        apart = float(np.linalg.norm(face.points[:, :2].mean(axis=0) - last.points[:, :2].mean(axis=0)))
        ratio = _height(face) / max(height, 1.0)
        return apart < _NEAR * room * height and 1.0 / (_LARGER * room) < ratio < _LARGER * room

    def _longest(self) -> Track:
        """Return the face in the shot in which it is seen in the most frames."""
        film, numbers = self._film, np.array(self._numbers)
        shots = shots_of(self._numbers, self._changes)
        seen = np.array([face is not None for face in self._faces])
        if not seen.any():
            raise FacePoserError(
                f"No face was found in '{film.path}'; use a film in which a face is larger and seen from the front."
            )
        counts = [int(seen[(numbers >= shot.first) & (numbers <= shot.last)].sum()) for shot in shots]
        shot = shots[int(np.argmax(counts))]
        chosen = np.flatnonzero((numbers >= shot.first) & (numbers <= shot.last))
        others = [count for at, count in self._others.items() if at in set(chosen.tolist())]
        return Track(
            self._size,
            numbers[chosen],
            tuple(self._faces[k] for k in chosen),
            shot,
            tuple(other.first for other in shots[1:]),
            max(others, default=0),
        )


def _compact(face: Landmarks) -> Landmarks:
    """Return ``face`` in half the memory."""
    single = np.float32
    return replace(face, points=face.points.astype(single), iris=face.iris.astype(single), box=face.box.astype(single))


def _height(face: Landmarks) -> float:
    return float(face.box[3] - face.box[1])
