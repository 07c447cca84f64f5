"""Pictures without a window."""

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
    """Give an OpenGL context without a window.

    Raises:
        FacePoserError: If the system has no OpenGL through EGL.
    """
    try:
        ctx = moderngl.create_context(standalone=True, require=330, backend="egl")  # type: ignore[arg-type]
    except Exception as error:  # glcontext raises plain Exception
        raise FacePoserError(
            f"OpenGL 3.3 through EGL is not to be had ({error}); on Debian install libegl1 and libgl1-mesa-dri."
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
    """Return a picture of ``character`` with ``vertices``, (N, 3), under ``camera``, of shape (height, width, 3).

    Args:
        character: What is drawn.
        vertices: Its pose.
        camera: Whose size is that of the picture.
        samples: Per pixel; 0 for no multisampling.
        shading: Skin, eyes and teeth, or clay.
        wireframe: Draw the edges of the mesh too.
        photo: The pixels of a photo, top row first, its camera, and its opacity behind the face and before it.
        expression_lines: Draw the lines of the skin that the pose makes; clay has none.
        transparent: Leave the background out; the shape is (height, width, 4) then, with straight alpha.

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
            picture, taken, behind, before = photo
            layer = PhotoLayer(photo_texture(ctx, picture), taken.size, taken.focal, behind, before)
        renderer.draw(target.framebuffer, camera, shading, wireframe, layer, expression_lines, transparent)
        if layer is not None:
            layer.picture.release()
        target.resolve()
        picture = target.read_transparent() if transparent else target.read()
        target.release()
        renderer.release()
    return picture


def photo_texture(ctx: moderngl.Context, picture: NDArray[np.uint8]) -> moderngl.Texture:
    """Return ``picture``, (height, width, 3), on the GPU, smooth however small it is shown."""
    height, width, _ = picture.shape
    texture = ctx.texture((width, height), 3, np.ascontiguousarray(picture).tobytes(), alignment=1)
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    return texture


def plain_character(vertices: ArrayLike, triangles: ArrayLike) -> Character:
    """Return a mesh, (N, 3) and (T, 3), as a character of one part without shapes or textures."""
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
    """Return a picture of a plain mesh, (N, 3) and (T, 3), in clay, of shape (height, width, 3), or 4 with alpha."""
    character = plain_character(vertices, triangles)
    return render_character(character, character.vertices, camera, samples, "clay", transparent=transparent)
