"""Expressions of a film on any character with ARKit's shapes, frame by frame.

Head, skin and focal length are those of a few good frames. The weights of the person's expressions go to the
character's shapes of the same names, as with photos.
"""

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.animation.keyframes import TOLERANCE, Keyframes
from faceposer.errors import counted
from faceposer.film.film import Film, Span, check_span
from faceposer.film.following import FollowedHead, follow_head
from faceposer.film.opening import open_film
from faceposer.film.person import Person, find_person
from faceposer.film.tracking import Track, Watch, track_face
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.model.shape_names import weight_map
from faceposer.photo.automatic import check_takes, pose_of_weights
from faceposer.progress import Progress

Array = NDArray[np.float64]

_SHOWN = 4
# Number of standard deviations of single frames by which keys may miss the smooth weights, and the most that is missed.
_SURE, _MOST_TOLERANCE = 5.0, 0.06
# Usual times in seconds: of finding the face in a frame, and by landmarks alone or with colours, of making the head and
# of following a frame. Number of frames where it is not known.
_FINDING, _KNOWING, _FOLLOWING, _USUAL_FRAMES = 0.045, (1.5, 8.0), (0.015, 0.2), 300
_DIGITS = 3


@dataclass(frozen=True, eq=False)
class FilmExpression:
    """The expressions of a film on a character.

    Attributes:
        performance: Its poses, at the rate of the film.
        film: The film.
        first: Frame of the film at which the performance begins.
        track: The face in each frame.
        notes: What was chosen, assumed and lost, one sentence each.
        report: What was measured, as JSON.
        tolerances: Errors of the weights of the character's shapes that are as small as what is uncertain, shape (S,).
    """

    performance: Performance
    film: Film
    first: int
    track: Track
    notes: tuple[str, ...]
    report: dict[str, Any]
    tolerances: Array

    def keys(self, model: FaceModel, progress: Progress | None = None) -> Keyframes:
        """Return as few keys on the character of ``model`` as give every shape within its tolerance."""
        return Keyframes.of_performance(self.performance).reduced(model, self.tolerances, progress)


def expression_of_film(
    path: Path,
    model: FaceModel,
    *,
    span: Span | None = None,
    rate: float | None = None,
    smoothness: float = 1.0,
    colours: bool = True,
    progress: Progress | None = None,
    watch: Watch | None = None,
) -> FilmExpression:
    """Return the expressions of the face in the film ``path`` on the character of ``model``.

    Args:
        path: A video, an animated GIF, or a folder of pictures.
        model: Model of the character.
        span: The part of the film; all of it if None.
        rate: Frames per second at which the film is sampled; its own if None.
        smoothness: Weight of changes of velocity, at least 0.
        colours: Follow the colours of the face, too, which is slower and better than its landmarks alone.
        progress: Progress to update.
        watch: Called with each frame and the face in it, as it is found.

    Raises:
        FacePoserError: If the film cannot be read, or shows no face that can be followed; or if the character has none
            of ARKit's shapes.
        CancelledError: If the progress was cancelled.
    """
    begun = time.perf_counter()
    check_takes(model, "films", "animate it by trajectories instead")
    film, span = open_film(path, rate), span or Span()
    check_span(film, span)
    progress = progress or Progress()
    found, known = _shares(film, span, colours)
    track = track_face(film, span, progress.part(0.0, found), *([watch] if watch else []))
    person = find_person(film, span, track, colours, progress.part(found, known))
    head = follow_head(film, span, track, person, smoothness=smoothness, progress=progress.part(known, 1.0))
    weights = head.poses @ person.model.subspace.directions.T
    poses = pose_of_weights(model, person.model.character.shape_names, weights)
    report = _report(film, track, person, head)
    report["seconds"] = round(time.perf_counter() - begun, 2)
    notes = (*film.notes, *_notes(film, track, head))
    if colours and person.skin is None:
        notes = (*notes, "Colours did not improve the head; landmarks alone are followed.")
    given = weight_map(model.character.shape_names, person.model.character.shape_names)
    tolerances = np.clip(_SURE * np.abs(given) @ head.noise, TOLERANCE, _MOST_TOLERANCE)
    return FilmExpression(Performance(poses, film.rate), film, head.first, track, notes, report, tolerances)


def _shares(film: Film, span: Span, colours: bool) -> tuple[float, float]:
    """Return the shares of the time after which the face is found, and the head known."""
    first, end = span.numbers(film.rate)
    count = max(min(end, film.n_frames or _USUAL_FRAMES) - first, 1)
    finding, following = count * _FINDING, count * _FOLLOWING[colours]
    total = finding + _KNOWING[colours] + following
    return finding / total, (finding + _KNOWING[colours]) / total


def _notes(film: Film, track: Track, head: FollowedHead) -> list[str]:
    notes = []
    if track.cuts:
        times = [f"frame {cut} ({cut / film.rate:.2f} s)" for cut in track.cuts[:_SHOWN]]
        more = f" and {len(track.cuts) - _SHOWN} more" if len(track.cuts) > _SHOWN else ""
        begin, end = track.shot.first / film.rate, (track.shot.last + 1) / film.rate
        notes.append(
            f"The film cuts at {', '.join(times)}{more}; the shot that shows a face longest, from {begin:.2f} to "
            f"{end:.2f} s, is used; give the times of another part to use that."
        )
    if track.others:
        notes.append(f"The film shows {counted(track.others, 'other face')}; the largest is followed.")
    numbers = head.first + np.arange(len(head.seen))
    given = np.isin(numbers, track.numbers)
    missing, unseen = numbers[~given], numbers[given & ~head.seen]
    if len(missing):
        notes.append(
            f"The film lacks {len(missing)} of {counted(len(numbers), 'frame')}, first at "
            f"{missing[0] / film.rate:.2f} s; there, the expression passes over from those around."
        )
    if len(unseen):
        notes.append(
            f"In {len(unseen)} of {counted(int(given.sum()), 'frame')} the face is not seen, or turned by more than 60 "
            f"degrees, first at {unseen[0] / film.rate:.2f} s; there, the expression passes over from those around."
        )
    return notes


def _report(film: Film, track: Track, person: Person, head: FollowedHead) -> dict[str, Any]:
    factor = max(film.size) / max(track.size)
    frames = []
    for k, place in enumerate(head.places):
        camera = head.placing.camera_at(place)
        yaw, pitch, roll = _turns(camera.rotation)
        frames.append(
            {
                "frame": head.first + k,
                "time": round((head.first + k) / film.rate, _DIGITS),
                "landmark_px": round(factor * float(head.misses[k]), 2) if head.seen[k] else None,
                "yaw": round(yaw, _DIGITS),
                "pitch": round(pitch, _DIGITS),
                "roll": round(roll, _DIGITS),
                "place": [round(value, _DIGITS) for value in (*camera.offset, math.exp(camera.log_depth))],
            }
        )
    return {
        "film": str(film.path),
        "size": list(film.size),
        "rate": film.rate,
        "shot": [track.shot.first, track.shot.last],
        "cuts": list(track.cuts),
        "other_faces": track.others,
        "head_from_frames": list(person.good),
        "focal_px": round(factor * math.exp(person.log_focal), 1),
        "colours": person.skin is not None,
        "landmark_px": round(factor * float(np.nanmean(head.misses)), 2),
        "frames": frames,
    }


def _turns(rotation: Array) -> tuple[float, float, float]:
    """Return yaw, to the left of the person, pitch, downwards, and roll, to the right shoulder, in degrees.

    Args:
        rotation: From world to camera, shape (3, 3).
    """
    from scipy.spatial.transform import Rotation

    head = np.diag([1.0, -1.0, -1.0]) @ rotation
    yaw, pitch, roll = Rotation.from_matrix(head).as_euler("YXZ", degrees=True)
    return float(yaw), float(pitch), float(roll)
