"""The study of expressions from films: trials on synthetic films, steadiness on a face that does not move, and rows."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import cKDTree

from faceposer.film.film import Film, Span
from faceposer.film.following import follow_head
from faceposer.film.opening import open_film
from faceposer.film.person import find_person
from faceposer.film.tracking import Track, track_face
from faceposer.identity.photos.face_places import FacePlaces, load_face_places
from faceposer.identity.photos.head_basis import HeadBasis, head_basis
from faceposer.identity.photos.landmark_fit import PhotoFace, fit_landmarks
from faceposer.landmarks.points import N_POINTS
from faceposer.model.shape_names import weight_map
from faceposer.photo.reading import FOCAL_SPREAD, LIKELY_FOCAL_MM, focal_in_pixels
from faceposer.training.recordings import read_named
from scripts.film_study.synthetic import draw_film, encode
from scripts.photo_study.synthetic import random_person

Array = NDArray[np.float64]

METHODS = ("neutral", "frames alone", "landmarks, not smooth", "landmarks", "colours, not smooth", "colours")
_FIRST_SEED, _FIRST_FRAME = 8000, 2000
# Openings of the jaw per second, and frames at which blinks begin, with their weights.
_FAST_SEED, _JAW_HZ, _BLINKS, _BLINK = 8100, 5.0, (5, 51), (0.5, 1.0, 0.9, 0.4, 0.1)
# Distance of the vertices measured from the landmarks, in centimetres.
_REACH = 1.2
_DRAWS = 1000


@dataclass(frozen=True)
class Trial:
    """Errors of one method on one film, in millimetres.

    Attributes:
        method: Name of the method.
        errors: Mean distance of the displaced vertices from the true ones in each frame, shape (F,).
        jerk: Root mean square of third differences between frames.
        true_jerk: That of the truth.
        seconds: Processor time for each frame, that of finding the face and the person included.
    """

    method: str
    errors: Array
    jerk: float
    true_jerk: float
    seconds: float


class Study:
    """Trials on random people who are not in the model's training data, with captured motion."""

    def __init__(self, take: Path, n_frames: int) -> None:
        """Prepare films of ``n_frames`` each from the motion in the file ``take``."""
        self.basis: HeadBasis = head_basis()
        self.places: FacePlaces = load_face_places()
        named = read_named(take, None)
        self.rate = named.rate or 30.0
        names = self.basis.character.shape_names
        self.weights = (named.frames @ weight_map(names, named.names).T)[_FIRST_FRAME:]
        self.n_frames = n_frames
        skin = self.basis.character.vertices[: self.basis.n_skin]
        landmarks = self.basis.landmarks(self.places).mean[:N_POINTS]
        self.measured = np.flatnonzero(cKDTree(landmarks).query(skin)[0] < _REACH)

    def trials(self, number: int, n_films: int) -> Iterator[Trial]:
        """Yield the trials of film ``number`` of ``n_films``, which are spread over the take."""
        seed = _FIRST_SEED + number
        first = round(number * (len(self.weights) - self.n_frames) / max(n_films - 1, 1))
        weights = self.weights[first : first + self.n_frames]
        person = random_person(self.basis.editor, self.basis.character, seed)
        shapes = person.shapes[:, self.measured]
        truth = np.tensordot(weights, shapes, 1)
        with TemporaryDirectory() as folder:
            path = Path(folder) / "film.mp4"
            encode(path, draw_film(person, self.basis.character, weights, self.rate, seed).frames, self.rate)
            for method, found, seconds in self._followed(open_film(path)):
                moved = np.tensordot(found, shapes, 1)
                errors = 10.0 * np.linalg.norm(moved - truth, axis=2).mean(axis=1)
                yield Trial(method, errors, _jerk(moved), _jerk(truth), seconds)

    def fast(self, number: int) -> Iterator[dict[str, Any]]:
        """Yield the rows of a film of a person who opens the jaw five times a second and blinks twice."""
        names, seed = self.basis.character.shape_names, _FAST_SEED + number
        jaw, lids = names.index("jawOpen"), [names.index("eyeBlink" + side) for side in ("Left", "Right")]
        speech = np.arange(18, 48)
        weights = np.zeros((60, len(names)))
        weights[speech, jaw] = 0.2 * (1.0 - np.cos(2.0 * np.pi * _JAW_HZ * (speech - speech[0]) / self.rate))
        for begin in _BLINKS:
            weights[begin : begin + len(_BLINK), lids] = np.array(_BLINK)[:, None]
        person = random_person(self.basis.editor, self.basis.character, seed)
        with TemporaryDirectory() as folder:
            path = Path(folder) / "film.mp4"
            encode(path, draw_film(person, self.basis.character, weights, self.rate, seed).frames, self.rate)
            for method, found, _ in self._followed(open_film(path)):
                truth, moved = weights[speech, jaw], found[speech, jaw]
                centred = truth - truth.mean()
                shifts = np.arange(-1.5, 1.51, 0.05)
                alike = [np.interp(speech + shift, np.arange(60), found[:, jaw]) @ centred for shift in shifts]
                closed = [found[begin : begin + len(_BLINK), lids].max(axis=0).mean() for begin in _BLINKS]
                yield {
                    "test": "fast",
                    "method": method,
                    "seed": seed,
                    "jaw_share": round(float(centred @ moved / (centred @ centred)), 3),
                    "frames_late": round(float(shifts[int(np.argmax(alike))]), 2),
                    "blink_share": round(float(np.mean(closed) - np.median(found[speech][:, lids])), 3),
                }

    def steadiness(self, photo: Path, n_frames: int) -> Iterator[dict[str, Any]]:
        """Yield the rows of a film that pans and zooms over ``photo``, whose face does not move."""
        image = Image.open(photo).convert("RGB")
        frames = []
        for k in range(n_frames):
            t = k / max(n_frames - 1, 1)
            half = 180.0 - 40.0 * t
            x, y = 220.0 + 40.0 * t + 6.0 * np.sin(k / 4.0), 180.0
            box = (x - half, y - half, x + half, y + half)
            frames.append(np.asarray(image.resize((400, 400), Image.Resampling.BICUBIC, box=box)))
        shapes = self.basis.character.shapes[:, self.measured].astype(np.float64)
        with TemporaryDirectory() as folder:
            path = Path(folder) / "film.mp4"
            encode(path, frames, self.rate)
            for method, found, seconds in self._followed(open_film(path)):
                moved = np.tensordot(found, shapes, 1)
                off = np.linalg.norm(moved - moved.mean(axis=0), axis=2)
                yield {
                    "test": "still",
                    "method": method,
                    "n": n_frames,
                    "size_mm": round(10.0 * float(np.linalg.norm(moved.mean(axis=0), axis=1).mean()), 3),
                    "off_mm": round(10.0 * float(off.mean()), 3),
                    "jerk_mm": round(_jerk(moved), 3),
                    "seconds": round(seconds, 3),
                }

    def _followed(self, film: Film) -> Iterator[tuple[str, Array, float]]:
        """Yield methods with their weights, (F, S), and times for each frame."""
        begun = time.process_time()
        track = track_face(film, Span())
        count = len(track.numbers)
        finding = (time.process_time() - begun) / count
        yield "neutral", np.zeros((count, len(self.basis.character.shape_names))), 0.0
        begun = time.process_time()
        alone = self._alone(track)
        yield "frames alone", alone, finding + (time.process_time() - begun) / count
        for colours in (False, True):
            begun = time.process_time()
            person = find_person(film, Span(), track, colours)
            knowing = finding + (time.process_time() - begun) / count
            for smoothness in (0.0, 1.0):
                begun = time.process_time()
                head = follow_head(film, Span(), track, person, smoothness=smoothness)
                seconds = knowing + (time.process_time() - begun) / count
                name = ("colours" if colours else "landmarks") + ("" if smoothness else ", not smooth")
                yield name, head.poses @ person.model.subspace.directions.T, seconds

    def _alone(self, track: Track) -> Array:
        """Return the weights of each frame as that of a photo, by landmarks; frames without a face repeat the last."""
        focal = focal_in_pixels(LIKELY_FOCAL_MM, track.size)
        result, last = [], np.zeros(len(self.basis.character.shape_names))
        for face in track.faces:
            if face is not None:
                fit = fit_landmarks([PhotoFace(face, track.size, focal, FOCAL_SPREAD)], self.basis, self.places)
                last = self.basis.model.weights_of(fit.state.views[0].pose)
            result.append(last)
        return np.array(result)


def _jerk(places: Array) -> float:
    """Return the root mean square of the third differences of ``places``, (F, n, 3), in millimetres."""
    return float(10.0 * np.sqrt(np.square(np.diff(places, 3, axis=0)).sum(axis=2).mean()))


def rows_of(trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """Return one row per method, with the confidence of the mean over films by the bootstrap."""
    rows = []
    for method in METHODS:
        chosen = [trial for trial in trials if trial.method == method]
        if not chosen:
            continue
        means = np.array([trial.errors.mean() for trial in chosen])
        draws = np.random.default_rng(0).choice(means, (_DRAWS, len(means))).mean(axis=1)
        frames = np.concatenate([trial.errors for trial in chosen])
        rows.append(
            {
                "test": "synthetic",
                "method": method,
                "n": len(chosen),
                "frames": len(frames),
                "error_mm_mean": round(float(means.mean()), 3),
                "error_mm_median": round(float(np.median(frames)), 3),
                "error_mm_worst": round(float(np.quantile(frames, 0.95)), 3),
                "ci95": np.quantile(draws, (0.025, 0.975)).round(3).tolist(),
                "jerk_mm": round(float(np.mean([trial.jerk for trial in chosen])), 3),
                "true_jerk_mm": round(float(np.mean([trial.true_jerk for trial in chosen])), 3),
                "seconds": round(float(np.median([trial.seconds for trial in chosen])), 3),
            }
        )
    return rows
