"""Small pictures of poses on the face that is shown: drawn when they are looked at, one in a turn of the loop."""

import contextlib
from collections.abc import Callable, Hashable
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.gui.context import EditorContext
from faceposer.poses.portrait import portrait_view

# Drawn so many times as large each way and averaged: without a GPU that takes half as long as multisampling.
_FINER = 2
_MOST_KEPT = 400
# Pixels each way of a picture file that is worth a look.
_LARGEST = 2048
#: Pixels each way of the picture beside a pose's file.
FILE_SIZE = 256

Array = NDArray[np.float64]


class Portraits:
    """Pictures as textures, kept until another face is shown."""

    def __init__(self, context: EditorContext) -> None:
        """Draw by the scene of ``context``."""
        self._context = context
        self._kept: dict[Hashable, moderngl.Texture | None] = {}
        self._wanted: dict[Hashable, Callable[[], NDArray[np.uint8] | None]] = {}
        self._old: list[moderngl.Texture | None] = []

    @property
    def waiting(self) -> bool:
        """Whether any is still to be drawn."""
        return bool(self._wanted)

    def of_pose(self, key: Hashable, pose: Callable[[], Array], size: int) -> int | None:
        """Return the texture with the picture of the coefficients that ``pose`` gives, or None until it is drawn."""
        drawn = (key, size, self._context.scene.expression_lines)
        return self._get(drawn, lambda: self.draw(pose(), size))

    def of_file(self, path: Path, stamp: int) -> int | None:
        """Return the texture with the picture in the file ``path``, or None until it is read and where it is none."""
        return self._get((path, stamp), lambda: _read(path))

    def draw(self, coefficients: Array, size: int) -> NDArray[np.uint8]:
        """Return the picture of a pose, shape (size, size, 3)."""
        camera = portrait_view(self._context.session.model.character).camera((_FINER * size, _FINER * size))
        fine = self._context.scene.portrait(coefficients, camera, 0)
        blocks = fine.reshape(size, _FINER, size, _FINER, 3).astype(np.float32)
        return np.rint(blocks.mean(axis=(1, 3))).astype(np.uint8)

    def _get(self, key: Hashable, picture: Callable[[], NDArray[np.uint8] | None]) -> int | None:
        if key not in self._kept:
            self._wanted[key] = picture
            return None
        # Those that were asked for last are kept longest.
        texture = self._kept[key] = self._kept.pop(key)
        return None if texture is None else texture.glo

    def follow(self) -> None:
        """Draw one of the pictures that were asked for."""
        self._release_old()
        if not self._wanted:
            return
        key = next(iter(self._wanted))
        picture = self._wanted.pop(key)()
        self._kept[key] = None if picture is None else _texture(self._context.gl, picture)
        while len(self._kept) > _MOST_KEPT:
            self._old.append(self._kept.pop(next(iter(self._kept))))
        self._context.redraw(2)

    def forget(self) -> None:
        """Show none of the pictures any more."""
        self._wanted.clear()
        # The frame that is being put together may show them yet.
        self._old += self._kept.values()
        self._kept.clear()

    def release(self) -> None:
        """Free what the GPU holds."""
        self.forget()
        self._release_old()

    def _release_old(self) -> None:
        for texture in self._old:
            if texture is not None:
                texture.release()
        self._old.clear()


def _texture(ctx: moderngl.Context, picture: NDArray[np.uint8]) -> moderngl.Texture:
    height, width = picture.shape[:2]
    texture = ctx.texture((width, height), 3, np.ascontiguousarray(picture).tobytes(), alignment=1)
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    return texture


def _read(path: Path) -> NDArray[np.uint8] | None:
    with contextlib.suppress(OSError, ValueError, Image.DecompressionBombError), Image.open(path) as image:
        if max(image.size) <= _LARGEST:
            return np.asarray(image.convert("RGB"))
    return None
