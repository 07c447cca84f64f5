"""Photos made over as a painter would see them: other colours, strokes, and light that no lamp has."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Pixels = NDArray[np.uint8]

# Limits of the saturation, of the exponent of each channel, and of the strength of each channel, as of old varnish.
_SATURATION, _EXPONENT = (0.3, 1.3), (0.7, 1.5)
_VARNISH = np.array([[0.75, 0.6, 0.35], [1.0, 1.0, 1.0]])
# Width of strokes in pixels; deviation of the brightness over the picture, and its blur; that of the canvas.
_STROKE = 5
_SLOW, _SLOW_BLUR, _CANVAS, _CANVAS_BLUR = 0.12, 60.0, 0.05, 1.0


def painted(pixels: Pixels, rng: np.random.Generator) -> Pixels:
    """Return a photo, shape (h, w, 3), as a painting."""
    colours = pixels.astype(np.float64) / 255.0
    grey = colours.mean(axis=2, keepdims=True)
    colours = np.maximum(grey + (colours - grey) * rng.uniform(*_SATURATION), 0.0)
    colours = colours ** rng.uniform(*_EXPONENT, 3) * rng.uniform(*_VARNISH)
    colours = ndimage.median_filter(colours, size=(_STROKE, _STROKE, 1))
    for deviation, blur in ((_SLOW, _SLOW_BLUR), (_CANVAS, _CANVAS_BLUR)):
        noise = ndimage.gaussian_filter(rng.normal(size=colours.shape[:2]), blur)
        colours *= np.exp(deviation * noise / noise.std())[..., None]
    return np.clip(255.0 * colours, 0.0, 255.0).astype(np.uint8)
