"""Small films for tests, encoded when they are needed."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from faceposer.geometry.camera import OrbitView
from faceposer.landmarks.drawing import draw
from faceposer.landmarks.painting import painted_character
from faceposer.model.face_model import FaceModel
from tests.landmarks.photos import astronaut, grace_hopper

Pixels = NDArray[np.uint8]


def still_face(count: int, side: int = 200, shift: float = 1.5) -> list[Pixels]:
    """Return frames of the astronaut's face, over which the camera pans by ``shift`` pixels a frame and zooms."""
    image = Image.fromarray(astronaut())
    frames = []
    for k in range(count):
        half = 105.0 - 0.8 * k
        x, y = 222.0 + shift * k, 118.0
        frames.append(_crop(image, (x - half, y - half, x + half, y + half), side))
    return frames


def speaking_face(model: FaceModel, jaw: Sequence[float], side: int = 240) -> list[Pixels]:
    """Return frames of the character of ``model``, whose head turns and whose jaw is open by the weights ``jaw``."""
    frames = []
    for k, weight in enumerate(jaw):
        surface = model.surface(model.coefficients_of({"jawOpen": weight}))
        view = OrbitView((0.0, 1.0, 2.0), -0.15 + 0.3 * k / max(len(jaw) - 1, 1), 0.0)
        frames.append(draw(painted_character(model.character, surface), view.camera((side, side))).image)
    return frames


def other_face(count: int, side: int = 200) -> list[Pixels]:
    """Return frames of another person's face."""
    return [_crop(Image.fromarray(grace_hopper()), (130.0, 20.0, 400.0, 290.0), side)] * count


def nobody(count: int, side: int = 200) -> list[Pixels]:
    """Return frames without a face."""
    return [np.full((side, side, 3), (90, 120, 90), dtype=np.uint8)] * count


def _crop(image: Image.Image, box: tuple[float, float, float, float], side: int) -> Pixels:
    return np.asarray(image.resize((side, side), Image.Resampling.BICUBIC, box=box))


def encode(
    path: Path,
    frames: Sequence[Pixels],
    rate: int = 30,
    codec: str = "mpeg4",
    pixel_format: str = "yuv420p",
    times: Sequence[float] | None = None,
) -> Path:
    """Write ``frames`` as a film, at ``times`` in seconds if they are given, and return its path."""
    av = pytest.importorskip("av", reason="the extra 'film' is not installed")
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate)
        height, width = frames[0].shape[:2]
        stream.width, stream.height, stream.pix_fmt = width, height, pixel_format
        stream.bit_rate = 2_000_000
        ticks = Fraction(1, 1000)
        if times is not None:
            stream.codec_context.time_base = ticks
        for k, pixels in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
            if times is not None:
                frame.pts, frame.time_base = round(1000 * times[k]), ticks
            for packet in stream.encode(frame):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return path


def only_sound(path: Path) -> Path:
    """Write a file with a second of silence and no pictures, and return its path."""
    av = pytest.importorskip("av", reason="the extra 'film' is not installed")
    with av.open(str(path), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 8000), dtype=np.int16), format="s16", layout="mono")
        frame.sample_rate = 8000
        for packet in (*stream.encode(frame), *stream.encode()):
            container.mux(packet)
    return path


def turned_clockwise(path: Path) -> Path:
    """Write the display matrix of a phone held upright, a turn by 90 degrees clockwise, into the MP4 film ``path``."""
    data = bytearray(path.read_bytes())
    at = data.index(b"tkhd")
    matrix = at + (44 if data[at + 4] == 0 else 56)
    one = 0x00010000
    values = (0, one, 0, 0x100000000 - one, 0, 0, 0, 0, 0x40000000)
    data[matrix : matrix + 36] = b"".join(value.to_bytes(4, "big") for value in values)
    path.write_bytes(data)
    return path
