"""Eyes in any colour: the iris of the built-in man's eye texture, tinted."""

import io
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.errors import FacePoserError
from faceposer.identity.skin_layers import Colour
from faceposer.model.character_file import load_character

#: Distance from the middle of the texture, as a share of its width, at which the iris ends, and width of its edge.
_IRIS, _EDGE = 0.118, 0.006
#: Brown, hazel, green, blue and grey eyes, sRGB.
EYE_COLOURS: dict[str, Colour] = {
    "dark brown": (0.16, 0.09, 0.055),
    "brown": (0.30, 0.18, 0.10),
    "hazel": (0.42, 0.32, 0.17),
    "green": (0.38, 0.43, 0.30),
    "blue": (0.42, 0.50, 0.58),
    "grey": (0.47, 0.49, 0.50),
}


def eye_texture(colour: Colour, whites: Colour = (1.0, 1.0, 1.0)) -> bytes:
    """Return the encoded texture of eyes whose iris has the mean ``colour``, sRGB 0..1, with fibres and dark rim.

    The whites are those of the built-in man times ``whites``.

    Raises:
        FacePoserError: If a colour is not finite, or the built-in man cannot be read.
    """
    wanted, factors = np.asarray(colour, dtype=np.float64), np.asarray(whites, dtype=np.float64)
    if wanted.shape != (3,) or factors.shape != (3,) or not np.isfinite([*wanted, *factors]).all():
        raise FacePoserError("The colour of eyes must be three finite numbers.")
    pixels, share, brightness = _iris()
    tinted = np.clip(brightness[..., None] * np.clip(wanted, 0.0, 1.0).astype(np.float32) * 255.0, 0.0, 255.0)
    white = np.clip(pixels * factors.astype(np.float32), 0.0, 255.0)
    image = white + share[..., None] * (tinted - white)
    buffer = io.BytesIO()
    Image.fromarray(np.rint(image).astype(np.uint8)).save(buffer, "JPEG", quality=92, subsampling=0)
    return buffer.getvalue()


def eye_whites() -> Colour:
    """Return the mean colour of the built-in man's whites of eyes beside the iris, sRGB 0..1."""
    pixels, _, _ = _iris()
    height, width = pixels.shape[:2]
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    radius = np.hypot((columns + 0.5) / width - 0.5, (rows + 0.5) / height - 0.5)
    red, green, blue = (pixels[(radius > 1.2 * _IRIS) & (radius < 2.0 * _IRIS)].mean(axis=0) / 255.0).tolist()
    return (red, green, blue)


def random_eye_colour(seed: int, tone: float) -> Colour:
    """Return an eye colour that suits a skin of ``tone``, in standard deviations: light eyes only in light skin."""
    names = list(EYE_COLOURS)
    rng = np.random.default_rng(seed)
    if rng.random() < np.clip(0.45 - 0.9 * tone, 0.0, 0.75):
        return EYE_COLOURS[names[int(rng.integers(2, len(names)))]]
    return EYE_COLOURS["dark brown" if tone > 0.3 or rng.random() < 0.4 else "brown"]


@lru_cache(maxsize=1)
def _iris() -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return the man's texture, the share of the iris in each texel, and its brightness relative to the iris' mean."""
    picture = Image.open(io.BytesIO(load_character("man").textures["eye"])).convert("RGB")
    pixels = np.asarray(picture, dtype=np.float32)
    height, width = pixels.shape[:2]
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    radius = np.hypot((columns + 0.5) / width - 0.5, (rows + 0.5) / height - 0.5)
    share = np.clip((_IRIS + _EDGE - radius) / _EDGE, 0.0, 1.0)
    brightness = pixels @ np.array([0.3, 0.55, 0.15], dtype=np.float32)
    ring = (radius > 0.5 * _IRIS) & (radius < 0.8 * _IRIS)
    return pixels, share.astype(np.float32), (brightness / brightness[ring].mean()).astype(np.float32)
