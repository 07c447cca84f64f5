"""Thumbnails of poses on the current face: drawn when they become visible, one per turn of the loop."""

import contextlib
from collections.abc import Callable, Hashable
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray

from faceposer.files.images import open_image
from faceposer.files.reading import open_file
from faceposer.geometry.camera import Camera
from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.pictures import image_texture
from faceposer.poses.portrait import portrait_view
from faceposer.render.scene import Scene

# Supersampling factor each way; without a GPU this takes half as long as multisampling.
_SUPERSAMPLING = 2
_MOST_TEXTURES = 400
# Largest width and height in pixels of an image file that is read.
_LARGEST = 2048
_MAX_BYTES = 32 * 2**20
#: Width and height in pixels of the image next to a pose's file.
FILE_SIZE = 256

Array = NDArray[np.float64]


class Portraits:
    """Thumbnails as textures, kept until another face is shown."""

    def __init__(self, context: EditorContext, scene: Callable[[], Scene] | None = None) -> None:
        """Draw with the ``scene`` of another face, or with that of ``context``."""
        self._context = context
        self._scene = scene or (lambda: context.scene)
        self._textures: dict[Hashable, moderngl.Texture | None] = {}
        self._pending: dict[Hashable, Callable[[], NDArray[np.uint8] | None]] = {}
        self._discarded: list[moderngl.Texture | None] = []

    @property
    def waiting(self) -> bool:
        """True if thumbnails are still to be drawn."""
        return bool(self._pending)

    def of_pose(self, key: Hashable, pose: Callable[[], Array], size: int) -> int | None:
        """Return the texture of a pose, or None until it is drawn.

        Args:
            key: Identifier of the pose.
            pose: Callable that returns its coefficients, shape (r,).
            size: Width and height in pixels.
        """
        drawn = (key, size, self._scene().expression_lines)
        return self._get(drawn, lambda: self.draw(pose(), size))

    def of_file(self, path: Path, stamp: int) -> int | None:
        """Return the texture of the image file ``path``, or None until it is read or if it cannot be read."""
        return self._get((path, stamp), lambda: _read(path))

    def of_vertices(self, key: Hashable, vertices: Callable[[], NDArray[np.float32]], size: int) -> int | None:
        """Return the texture of vertices of the face, shape (N, 3), or None until it is drawn; see ``of_pose``."""
        return self._get((key, size), lambda: self._drawn(vertices(), size))

    def draw(self, coefficients: Array, size: int) -> NDArray[np.uint8]:
        """Return the image of a pose, shape (size, size, 3)."""
        return _halved(self._scene().portrait(coefficients, self._camera(size), 0))

    def _drawn(self, vertices: NDArray[np.float32], size: int) -> NDArray[np.uint8]:
        return _halved(self._scene().portrait_of(vertices, self._camera(size), 0))

    def _camera(self, size: int) -> Camera:
        return portrait_view(self._scene().character).camera((_SUPERSAMPLING * size, _SUPERSAMPLING * size))

    def _get(self, key: Hashable, image: Callable[[], NDArray[np.uint8] | None]) -> int | None:
        if key not in self._textures:
            self._pending[key] = image
            return None
        # Reinsert the texture, so that the least recently used one is discarded first.
        texture = self._textures[key] = self._textures.pop(key)
        return None if texture is None else texture.glo

    def draw_next(self) -> None:
        """Draw the next pending thumbnail."""
        self._release_discarded()
        if not self._pending:
            return
        key = next(iter(self._pending))
        image = self._pending.pop(key)()
        self._textures[key] = None if image is None else image_texture(self._context.gl, image)
        while len(self._textures) > _MOST_TEXTURES:
            self._discarded.append(self._textures.pop(next(iter(self._textures))))
        self._context.redraw(2)

    def forget(self) -> None:
        """Discard all thumbnails."""
        self._pending.clear()
        # The current frame may still draw them.
        self._discarded += self._textures.values()
        self._textures.clear()

    def release(self) -> None:
        """Release all textures."""
        self.forget()
        self._release_discarded()

    def _release_discarded(self) -> None:
        for texture in self._discarded:
            if texture is not None:
                texture.release()
        self._discarded.clear()


def _halved(fine: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the means of squares of pixels of the supersampled image ``fine``."""
    size = len(fine) // _SUPERSAMPLING
    blocks = fine.reshape(size, _SUPERSAMPLING, size, _SUPERSAMPLING, 3).astype(np.float32)
    return np.rint(blocks.mean(axis=(1, 3))).astype(np.uint8)


def _read(path: Path) -> NDArray[np.uint8] | None:
    # The decoders of Pillow raise many kinds of errors for damaged files.
    with contextlib.suppress(Exception), open_file(path, _MAX_BYTES) as file, open_image(file) as image:
        if max(image.size) <= _LARGEST:
            return np.asarray(image.convert("RGB"))
    return None
