"""Images as textures for the widgets."""

import moderngl
import numpy as np
from numpy.typing import NDArray


def image_texture(ctx: moderngl.Context, image: NDArray[np.uint8]) -> moderngl.Texture:
    """Return a texture of ``image``, shape (h, w, 3), which is smooth when it is drawn smaller."""
    height, width = image.shape[:2]
    texture = ctx.texture((width, height), 3, np.ascontiguousarray(image).tobytes(), alignment=1)
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    return texture


class Picture:
    """The texture of the image that a dialog shows."""

    def __init__(self) -> None:
        self._image: NDArray[np.uint8] | None = None
        self._texture: moderngl.Texture | None = None
        self._discarded: list[moderngl.Texture] = []

    def texture(self, ctx: moderngl.Context, image: NDArray[np.uint8]) -> int:
        """Return the name of the texture of ``image``, uploaded once."""
        for old in self._discarded:
            old.release()
        self._discarded.clear()
        if self._texture is None or image is not self._image:
            self.forget()
            self._image, self._texture = image, image_texture(ctx, image)
        return int(self._texture.glo)

    def forget(self) -> None:
        """Forget the image; the current frame may still draw it."""
        if self._texture is not None:
            self._discarded.append(self._texture)
        self._image = self._texture = None

    def release(self) -> None:
        """Release the texture."""
        self.forget()
        for old in self._discarded:
            old.release()
        self._discarded.clear()
