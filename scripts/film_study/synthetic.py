"""Synthetic films of heads that are known: random people, captured motion, moving heads, encoded as MPEG-4."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.identity.photos.face_camera import rotation_of
from faceposer.landmarks.painting import painted_parts
from faceposer.model.character import Character
from scripts.photo_study.lights import PhongLight
from scripts.photo_study.synthetic import Person, shaded, soft_background

Array = NDArray[np.float64]

# Turn of the head about each axis in radians, and its motion in centimetres, as standard deviations.
_TURNS, _SHIFTS = np.array([0.12, 0.25, 0.06]), np.array([0.8, 0.6, 1.0])
# Seconds of the slowest motion of the head, and the number of its harmonics.
_SLOWEST, _HARMONICS = 6.0, 5


@dataclass(frozen=True, eq=False)
class KnownFilm:
    """A film whose truth is known.

    Attributes:
        frames: Its pictures, before they are encoded, shape (F, h, w, 3).
        weights: Weights of the shapes, shape (F, S).
        cameras: Its cameras.
    """

    frames: list[NDArray[np.uint8]]
    weights: Array
    cameras: list[Camera]


def draw_film(person: Person, base: Character, weights: Array, rate: float, seed: int, size: int = 480) -> KnownFilm:
    """Return a film of ``person`` with the expressions ``weights``, (F, S), and a moving head."""
    rng = np.random.default_rng(seed)
    turns, shifts = (_motion(len(weights), rate, spread, rng) for spread in (_TURNS, _SHIFTS))
    focal = size * 2.0 * math.exp(rng.normal(0.0, 0.2))
    depth = focal * 27.0 * math.exp(rng.normal(0.0, 0.1)) / size
    across = rotation_of(np.array([0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)])) @ np.array([0.0, 1.0, 0.0])
    tilt = rng.uniform(0.2, 1.1)
    lamp = math.sin(tilt) * across + math.cos(tilt) * np.array([0.0, 0.0, -1.0])
    ambient = rng.uniform(0.2, 0.6) * np.exp(rng.normal(0.0, 0.08, 3))
    diffuse = rng.uniform(0.5, 1.1) * np.exp(rng.normal(0.0, 0.08, 3))
    light, background = PhongLight(lamp, ambient, diffuse, rng.uniform(0.0, 0.15)), soft_background(rng, size)
    middle = np.array([0.0, 1.0, 3.0])
    frames, cameras = [], []
    for w, turn, shift in zip(weights, turns, shifts, strict=True):
        vertices = person.vertices + np.tensordot(w, person.shapes, 1)
        mesh = painted_parts(vertices, base.polygons, base.uv, base.polygon_uvs, base.parts, person.textures)
        rotation = np.diag([1.0, -1.0, -1.0]) @ rotation_of(turn)
        camera = Camera(rotation, shift + (0.0, 0.0, depth) - rotation @ middle, focal, (size, size))
        image = shaded(mesh, camera, light, background, 1)
        noisy = np.clip(image + rng.normal(0.0, 0.008, image.shape), 0.0, 1.0)
        frames.append(np.rint(noisy * 255.0).astype(np.uint8))
        cameras.append(camera)
    return KnownFilm(frames, weights, cameras)


def encode(path: Path, frames: list[NDArray[np.uint8]], rate: float, codec: str = "mpeg4") -> None:
    """Write ``frames`` as a film at about 4 megabits per second."""
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=round(rate))
        stream.width, stream.height, stream.pix_fmt = frames[0].shape[1], frames[0].shape[0], "yuv420p"
        stream.bit_rate = 4_000_000
        for pixels in frames:
            for packet in stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)


def _motion(count: int, rate: float, spread: Array, rng: np.random.Generator) -> Array:
    """Return a smooth random motion with standard deviations ``spread``, (k,), shape (count, k)."""
    times = np.arange(count) / rate
    total = np.zeros((count, len(spread)))
    power = 0.0
    for harmonic in range(1, _HARMONICS + 1):
        share = 1.0 / harmonic**1.5
        phases = rng.uniform(0.0, 2.0 * np.pi, len(spread))
        total += share * np.sin(2.0 * np.pi * harmonic * times[:, None] / _SLOWEST + phases)
        power += 0.5 * share**2
    return spread * total / math.sqrt(power)
