"""Expression and place of a head in all frames of a film at once, smooth over time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.animation.smoothing import smooth_poses
from faceposer.animation.terms import regional_metrics, smoothness_metric
from faceposer.errors import FacePoserError
from faceposer.film.film import Film, Span
from faceposer.film.frame_fit import N_PLACE, ColourSettings, FrameFit, FrameQuadratic, Placing
from faceposer.film.person import Person
from faceposer.film.tracking import Track
from faceposer.identity.photos.head_from_photos import MOST_YAW, turn_of
from faceposer.progress import Progress

Array = NDArray[np.float64]

# Number of frames smoothed at once, and of those smoothed again with the next ones; see ``animation.following``.
_WINDOW, _OVERLAP = 600, 60
# Usual change of the velocity of a head between frames at 30 per second: turn in radians, place in centimetres, and the
# logarithm of its scale.
_CHANGES = np.array([0.012, 0.012, 0.012, 0.06, 0.06, 0.004])
_USUAL_RATE = 30.0
# Weight of changes of velocity at smoothness 1, relative to that of ``animation.terms``, and their cost, in a region of
# the face, from which they are sudden: blinks and speech.
_SMOOTHNESS, _SUDDEN = 3.0, 0.3
# How many times the usual number of steps the first frame takes, which has none before it.
_FIRST_STEPS = 3
_MEDIAN_TO_DEVIATION = 1.48
# Precision of the place of a head that is not seen, relative to its usual changes.
_UNSEEN = 1e-3


@dataclass(frozen=True, eq=False)
class FollowedHead:
    """A head in the frames of a film, at each number from the first to the last.

    Attributes:
        first: Number of the first frame.
        poses: Expressions of the person, shape (F, r).
        places: Places of the head, shape (F, 6).
        placing: The cameras that they stand for.
        seen: Mask of the frames in which the face was seen, shape (F,).
        misses: Mean distance of the landmarks from the face in pixels, NaN where it was not seen, shape (F,).
        noise: Standard deviation by which the weights of the person's shapes in single frames differ from the smooth
            ones, shape (S,).
    """

    first: int
    poses: Array
    places: Array
    placing: Placing
    seen: NDArray[np.bool_]
    misses: Array
    noise: Array


def follow_head(
    film: Film,
    span: Span,
    track: Track,
    person: Person,
    *,
    smoothness: float = 1.0,
    settings: ColourSettings | None = None,
    progress: Progress | None = None,
) -> FollowedHead:
    """Return the expression and place of the head of ``person`` in each frame of ``track``.

    First, each frame is fitted from the one before, by landmarks and, if the person has colours, by those of the frame.
    Then the sum of the energies of all frames, to second order, and of the cost of changes of velocity is minimised,
    with a cost for each region of the face and for the head that lets sudden changes pass.

    Args:
        film: The film.
        span: The part of it that was read.
        track: The face in each frame.
        person: The person.
        smoothness: Weight of changes of velocity, at least 0.
        settings: Settings of the colours.
        progress: Progress to update.

    Raises:
        FacePoserError: If a frame cannot be read, or the face is always turned too far.
    """
    progress = progress or Progress()
    settings = settings or ColourSettings()
    first, last = int(track.numbers[0]), int(track.numbers[-1])
    count, r = last - first + 1, person.model.n_coefficients
    faces = dict(zip(track.numbers.tolist(), track.faces, strict=True))
    start = next(face for face in track.faces if face is not None)
    camera = person.camera_of(start, track.size)
    placing = Placing(camera.rotation, camera)
    unknowns, seen = np.zeros((count, r + N_PLACE)), np.zeros(count, dtype=bool)
    misses = np.full(count, np.nan)
    energies: list[FrameQuadratic | None] = [None] * count
    now = np.concatenate([np.zeros(r), placing.place_of(camera)])
    rng = np.random.default_rng(0)
    images = film.frames(span, max(track.size)) if person.skin is not None else iter(())
    lost, beyond = False, np.zeros(r + N_PLACE)
    for number in range(first, last + 1):
        k = number - first
        progress.at("Following the expression", k / count)
        face = faces.get(number)
        if face is None:
            lost = True
            continue
        if lost:
            # The head may be elsewhere.
            now = np.concatenate([now[:r], placing.place_of(person.camera_of(face, track.size))])
        fit = FrameFit(person, placing, face, now)
        fit.settle()
        if abs(turn_of(placing.camera_at(fit.unknowns[r:]).rotation)) > MOST_YAW:
            lost = True
            continue
        pixels = next((frame.pixels for frame in images if frame.number == number), None)
        if pixels is None:
            energy = fit.quadratic(fit.unknowns)
        else:
            # Colours move the face about as far from its landmarks as in the frame before.
            settled = fit.unknowns
            fit.unknowns = settled + beyond
            first_steps = _FIRST_STEPS * settings.steps
            energy = fit.refine(pixels, settings if beyond.any() else replace(settings, steps=first_steps), rng)
            beyond = fit.unknowns - settled
        energies[k] = replace(energy, curvature_of_data=energy.curvature_of_data.astype(np.float32))
        unknowns[k] = now = fit.unknowns
        misses[k] = float(fit.misses().mean())
        seen[k], lost = True, False
    if not seen.any():
        raise FacePoserError(
            f"The face in '{film.path}' is turned by more than {np.degrees(MOST_YAW):.0f} degrees in all frames; use a "
            "film in which it is seen more from the front."
        )
    progress.at("Smoothing all frames", 1.0)
    smooth = _smoothed(unknowns, seen, energies, person, smoothness, film.rate, progress)
    off = np.abs((unknowns[seen, :r] - smooth[seen, :r]) @ person.model.subspace.directions.T)
    noise = _MEDIAN_TO_DEVIATION * np.median(off, axis=0)
    return FollowedHead(first, smooth[:, :r], smooth[:, r:], placing, seen, misses, noise)


def _smoothed(
    unknowns: Array,
    seen: NDArray[np.bool_],
    energies: Sequence[FrameQuadratic | None],
    person: Person,
    smoothness: float,
    rate: float,
    progress: Progress,
) -> Array:
    """Return the smooth unknowns of all frames; those not ``seen`` lie between their neighbours."""
    known = np.flatnonzero(seen)
    frames = np.arange(len(unknowns))
    between = np.stack([np.interp(frames, known, column[known]) for column in unknowns.T], axis=1)
    if smoothness <= 0.0:
        return between
    smoothness *= _SMOOTHNESS
    r = unknowns.shape[1] - N_PLACE
    parts = regional_metrics(person.model, 0.5 * smoothness_metric(person.model, smoothness, rate))
    # The place of the head is the last group.
    metrics = np.zeros((len(parts) + 1, r + N_PLACE, r + N_PLACE))
    metrics[:-1, :r, :r] = parts
    metrics[-1, r:, r:] = np.diag(0.5 * smoothness * (rate / _USUAL_RATE) ** 3 / _CHANGES**2)
    weak = np.zeros_like(metrics[0])
    weak[:r, :r] = person.prior.precision
    weak[r:, r:] = np.diag(_UNSEEN / _CHANGES**2)
    problems = [
        energy if energy is not None else FrameQuadratic(x, np.zeros(len(x)), weak, None)
        for energy, x in zip(energies, between, strict=True)
    ]
    result = between.copy()
    for begin in range(0, len(result), _WINDOW - _OVERLAP):
        end = min(begin + _WINDOW, len(result))
        result[begin:end] = smooth_poses(
            problems[begin:end], metrics, result[begin:end], result[max(begin - 2, 0) : begin], progress, _SUDDEN
        )
        if end == len(result):
            break
    return result
