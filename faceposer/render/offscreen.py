"""Rendering of images without a window."""

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals
from faceposer.model.character import Character, Part
from faceposer.render.framebuffers import ColourTarget
from faceposer.render.options import Shading
from faceposer.render.renderer import PhotoLayer, Renderer

Context = moderngl.Context


@contextmanager
def offscreen_context() -> Iterator[Context]:
    """Yield an OpenGL context without a window.

    Raises:
        FacePoserError: If the system has no OpenGL through EGL.
    """
    try:
        ctx = moderngl.create_context(standalone=True, require=330, backend="egl")  # type: ignore[arg-type]
    except Exception as error:  # glcontext raises plain Exception
        raise FacePoserError(
            f"OpenGL 3.3 is not available through EGL ({error}); on Debian, install libegl1 and libgl1-mesa-dri."
        ) from error
    try:
        yield ctx
    finally:
        ctx.release()


def render_character(
    character: Character,
    vertices: ArrayLike,
    camera: Camera,
    samples: int = 4,
    shading: Shading = "full",
    wireframe: bool = False,
    photo: tuple[NDArray[np.uint8], Camera, float, float] | None = None,
    expression_lines: bool = True,
    transparent: bool = False,
) -> NDArray[np.uint8]:
    """Render ``character`` with ``vertices``, shape (N, 3), as an image of shape (height, width, 3).

    Args:
        character: The character.
        vertices: Vertices of its pose.
        camera: Camera, whose size is that of the image.
        samples: Samples per pixel; 0 for no multisampling.
        shading: "full", or "clay" without textures.
        wireframe: Also draw the edges of the mesh.
        photo: Pixels of a photo, top row first, its camera, and its opacity behind and in front of the face.
        expression_lines: Show the expression lines of the skin; clay shows none.
        transparent: Make the background transparent; the shape is then (height, width, 4), with straight alpha.

    Raises:
        FacePoserError: If the system has no OpenGL through EGL.
    """
    positions = np.ascontiguousarray(vertices, dtype=np.float32)
    with offscreen_context() as ctx:
        renderer = Renderer(ctx)
        renderer.set_character(character)
        renderer.update(positions, VertexNormals(character.triangles, len(positions))(positions))
        target = ColourTarget(ctx, camera.size, min(samples, ctx.max_samples))
        layer = None
        if photo is not None:
            pixels, photo_camera, behind, before = photo
            layer = PhotoLayer(photo_texture(ctx, pixels), photo_camera.size, photo_camera.focal, behind, before)
        renderer.draw(target.framebuffer, camera, shading, wireframe, layer, expression_lines, transparent)
        if layer is not None:
            layer.picture.release()
        target.resolve()
        image = target.read_transparent() if transparent else target.read()
        target.release()
        renderer.release()
    return image


def photo_texture(ctx: moderngl.Context, pixels: NDArray[np.uint8]) -> moderngl.Texture:
    """Upload the photo ``pixels``, shape (height, width, 3), as a texture with mipmaps."""
    height, width, _ = pixels.shape
    texture = ctx.texture((width, height), 3, np.ascontiguousarray(pixels).tobytes(), alignment=1)
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    return texture


def plain_character(vertices: ArrayLike, triangles: ArrayLike) -> Character:
    """Return a character of one part, without shapes or textures, for a mesh, (N, 3) and (T, 3)."""
    positions = np.ascontiguousarray(vertices, dtype=np.float32)
    polygons = np.pad(np.asarray(triangles, dtype=np.int32), ((0, 0), (0, 1)), constant_values=-1)
    return Character(
        name="mesh",
        title="Mesh",
        vertices=positions,
        polygons=polygons,
        uv=np.zeros((1, 2), dtype=np.float32),
        polygon_uvs=np.where(polygons < 0, -1, 0).astype(np.int32),
        parts=(Part("skin", "skin", (0, len(polygons)), (0, len(positions))),),
        shape_names=(),
        shapes=np.zeros((0, len(positions), 3), dtype=np.float32),
    )


def render_mesh(
    vertices: ArrayLike, triangles: ArrayLike, camera: Camera, samples: int = 4, transparent: bool = False
) -> NDArray[np.uint8]:
    """Render a mesh, (N, 3) and (T, 3), in clay, with shape (height, width, 3), or 4 channels if transparent."""
    character = plain_character(vertices, triangles)
    return render_character(character, character.vertices, camera, samples, "clay", transparent=transparent)
