"""Rendering of eyeballs and lashes, which have separate shaders."""

from typing import Any

import moderngl

from faceposer.geometry.camera import Camera
from faceposer.model.character import Part
from faceposer.model.materials import BASE_COLOURS
from faceposer.render.eye_shading import EyeShading
from faceposer.render.mesh_buffers import MeshBuffers


class EyePainter:
    """Renderer of the eyes of one character at a time.

    Attributes:
        programs: Programs of eyeballs and lashes; the caller sets their matrices.
        camera: The camera; None before the first image.
        shading: Tracker of the eyes; None before a character is set.
    """

    def __init__(self, ctx: moderngl.Context, eye: moderngl.Program, lashes: moderngl.Program) -> None:
        """Initialise with the programs ``eye`` and ``lashes``, which are released with the painter."""
        self._ctx = ctx
        self.programs = (eye, lashes)
        self._arrays: dict[str, moderngl.VertexArray] = {}
        self.camera: Camera | None = None
        self.shading: EyeShading | None = None

    def set_buffers(self, buffers: MeshBuffers) -> None:
        """Use the eyes of the character in ``buffers`` from now on."""
        self.release_character()
        self.shading = EyeShading(buffers.character)
        uv = (buffers.uvs, "2f", "uv")
        eye, lashes = self.programs
        self._arrays = {
            material: self._ctx.vertex_array(program, [points, uv], index_buffer=buffers.triangles)
            for material, program, points in (
                ("eye", eye, (buffers.points, "3f 3f", "position", "normal")),
                ("lashes", lashes, (buffers.points, "3f 3x4", "position")),
            )
        }

    def draw(self, part: Part, triangles: tuple[int, int], texture: moderngl.Texture | None) -> bool:
        """Draw the ``triangles`` (first, last + 1) of ``part`` if it is an eye or lashes; return True if it is."""
        if self.shading is None or self.camera is None or part.material not in self._arrays:
            return False
        eye, lashes = self.programs
        program = eye if part.material == "eye" else lashes
        if program is lashes:
            _set(lashes, seen=self.shading.lashes_seen(part, self.camera))
        else:
            ball = self.shading.eyes[part.name]
            _set(eye, centre=tuple(ball.centre.tolist()), radius=ball.radius, own_picture=ball.own_picture)
            # GLSL stores matrices by columns.
            _set(eye, turn=tuple(ball.turn.T.ravel().tolist()))
            _set(eye, catchlight=tuple(ball.catchlight(self.camera).tolist()))
            _set(eye, corners=ball.corners, lids=[tuple(row) for row in ball.lids.tolist()])
        _set(program, textured=texture is not None, base=BASE_COLOURS[part.material])
        if texture is not None:
            texture.use(0)
        first, last = triangles
        self._arrays[part.material].render(moderngl.TRIANGLES, vertices=3 * (last - first), first=3 * first)
        return True

    def release_character(self) -> None:
        """Free the data of the character."""
        for array in self._arrays.values():
            array.release()
        self._arrays = {}
        self.shading = None

    def release(self) -> None:
        """Free everything."""
        self.release_character()
        for program in self.programs:
            program.release()


def _set(program: moderngl.Program, **values: Any) -> None:
    """Set uniforms, except those that the compiler has removed as unused."""
    for name, value in values.items():
        if name in program:
            program[name].value = value  # type: ignore[union-attr]
