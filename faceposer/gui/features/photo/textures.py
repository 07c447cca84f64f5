"""Photos as textures, read when they are first shown."""

from contextlib import suppress
from pathlib import Path

import moderngl

from faceposer.errors import FacePoserError
from faceposer.photo.reading import read_photo
from faceposer.render.offscreen import photo_texture

# Longer side of a texture: supported by ordinary GPUs, and larger than most displays.
_LARGEST = 4096
# Textures kept, so that switching between photos takes no time.
_MOST_TEXTURES = 4


class PhotoTextures:
    """Textures of photos by path."""

    def __init__(self) -> None:
        self._textures: dict[str, moderngl.Texture | None] = {}

    def texture(self, gl: moderngl.Context, path: str) -> moderngl.Texture | None:
        """Return the texture of the photo ``path``, or None if its file cannot be read."""
        if path not in self._textures:
            # A file that cannot be read is not read again in every frame.
            self._textures[path] = None
            with suppress(FacePoserError):
                self._textures[path] = photo_texture(gl, read_photo(Path(path), _LARGEST))
        return self._textures[path]

    def trim(self, kept: str) -> None:
        """Release textures other than that of the photo ``kept`` if there are many."""
        if len(self._textures) > _MOST_TEXTURES:
            self.release(kept)

    def release(self, kept: str = "") -> None:
        """Release all textures but that of the photo ``kept``."""
        for path in [path for path in self._textures if path != kept]:
            texture = self._textures.pop(path)
            if texture is not None:
                texture.release()
