"""Vertex and index buffers of a character on the GPU, updated only if the face has changed."""

import io

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.errors import FacePoserError
from faceposer.files.images import open_image
from faceposer.model.character import Character
from faceposer.render.line_buffers import LineBuffers

# Textures of 8192 by 8192 pixels are common.
_MOST_PIXELS = 1 << 27


def is_software_renderer(ctx: moderngl.Context) -> bool:
    """Return True if the CPU renders, without a graphics card."""
    renderer = ctx.info["GL_RENDERER"].lower()
    return any(name in renderer for name in ("llvmpipe", "softpipe", "swiftshader", "swrast"))


class MeshBuffers:
    """Vertex and index buffers of one character.

    A vertex on a texture seam has several texture coordinates; the GPU allows one per vertex, so such vertices are
    duplicated. ``source`` maps every vertex of the buffers to the character's vertex.
    """

    def __init__(self, ctx: moderngl.Context, character: Character) -> None:
        """Upload the topology of ``character``; ``update`` must follow before anything is drawn."""
        self.character = character
        # Sorting pairs that are packed into single integers is several times faster than sorting rows.
        corners = character.triangles.ravel() * np.int64(len(character.uv)) + character.triangle_uvs.ravel()
        pairs, inverse = np.unique(corners, return_inverse=True)
        source, uv = np.divmod(pairs, len(character.uv))
        self.source: NDArray[np.intp] = source.astype(np.intp)
        indices = inverse.astype(np.int32)
        self._staging = np.empty((len(pairs), 6), dtype=np.float32)
        self.points = ctx.buffer(reserve=self._staging.nbytes, dynamic=True)
        self.uvs = ctx.buffer(np.ascontiguousarray(character.uv[uv], dtype=np.float32))
        self.triangles = ctx.buffer(indices)
        first_use = np.full(len(character.vertices), -1, dtype=np.int32)
        first_use[self.source[::-1]] = np.arange(len(pairs), dtype=np.int32)[::-1]
        self.edges = ctx.buffer(np.ascontiguousarray(first_use[_edges(character)]))
        self.textures = {name: _texture(ctx, data) for name, data in character.textures.items()}
        self.lines = LineBuffers(ctx, character, self.source, indices.reshape(-1, 3))
        self._revision: object = None

    def update(self, vertices: NDArray[np.float32], normals: NDArray[np.float32], revision: object) -> bool:
        """Upload positions and normals, each (N, 3); return False if ``revision`` is the uploaded one already."""
        if revision is not None and revision == self._revision:
            return False
        np.take(vertices, self.source, axis=0, out=self._staging[:, :3])
        np.take(normals, self.source, axis=0, out=self._staging[:, 3:])
        self.points.write(self._staging)
        self.lines.update(vertices)
        self._revision = revision
        return True

    def release(self) -> None:
        """Free the memory on the GPU."""
        for buffer in (self.points, self.uvs, self.triangles, self.edges):
            buffer.release()
        self.lines.release()
        for texture in self.textures.values():
            texture.release()


def _edges(character: Character) -> NDArray[np.int32]:
    """Return the edges of the polygons, each once, as vertex pairs of shape (E, 2)."""
    polygons = character.polygons
    next_corners = np.roll(polygons, -1, axis=1)
    is_triangle = polygons[:, 3] < 0
    next_corners[is_triangle, 2] = polygons[is_triangle, 0]
    lower, upper = np.minimum(polygons, next_corners), np.maximum(polygons, next_corners)
    count = np.int64(len(character.vertices))
    pairs = np.unique((lower * count + upper)[lower >= 0])
    return np.stack(np.divmod(pairs, count), axis=1).astype(np.int32)


def _texture(ctx: moderngl.Context, data: bytes) -> moderngl.Texture:
    try:
        with open_image(io.BytesIO(data)) as encoded:
            if encoded.width * encoded.height > _MOST_PIXELS:
                raise ValueError
            image = encoded.convert("RGBA" if encoded.mode in ("RGBA", "LA", "P") else "RGB")
    except Exception as error:  # the decoders of Pillow raise many kinds of errors
        raise FacePoserError(
            "A texture of the character is damaged or too large, so that it cannot be drawn; import it again."
        ) from error
    image = image.transpose(Image.Transpose.FLIP_TOP_BOTTOM)
    texture = ctx.texture(image.size, len(image.getbands()), image.tobytes(), alignment=1)
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    if not is_software_renderer(ctx):
        # Mesa's software renderer takes many seconds for some triangles seen edge-on.
        texture.anisotropy = 4.0
    return texture
