"""The type of the fixture ``open_window``."""

from typing import Any, Protocol

from faceposer.gui.testing.scripted_user import Robot


class OpenWindow(Protocol):
    """Opens hidden windows; what is still open when the test ends is closed."""

    def __call__(
        self,
        what: str = "low",
        size: tuple[int, int] = (900, 680),
        pictures: bool = True,
        journal: bool = False,
        **settings: Any,
    ) -> Robot:
        """Return the user of a new window.

        Args:
            what: Character or session that it opens.
            size: Width and height of the window.
            pictures: Whether the face is drawn as the user would see it, which is most of the time of a frame without
                a GPU; otherwise it is drawn in 64 x 64 pixels.
            journal: Whether unsaved work is kept on the disk.
            settings: Of ``faceposer.gui.settings.Settings``, besides the size and the folder of the test.
        """
        ...
