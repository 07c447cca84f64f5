"""Choices of the export dialog."""

from dataclasses import dataclass


@dataclass
class ExportForm:
    """Choices of the export dialog, kept until the next export.

    Attributes:
        suffix: Suffix of the format.
        animated: True to export the animation, if there is one, in place of the pose.
        width: Width of images in pixels.
        height: Height of images in pixels.
        turning: True if the camera rotates around the head while the animation plays; for a pose it always does.
        seconds: Duration of a turn in seconds.
        rate: Frames per second of videos; None for the usual rate of the format and the animation.
        transparent: True if images have an alpha channel in place of the background.
    """

    suffix: str = ".glb"
    animated: bool = True
    width: int = 640
    height: int = 640
    turning: bool = False
    seconds: float = 4.0
    rate: int | None = None
    transparent: bool = False
