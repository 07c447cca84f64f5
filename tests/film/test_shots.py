"""Cuts are found; flashes, pans and noise are none."""

import itertools

import numpy as np

from faceposer.film.shots import Shot, change, shots_of, thumbnail
from tests.film.films import Pixels, nobody


def shots(frames: list[Pixels]) -> list[Shot]:
    small = [thumbnail(frame) for frame in frames]
    changes = [0.0, *(change(before, now) for before, now in itertools.pairwise(small))]
    return shots_of(range(10, 10 + len(frames)), changes)


def scene(seed: int, count: int, pan: int = 0, noise: float = 3.0) -> list[Pixels]:
    """Return frames of a random scene over which the camera pans by ``pan`` pixels a frame."""
    rng = np.random.default_rng(seed)
    wide = np.kron(rng.uniform(0.0, 255.0, (6, 60, 3)), np.ones((20, 20, 1)))
    return [
        np.clip(wide[:, pan * k : pan * k + 200] + rng.normal(0.0, noise, (120, 200, 3)), 0, 255).astype(np.uint8)
        for k in range(count)
    ]


def test_cuts_begin_shots() -> None:
    assert shots([*scene(1, 6), *scene(2, 4), *scene(3, 5)]) == [Shot(10, 15), Shot(16, 19), Shot(20, 24)]


def test_pans_and_flashes_are_no_cuts() -> None:
    assert shots(scene(1, 20, pan=12)) == [Shot(10, 29)]
    frames = scene(1, 10)
    frames[4] = np.full_like(frames[4], 255)
    assert shots(frames) == [Shot(10, 19)]
    assert shots(nobody(4)) == [Shot(10, 13)]
