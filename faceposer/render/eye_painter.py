"""Draws eyeballs and lashes, which have shaders of their own."""

from typing import Any

import moderngl

from faceposer.geometry.camera import Camera
from faceposer.model.character import Part
from faceposer.model.materials import BASE_COLOURS
from faceposer.render.eye_shading import EyeShading
from faceposer.render.mesh_buffers import MeshBuffers


class EyePainter:
    """The eyes of one character at a time.

    Attributes:
        programs: That of eyeballs and that of lashes; whoever draws sets their matrices.
        camera: Under which they are drawn; None before the first picture.
        shading: Follows the eyes; None before there is a character.
    """

    def __init__(self, ctx: moderngl.Context, eye: moderngl.Program, lashes: moderngl.Program) -> None:
        """Draw with the programs ``eye`` and ``lashes``, which are released with the painter."""
        self._ctx = ctx
        self.programs = (eye, lashes)
        self._arrays: dict[str, moderngl.VertexArray] = {}
        self.camera: Camera | None = None
        self.shading: EyeShading | None = None

    def set_buffers(self, buffers: MeshBuffers) -> None:
        """Draw the eyes of the character of ``buffers`` from now on."""
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
        """Draw the triangles of ``part``, from first to before last, if it is eye or lashes; return whether it is."""
        if self.shading is None or self.camera is None or part.material not in self._arrays:
            return False
        eye, lashes = self.programs
        program = eye if part.material == "eye" else lashes
        if program is lashes:
            _set(lashes, seen=self.shading.lashes_seen(part, self.camera))
        else:
            ball = self.shading.eyes[part.name]
            _set(eye, centre=tuple(ball.centre.tolist()), radius=ball.radius, own_picture=ball.own_picture)
            # GLSL keeps matrices by columns.
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
        """Free what belongs to the character."""
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
    """Set uniforms, those left out that the compiler has found not to be needed."""
    for name, value in values.items():
        if name in program:
            program[name].value = value  # type: ignore[union-attr]
