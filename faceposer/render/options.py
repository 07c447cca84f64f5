"""Options of everything that shows or writes a posed face."""

from dataclasses import dataclass
from typing import Literal

from faceposer.geometry.picture_view import View

Shading = Literal["full", "clay"]
#: What lies behind the face: the usual grey, darker, or lighter.
Backdrop = Literal["studio", "dark", "light"]


@dataclass(frozen=True)
class Look:
    """The light and what lies behind the face.

    Attributes:
        backdrop: The backdrop.
        key: Factor on the light from the front, at least 0.
        ambient: Factor on the light from all sides, at least 0.
    """

    backdrop: Backdrop = "studio"
    key: float = 1.0
    ambient: float = 1.0


@dataclass(frozen=True)
class OutputOptions:
    """How a posed face is written.

    Attributes:
        contact: Whether meshes and pictures show the face after the contact step; weights and morph targets have none.
        size: Width and height of pictures in pixels.
        view: Name of the view that pictures begin with, one of geometry.camera.VIEW_ANGLES.
        turn: Seconds of one turn of the camera about the head, 0 to stand still.
        rate: Frames per second of films, None for what suits the format and the performance.
        shading: "full", or "clay" without textures.
        orbit: The view itself; in place of ``view`` where the camera stands still.
        expression_lines: Draw the lines of the skin that a pose makes; clay has none.
        transparent: Leave the background out of pictures; not for films.
        materials: Write materials and textures beside meshes whose format has them in files of their own.
    """

    size: tuple[int, int] = (640, 640)
    view: str = "front"
    turn: float = 0.0
    rate: float | None = None
    shading: Shading = "full"
    orbit: View | None = None
    expression_lines: bool = True
    contact: bool = True
    transparent: bool = False
    materials: bool = True
