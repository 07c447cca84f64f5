"""Writes pictures to files, each all or nothing."""

from collections.abc import Callable, Sequence
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.files.atomic import atomic_file
from faceposer.render.framebuffers import ColourTarget

# Of an animation's shared palette: more would cost bytes without showing where most of it is a window.
_COLOURS = 160


def write_png(path: Path, picture: NDArray[np.uint8]) -> None:
    """Write ``picture``, shape (height, width, 3), or 4 with straight alpha, as PNG.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    _write(path, lambda temporary: Image.fromarray(picture).save(temporary, format="PNG", compress_level=6))


def write_animation(path: Path, pictures: Sequence[Image.Image], milliseconds: Sequence[int]) -> None:
    """Write ``pictures``, at least one, as an animated GIF that shows each for its ``milliseconds``, again and again.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    palette = shared_palette([pictures[i] for i in (0, len(pictures) // 2, -1)])
    write_reduced(path, [reduced(picture, palette) for picture in pictures], milliseconds)


def shared_palette(samples: Sequence[Image.Image], colours: int = _COLOURS, keep_rare: bool = False) -> Image.Image:
    """Return a picture with the palette for an animation that has ``samples``, of one size, at its most different.

    Palettes of their own would make still parts flicker. With ``keep_rare`` what covers little, as lips do, keeps its
    colour, at the cost of the fine steps of what covers much.
    """
    strip = Image.new("RGB", (samples[0].width, sum(sample.height for sample in samples)))
    for i, sample in enumerate(samples):
        strip.paste(sample, (0, i * samples[0].height))
    if keep_rare:
        return strip.quantize(colours, Image.Quantize.MAXCOVERAGE, kmeans=2)
    return strip.quantize(colours, Image.Quantize.MEDIANCUT)


def reduced(picture: Image.Image, palette: Image.Image) -> Image.Image:
    """Return ``picture`` in the colours of ``palette``, a third of its bytes."""
    return picture.quantize(palette=palette, dither=Image.Dither.NONE)


def write_reduced(path: Path, pictures: Sequence[Image.Image], milliseconds: Sequence[int]) -> None:
    """Write ``pictures`` of one palette, at least one, as ``write_animation`` does.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    first, *others = pictures
    _write(
        path,
        lambda temporary: first.save(
            temporary,
            format="GIF",
            save_all=True,
            append_images=others,
            duration=list(milliseconds),
            loop=0,
            optimize=False,
        ),
    )


def _write(path: Path, save: Callable[[Path], None]) -> None:
    with atomic_file(path, "picture") as temporary:
        save(temporary)


def drawn_pixels(ctx: moderngl.Context, size: tuple[int, int], draw: Callable[[], None]) -> NDArray[np.uint8]:
    """Return what ``draw`` draws into ``size`` pixels, top row first, shape (height, width, 3)."""
    # Unlike that of a simple framebuffer, its memory is all released.
    target = ColourTarget(ctx, size)
    try:
        target.framebuffer.use()
        target.framebuffer.clear(0.0, 0.0, 0.0, 1.0)
        draw()
        return target.read()
    finally:
        target.release()
        if ctx.screen is not None:
            ctx.screen.use()
