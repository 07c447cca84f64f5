"""Options for displaying and writing posed faces."""

from dataclasses import dataclass
from typing import Literal

from faceposer.geometry.picture_view import View

Shading = Literal["full", "clay"]
#: Brightness of the background: the default grey, darker, or lighter.
Backdrop = Literal["studio", "dark", "light"]


@dataclass(frozen=True)
class Look:
    """Light and backdrop.

    Attributes:
        backdrop: The backdrop.
        key: Factor on the key light from the front, at least 0.
        ambient: Factor on the ambient light, at least 0.
    """

    backdrop: Backdrop = "studio"
    key: float = 1.0
    ambient: float = 1.0


@dataclass(frozen=True)
class OutputOptions:
    """Options for writing a posed face.

    Attributes:
        size: Width and height of images in pixels.
        view: Name of the view of images, or of the first frame of a turn, one of geometry.camera.VIEW_ANGLES.
        turn: Duration of one turn of the camera around the head, in seconds; 0 for a fixed camera.
        rate: Frames per second of videos; None for a rate that suits the format and the performance.
        shading: "full", or "clay" without textures.
        orbit: View that replaces ``view`` if the camera is fixed.
        expression_lines: Show the expression lines of the skin; clay shows none.
        contact: Include the contact step in meshes and images; weights and morph targets cannot contain it.
        transparent: Make the background of images transparent; not for videos.
        materials: Write materials and textures as additional files if the format has them.
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
