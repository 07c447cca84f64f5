"""Writers of image files, each written atomically."""

from collections.abc import Callable, Sequence
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.files.atomic import atomic_file

# Size of an animation's shared palette; recordings of the window gain nothing from more colours.
_COLOURS = 160


def write_png(path: Path, image: NDArray[np.uint8]) -> None:
    """Write ``image``, shape (height, width, 3), or 4 channels with straight alpha, as PNG.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    _write(path, lambda temporary: Image.fromarray(image).save(temporary, format="PNG", compress_level=6))


def write_animation(path: Path, images: Sequence[Image.Image], milliseconds: Sequence[int]) -> None:
    """Write ``images``, at least one, as an endless GIF that shows each for its ``milliseconds``.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    palette = shared_palette([images[i] for i in (0, len(images) // 2, -1)])
    write_palette_images(path, [with_palette(image, palette) for image in images], milliseconds)


def shared_palette(samples: Sequence[Image.Image], colours: int = _COLOURS, keep_rare: bool = False) -> Image.Image:
    """Return an image with a palette for all frames of an animation.

    Separate palettes would make static parts flicker.

    Args:
        samples: The most different frames, of the same size.
        colours: Number of colours.
        keep_rare: Preserve the colours of small areas, such as lips, at the cost of fine gradations in large areas.
    """
    strip = Image.new("RGB", (samples[0].width, sum(sample.height for sample in samples)))
    for i, sample in enumerate(samples):
        strip.paste(sample, (0, i * samples[0].height))
    if keep_rare:
        return strip.quantize(colours, Image.Quantize.MAXCOVERAGE, kmeans=2)
    return strip.quantize(colours, Image.Quantize.MEDIANCUT)


def with_palette(image: Image.Image, palette: Image.Image) -> Image.Image:
    """Convert ``image`` to the colours of ``palette``, which takes a third of the memory."""
    return image.quantize(palette=palette, dither=Image.Dither.NONE)


def write_palette_images(path: Path, images: Sequence[Image.Image], milliseconds: Sequence[int]) -> None:
    """Write ``images`` with a common palette, at least one, as ``write_animation`` does.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    first, *others = images
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
    with atomic_file(path, "image") as temporary:
        save(temporary)


def drawn_pixels(ctx: moderngl.Context, size: tuple[int, int], draw: Callable[[], None]) -> NDArray[np.uint8]:
    """Return the image that ``draw`` renders to ``size`` pixels, top row first, shape (height, width, 3)."""
    buffer = ctx.simple_framebuffer(size, 3)
    buffer.use()
    buffer.clear(0.0, 0.0, 0.0, 1.0)
    draw()
    data = np.frombuffer(buffer.read(components=3, alignment=1), dtype=np.uint8)
    buffer.release()
    ctx.screen.use()
    return np.ascontiguousarray(data.reshape(size[1], size[0], 3)[::-1])
