"""What the tab "Photo" and its actions know of the photos of a session."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from faceposer.gui.context import EditorContext
from faceposer.gui.features.photo.expression import TakeExpression
from faceposer.gui.features.photo.putting_back import PuttingBack
from faceposer.gui.features.photo.wipe import Wipe
from faceposer.photo.photo import Photo, Place
from faceposer.tools.photo_tool import PhotoTool


class Photos(Protocol):
    """The photos of the session, as `PhotoFeature` has them.

    Attributes:
        context: The editor.
        expression: The expression of a photo, found in the background.
        putting_back: The photo with the face as it is now.
        wipe: The line between photo and face.
    """

    context: EditorContext
    expression: TakeExpression
    putting_back: PuttingBack
    wipe: Wipe

    @property
    def put_back_problem(self) -> str:
        """Why the face cannot be put back into the active photo, and what to do, one sentence; "" if it can."""
        ...

    def put_back(self) -> None:
        """Show the photo with the face put back, seen through its camera, or photo and face again."""

    def toggle_wipe(self) -> None:
        """Divide the view by a line between photo and face, seen through the photo's camera, or no longer."""

    @property
    def photos(self) -> tuple[Photo, ...]:
        """The photos of the session."""
        ...

    @property
    def tool(self) -> PhotoTool:
        """The tool that sets pins."""
        ...

    @property
    def active(self) -> int | None:
        """Index of the active photo, which the tab shows, or None."""
        ...

    @property
    def photo(self) -> Photo | None:
        """The active photo, or None."""
        ...

    @property
    def aligned(self) -> bool:
        """True if the view shows the photo and the face from the photo's camera."""
        ...

    @property
    def has_enough_pins(self) -> bool:
        """True if the photo has enough pins to determine its camera."""
        ...

    @property
    def readable(self) -> bool:
        """True if the file of the active photo could be read."""
        ...

    @property
    def takes_expressions(self) -> bool:
        """True if the character has shapes of ARKit, to which the expression of a photo is given."""
        ...

    def ask(self) -> None:
        """Ask for a photo file and open it."""

    def ask_and_take_expression(self) -> None:
        """Ask for a photo file, open it, and pose the face after it without pins."""

    def ask_and_pin(self) -> None:
        """Ask for a photo file, open it, and start to set pins."""

    def open(self, path: Path) -> bool:
        """Add the photo ``path`` to the session as one step of the history and look through it; True if it is open."""
        ...

    def make_head(self, paths: Sequence[Path] = ()) -> None:
        """Open the dialog that makes a character of the person in the photos ``paths``."""

    def choose(self, index: int) -> None:
        """Activate photo ``index`` and look through it."""

    def look_through(self) -> None:
        """Look through the camera of the active photo."""

    def start_pinning(self) -> None:
        """Choose the tool that sets pins, at the first place without a pin."""

    def skip(self) -> None:
        """Skip to the next place."""

    def pin_place(self, place: Place) -> None:
        """Set a pin for ``place`` with the next press on the photo."""

    def toggle(self) -> None:
        """Show or hide the photo."""

    def change(self, photo: Photo, label: str, merges: bool = False) -> None:
        """Replace the active photo by ``photo``, as one step of the history or within the edit of a slider."""

    def realign(self, focal: float | None) -> None:
        """Fit the camera again with the focal length ``focal`` in pixels, or estimate it if None."""

    def remove(self, index: int) -> None:
        """Remove photo ``index`` from the session as one step of the history; its file is kept."""

    def take_expression(self) -> None:
        """Pose the face after the active photo without pins; constraints are removed."""

    def pose_from_pins(self) -> None:
        """Pose the face from the pins as one step of the history; constraints made from them before are replaced."""
