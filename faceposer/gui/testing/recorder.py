"""Recording of the window as images with pointer and caption, and as an animation."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from faceposer.gui.widgets.theme import BAR, INK, Colour
from faceposer.render.images import write_animation, write_png
from faceposer.resources import fonts_folder

_ARROW = ((0.0, 0.0), (0.0, 17.0), (4.0, 13.5), (7.0, 19.5), (9.6, 18.3), (6.7, 12.6), (12.0, 12.4))
_ANIMATION_WIDTH = 640
_FRAME_MILLISECONDS = 80


class Recorder:
    """Recorder of a window.

    Attributes:
        caption: Caption of the following images.
        frames: Files written so far, in order.
        milliseconds: Time that each is shown.
    """

    def __init__(self, screenshot: Callable[[], NDArray[np.uint8]], folder: Path) -> None:
        """Record images from ``screenshot`` into ``folder``."""
        self.caption = ""
        self.frames: list[Path] = []
        self._screenshot = screenshot
        self._folder = folder
        self._font = ImageFont.truetype(str(fonts_folder() / "Roboto" / "Roboto-Regular.ttf"), 17)
        self._small: list[Image.Image] = []
        self.milliseconds: list[int] = []
        self._last = b""

    def take(self, pointer: tuple[float, float], pressed: bool) -> None:
        """Record the window with the pointer at ``pointer``, unless the image is the same as the last.

        Raises:
            FacePoserError: If the image cannot be written.
        """
        image = Image.fromarray(self._screenshot())
        draw = ImageDraw.Draw(image)
        self._draw_caption(draw, image.height)
        _draw_pointer(draw, pointer, pressed)
        data = image.tobytes()
        if data == self._last:
            return
        self._last = data
        path = self._folder / f"frame-{len(self.frames) + 1:03}.png"
        write_png(path, np.asarray(image))
        self.frames.append(path)
        height = round(image.height * _ANIMATION_WIDTH / image.width)
        self._small.append(image.resize((_ANIMATION_WIDTH, height), Image.Resampling.LANCZOS))
        self.milliseconds.append(_FRAME_MILLISECONDS)

    def hold(self, frames: int) -> None:
        """Show the last image in the animation for ``frames`` more frames."""
        self.milliseconds[-1] += frames * _FRAME_MILLISECONDS

    def write_animation(self, path: Path) -> Path:
        """Write the recording as an animated GIF.

        Raises:
            FacePoserError: If the file cannot be written.
        """
        write_animation(path, self._small, self.milliseconds)
        return path

    def _draw_caption(self, draw: ImageDraw.ImageDraw, height: int) -> None:
        if not self.caption:
            return
        left, bottom = 22.0, height - 52.0
        box = draw.textbbox((left, bottom), self.caption, font=self._font, anchor="ls")
        around = (box[0] - 12, bottom - 24, box[2] + 12, bottom + 12)
        draw.rounded_rectangle(around, 6, fill=_bytes(BAR))
        draw.text((left, bottom), self.caption, font=self._font, fill=_bytes(INK), anchor="ls")


def _draw_pointer(draw: ImageDraw.ImageDraw, pointer: tuple[float, float], pressed: bool) -> None:
    x, y = pointer
    if pressed:
        draw.ellipse((x - 11, y - 11, x + 11, y + 11), outline=(255, 255, 255), width=2)
    draw.polygon([(x + dx, y + dy) for dx, dy in _ARROW], fill=(255, 255, 255), outline=(20, 20, 20))


def _bytes(colour: Colour) -> tuple[int, int, int]:
    red, green, blue = (round(255 * value) for value in colour[:3])
    return (red, green, blue)
