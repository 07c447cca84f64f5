"""Errors of the networks on photos whose truth is known."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.picking import SurfacePoints
from faceposer.identity.photos.face_places import FacePlaces, LandmarkErrors
from faceposer.identity.photos.head_basis import head_basis
from faceposer.identity.photos.landmark_fit import PhotoFace, first_camera
from faceposer.identity.photos.terms import upright
from faceposer.landmarks.points import N_POINTS, find_landmarks
from scripts.photo_study.synthetic import SIZE, photo_of, random_person, random_weights

Array = NDArray[np.float64]

_SKINS, _MODES, _FIRST_SEED, _MOST_YAW = 16, 40, 900_000, 0.7
_LEAST_DEVIATION = 0.02


def error_samples(points: SurfacePoints, n_photos: int) -> Iterator[Array]:
    """Yield the errors, (468, 2), upright and in centimetres, of random photos in which a face is found."""
    basis = head_basis()
    plain = FacePlaces(points, LandmarkErrors.plain())
    mean = basis.landmarks(plain).mean
    skins = []
    for number in range(n_photos):
        seed = _FIRST_SEED + number
        rng = np.random.default_rng(seed)
        person = random_person(basis.editor, basis.character, seed, own_shapes=False, textured=number < _SKINS)
        if number < _SKINS:
            skins.append(person.textures)
        person = replace(person, textures=skins[number % _SKINS])
        yaw = float(rng.uniform(-_MOST_YAW, _MOST_YAW))
        weights = random_weights(basis.model, rng)
        photo = photo_of(person, basis.character, weights, rng, yaw, finer=1)
        found = find_landmarks(photo.pixels)
        if found is None:
            continue
        face = PhotoFace(found, (SIZE, SIZE), 2.0 * SIZE, 0.3)
        scale = np.exp(first_camera(face, mean).log_scale)
        truth = photo.camera.project(points.positions(photo.vertices, basis.model.triangles))
        yield (found.points[:N_POINTS, :2] - truth) @ upright(found) / scale


def learn_errors(points: SurfacePoints, n_photos: int) -> LandmarkErrors:
    """Return the density of the errors in ``n_photos`` random photos."""
    samples: list[Array] = []
    for errors in error_samples(points, n_photos):
        samples.append(errors)
        if len(samples) % 20 == 0:
            print(f"{len(samples)} photos, mean error {10 * np.linalg.norm(samples, axis=2).mean():.2f} mm", flush=True)
    return density_of(np.array(samples))


def density_of(samples: Array, n_modes: int = _MODES) -> LandmarkErrors:
    """Return the density of ``samples`` of errors, (m, 468, 2), with ``n_modes`` modes."""
    # Faces at which the networks fail are no evidence of how they err at others.
    sizes = np.linalg.norm(samples, axis=2).mean(axis=1)
    kept = samples[sizes < 3.0 * np.median(sizes)]
    mean = np.median(kept, axis=0)
    rows = (kept - mean).reshape(len(kept), -1)
    _, singular, axes = np.linalg.svd(rows, full_matrices=False)
    variances = singular**2 / len(rows)
    n = min(n_modes, len(rows) // 4)
    left = variances[n:].sum() / max(rows.shape[1] - n, 1)
    modes = axes[:n] * np.sqrt(np.maximum(variances[:n] - left, 0.0))[:, None]
    rest = rows - rows @ axes[:n].T @ axes[:n]
    deviations = np.sqrt((rest**2).mean(axis=0).reshape(-1, 2).mean(axis=1) + left)
    return LandmarkErrors(mean, modes.reshape(n, -1, 2), np.maximum(deviations, _LEAST_DEVIATION))
