"""Renderer of a posed character into a framebuffer."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.model.character import Character
from faceposer.model.character_checks import SEE_THROUGH
from faceposer.model.materials import BASE_COLOURS
from faceposer.render.eye_painter import EyePainter
from faceposer.render.mesh_buffers import MeshBuffers
from faceposer.render.neck_fade import NO_FADE, neck_fade
from faceposer.render.options import Backdrop, Look, Shading
from faceposer.resources import shader_text

#: One program, or several programs with the same uniforms.
Programs = moderngl.Program | Sequence[moderngl.Program]
_BASE = {"clay": (0.42, 0.42, 0.43), **BASE_COLOURS}
_MATERIALS = ("clay", "skin", "eye", "teeth", "gums", "tongue", "lashes")


# Linear colours of the backdrop, at the rim and at the centre.
_BACKDROPS: dict[Backdrop, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "studio": ((0.016, 0.018, 0.022), (0.085, 0.092, 0.104)),
    "dark": ((0.003, 0.003, 0.004), (0.012, 0.013, 0.015)),
    "light": ((0.340, 0.345, 0.355), (0.660, 0.665, 0.675)),
}
_DEFAULT_LOOK = Look()


@dataclass(frozen=True)
class PhotoLayer:
    """A photo behind and in front of the face, centred on the principal point of the camera.

    Attributes:
        picture: Texture of the photo, top row first.
        size: Width and height of the photo, in pixels of its camera.
        focal: Focal length of that camera, in its pixels.
        behind: Opacity of the photo behind the face, 0 to 1.
        before: Opacity of the photo in front of the face, 0 to 1.
        left: Texture that alone is shown on the left of a line across the image, or None.
        split: Where that line is, as a share of the width of the image.
    """

    picture: moderngl.Texture
    size: tuple[int, int]
    focal: float
    behind: float
    before: float
    left: moderngl.Texture | None = None
    split: float = 0.0

    def corners(self, camera: Camera) -> tuple[float, float, float, float]:
        """Return left, top, right and bottom of the photo in the pixels of ``camera``."""
        scale = camera.focal / self.focal
        x, y = camera.principal_point.tolist()
        half_width, half_height = 0.5 * scale * self.size[0], 0.5 * scale * self.size[1]
        return (x - half_width, y - half_height, x + half_width, y + half_height)


def projection_matrix(camera: Camera) -> NDArray[np.float32]:
    """Return the matrix from camera space (y down, z forward) to clip space, shape (4, 4)."""
    width, height = camera.size
    depth = float(np.linalg.norm(camera.center)) + 1.0
    near, far = max(0.02 * depth, 0.1), 4.0 * depth + 200.0
    matrix = np.zeros((4, 4), dtype=np.float32)
    matrix[0, 0] = 2.0 * camera.focal / width
    matrix[1, 1] = -2.0 * camera.focal / height
    matrix[0, 2] = 2.0 * camera.shift[0] / width
    matrix[1, 2] = -2.0 * camera.shift[1] / height
    matrix[2, 2] = (far + near) / (far - near)
    matrix[2, 3] = -2.0 * far * near / (far - near)
    matrix[3, 2] = 1.0
    return matrix


def view_matrix(camera: Camera) -> NDArray[np.float32]:
    """Return the matrix from world to camera space, shape (4, 4)."""
    matrix = np.eye(4, dtype=np.float32)
    matrix[:3, :3], matrix[:3, 3] = camera.rotation, camera.translation
    return matrix


def load_program(ctx: moderngl.Context, vertex: str, fragment: str, define: str = "") -> moderngl.Program:
    """Compile a vertex and a fragment shader into a program.

    Args:
        ctx: OpenGL context.
        vertex: File name of the vertex shader; a line ``//#include NAME`` in it is replaced by that file.
        fragment: File name of the fragment shader, likewise.
        define: Preprocessor symbol to define, or "".
    """

    def source(name: str) -> str:
        version, *lines = shader_text(name).splitlines()
        included = [shader_text(line.split()[1]) if line.startswith("//#include ") else line for line in lines]
        return "\n".join([version, *([f"#define {define}"] if define else []), *included])

    return ctx.program(vertex_shader=source(vertex), fragment_shader=source(fragment))


def set_uniform(programs: Programs, name: str, value: Any) -> None:
    """Set a uniform of one or several programs, except where the compiler has removed it as unused."""
    for program in programs if isinstance(programs, Sequence) else (programs,):
        if name in program:
            if isinstance(value, np.ndarray):
                # GLSL stores matrices by columns.
                program[name].write(np.ascontiguousarray(value.T, dtype=np.float32))  # type: ignore[union-attr]
            else:
                program[name].value = value  # type: ignore[union-attr]


class Renderer:
    """Renderer of one character at a time; owns the programs and the character's buffers."""

    def __init__(self, ctx: moderngl.Context) -> None:
        """Compile the shaders in ``ctx``."""
        self.ctx = ctx
        # Programs without and with expression lines: on a CPU, even branches that are not taken cost time.
        self._surface = [load_program(ctx, "surface.vert", "surface.frag")]
        self._eyes = EyePainter(
            ctx, load_program(ctx, "eye.vert", "eye.frag"), load_program(ctx, "eye.vert", "lashes.frag")
        )
        self._background = load_program(ctx, "background.vert", "background.frag")
        self._edges = load_program(ctx, "edges.vert", "edges.frag")
        self._triangle_id = load_program(ctx, "triangle_id.vert", "triangle_id.frag")
        self._photo = load_program(ctx, "photo.vert", "photo.frag")
        self._photo_quad = ctx.vertex_array(self._photo, [])
        self._backdrop = ctx.vertex_array(self._background, [])
        self.buffers: MeshBuffers | None = None
        self._neck = NO_FADE
        self._arrays: dict[str, moderngl.VertexArray] = {}

    def set_character(self, character: Character) -> None:
        """Upload ``character``, which is drawn from now on."""
        self.release_character()
        buffers = self.buffers = MeshBuffers(self.ctx, character)
        self._eyes.set_buffers(buffers)
        self._neck = neck_fade(character)
        points = (buffers.points, "3f 3f", "position", "normal")
        bare = (buffers.points, "3f 3x4", "position")
        self._arrays = {
            "surface": self.ctx.vertex_array(
                self._surface[0], [points, (buffers.uvs, "2f", "uv")], index_buffer=buffers.triangles
            ),
            "id": self.ctx.vertex_array(self._triangle_id, [bare], index_buffer=buffers.triangles),
            "edges": self.ctx.vertex_array(self._edges, [bare], index_buffer=buffers.edges),
        }

    def update(self, vertices: NDArray[np.float32], normals: NDArray[np.float32], revision: object = None) -> None:
        """Upload a pose: positions and normals, each (N, 3); skipped if ``revision`` is the uploaded one."""
        if self._require_buffers().update(vertices, normals, revision) and self._eyes.shading is not None:
            self._eyes.shading.update(vertices)

    def draw(
        self,
        target: moderngl.Framebuffer,
        camera: Camera,
        shading: Shading = "full",
        wireframe: bool = False,
        photo: PhotoLayer | None = None,
        expression_lines: bool = True,
        transparent: bool = False,
        look: Look = _DEFAULT_LOOK,
    ) -> None:
        """Draw the backdrop and the character to the whole ``target``, which must have the size of the camera.

        Args:
            target: Framebuffer to draw to.
            camera: The camera.
            shading: "full", or "clay" without textures.
            wireframe: Also draw the edges of the mesh.
            photo: Photo behind or in front of the face; the neck fades into a photo behind it.
            expression_lines: Show the expression lines of the skin; clay shows none.
            transparent: Draw no backdrop; colours are premultiplied with alpha.
            look: Light and backdrop.
        """
        ctx, buffers = self.ctx, self._require_buffers()
        with_lines = expression_lines and shading == "full" and buffers.lines.use()
        if with_lines:
            # Must precede the uniforms, since it may add a program that needs them.
            self.prepare()
        target.use()
        ctx.viewport = (0, 0, *camera.size)
        target.clear(0.0, 0.0, 0.0, 0.0 if transparent else 1.0, depth=1.0)
        size = (float(camera.size[0]), float(camera.size[1]))
        ctx.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE | moderngl.BLEND)
        # Over a backdrop, the image remains opaque where surfaces are blended.
        alpha_factor = moderngl.ONE_MINUS_SRC_ALPHA if transparent else moderngl.ONE
        ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA, moderngl.ONE, alpha_factor  # type: ignore[assignment]
        for program in (self._background, *self._surface):
            set_uniform(program, "backdrop_rim", _BACKDROPS[look.backdrop][0])
            set_uniform(program, "backdrop_middle", _BACKDROPS[look.backdrop][1])
        for program in (*self._surface, *self._eyes.programs):
            set_uniform(program, "strength", (look.key, look.ambient))
        if not transparent:
            set_uniform(self._background, "viewport", size)
            self._backdrop.render(moderngl.TRIANGLES, vertices=3)
        if photo is not None and photo.behind > 0.0:
            self._draw_photo(photo, camera, photo.picture, photo.behind)
        fades = transparent or (photo is not None and photo.behind > 0.0)
        if fades:
            ctx.enable(moderngl.BLEND)

        ctx.enable(moderngl.DEPTH_TEST)
        ctx.depth_func = "<="
        for name, unit in buffers.lines.units.items():
            set_uniform(self._surface, name, unit)
        self._eyes.camera = camera
        for program in (*self._surface, *self._eyes.programs):
            self._set_camera(program, camera)
            set_uniform(program, "viewport", size)
        set_uniform(self._surface, "blended", fades)
        set_uniform(self._surface, "neck", self._neck.plane)
        set_uniform(self._surface, "neck_cut", self._neck.cut)
        set_uniform(self._surface, "mouth", _mouth_opening(buffers.character))
        if fades:
            # A depth pass first, so that only the nearest surface is blended.
            target.color_mask = (False, False, False, False)
            self._draw_parts(shading, opaque=True, with_lines=with_lines)
            target.color_mask = (True, True, True, True)
        self._draw_parts(shading, opaque=True, with_lines=with_lines)
        if wireframe:
            self._set_camera(self._edges, camera)
            ctx.enable(moderngl.BLEND)
            set_uniform(self._edges, "line", (0.0, 0.0, 0.0, 0.35))
            self._arrays["edges"].render(moderngl.LINES)
        ctx.enable(moderngl.BLEND)
        target.depth_mask = False
        self._draw_parts(shading, opaque=False)
        target.depth_mask = True
        ctx.disable(moderngl.DEPTH_TEST | moderngl.BLEND)
        if photo is not None:
            self._draw_before(photo, camera, target)

    def prepare(self) -> None:
        """Prepare in advance the data that would delay the first pose."""
        buffers = self._require_buffers()
        buffers.lines.prepare()
        if buffers.lines.triangles is None or "lined" in self._arrays:
            return
        if len(self._surface) == 1:
            self._surface.append(load_program(self.ctx, "surface.vert", "surface.frag", "EXPRESSION_LINES"))
        plain = [(buffers.points, "3f 3f", "position", "normal"), (buffers.uvs, "2f", "uv")]
        layouts = {"plain": plain, "lined": [*plain, (buffers.lines.places, "3f", "line_coordinates")]}
        for program, (name, content) in zip(self._surface, layouts.items(), strict=True):
            self._arrays[name] = self.ctx.vertex_array(program, content, index_buffer=buffers.lines.triangles)

    def _draw_before(self, photo: PhotoLayer, camera: Camera, target: moderngl.Framebuffer) -> None:
        """Draw what is in front of the face: the photo, and that on the left of the line alone over the backdrop."""
        if photo.before > 0.0:
            self._draw_photo(photo, camera, photo.picture, photo.before)
        across = round(photo.split * camera.size[0])
        if photo.left is not None and across > 0:
            target.scissor = (0, 0, across, camera.size[1])
            self._backdrop.render(moderngl.TRIANGLES, vertices=3)
            self._draw_photo(photo, camera, photo.left, 1.0)
            target.scissor = None  # type: ignore[assignment]

    def _draw_photo(self, photo: PhotoLayer, camera: Camera, picture: moderngl.Texture, opacity: float) -> None:
        left, top, right, bottom = photo.corners(camera)
        width, height = camera.size
        corners = (2.0 * left / width - 1.0, 1.0 - 2.0 * bottom / height, 2.0 * right / width - 1.0)
        self.ctx.enable(moderngl.BLEND)
        set_uniform(self._photo, "corners", (*corners, 1.0 - 2.0 * top / height))
        set_uniform(self._photo, "opacity", opacity)
        picture.use(0)
        self._photo_quad.render(moderngl.TRIANGLE_STRIP, vertices=4)
        self.ctx.disable(moderngl.BLEND)

    def _draw_parts(self, shading: Shading, opaque: bool, with_lines: bool = False) -> None:
        buffers = self._require_buffers()
        character = buffers.character
        for part in character.parts:
            if part.material == "film" or (part.material == "lashes") == opaque:
                continue
            clay = shading == "clay" and part.material in ("skin", "lashes")
            if clay and part.material == "lashes":
                continue
            name = "clay" if clay else part.material
            texture = None if clay else buffers.textures.get(part.name, buffers.textures.get(part.material))
            if self._eyes.draw(part, character.part_triangles(part), texture):
                continue
            set_uniform(self._surface, "material", _MATERIALS.index(name))
            set_uniform(self._surface, "textured", texture is not None)
            set_uniform(self._surface, "base", _BASE[name])
            if texture is not None:
                texture.use(0)
            first, last = character.part_triangles(part)
            begin = buffers.lines.first_lined.get(part.name, last) if with_lines else last
            if begin == last:
                self._arrays["surface"].render(moderngl.TRIANGLES, vertices=3 * (last - first), first=3 * first)
            else:
                self._arrays["plain"].render(moderngl.TRIANGLES, vertices=3 * (begin - first), first=3 * first)
                self._arrays["lined"].render(moderngl.TRIANGLES, vertices=3 * (last - begin), first=3 * begin)

    def draw_ids(self, target: moderngl.Framebuffer, camera: Camera) -> None:
        """Write the index plus one of the nearest front-facing triangle to each pixel of ``target``, 0 without one.

        Lashes and transparent films are skipped, so that a click on them picks the lid behind.
        """
        character = self._require_buffers().character
        target.use()
        self.ctx.viewport = (0, 0, *camera.size)
        # OpenGL clears with floats; only zero has the same bits as an integer.
        target.clear(0.0, depth=1.0)
        self.ctx.enable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self.ctx.disable(moderngl.BLEND)
        self._set_camera(self._triangle_id, camera)
        for part in character.parts:
            if part.material not in SEE_THROUGH:
                first, last = character.part_triangles(part)
                set_uniform(self._triangle_id, "first", first)
                self._arrays["id"].render(moderngl.TRIANGLES, vertices=3 * (last - first), first=3 * first)
        self.ctx.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)

    def _set_camera(self, program: Programs, camera: Camera) -> None:
        set_uniform(program, "view", view_matrix(camera))
        set_uniform(program, "projection", projection_matrix(camera))

    def _require_buffers(self) -> MeshBuffers:
        if self.buffers is None:
            raise RuntimeError("set_character must be called before drawing")
        return self.buffers

    def release_character(self) -> None:
        """Free the buffers of the character."""
        for array in self._arrays.values():
            array.release()
        self._arrays = {}
        self._eyes.release_character()
        if self.buffers is not None:
            self.buffers.release()
            self.buffers = None

    def release(self) -> None:
        """Free everything."""
        self.release_character()
        self._backdrop.release()
        self._photo_quad.release()
        self._eyes.release()
        for program in (*self._surface, self._background, self._edges, self._triangle_id, self._photo):
            program.release()


def _mouth_opening(character: Character) -> tuple[float, float]:
    """Return the lower end of the upper teeth (y) and the front of the neutral teeth (z); the mouth darkens behind."""
    teeth = [character.vertices[slice(*part.vertices)] for part in character.parts if part.material == "teeth"]
    if not teeth:
        return float(character.vertices[:, 1].min()), float(character.vertices[:, 2].max())
    front = max(teeth, key=lambda vertices: float(vertices[:, 2].max()))
    foremost = front[front[:, 2] > front[:, 2].max() - 0.02 * character.height]
    return float(foremost[:, 1].min()), float(front[:, 2].max())
