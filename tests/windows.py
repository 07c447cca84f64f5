"""The type of the fixture ``open_window``."""

from typing import Any, Protocol

from faceposer.gui.testing.scripted_user import Robot


class OpenWindow(Protocol):
    """Opens hidden windows; what is still open when the test ends is closed."""

    def __call__(
        self,
        what: str = "low",
        size: tuple[int, int] = (900, 680),
        pictures: bool = False,
        journal: bool = False,
        **settings: Any,
    ) -> Robot:
        """Return the user of a new window.

        Args:
            what: Character or session that it opens.
            size: Width and height of the window.
            pictures: Whether frames are drawn as the user would see them, which is most of their time without a GPU,
                and needed for ``app.screenshot``; otherwise few pixels are drawn (``gui.testing.few_pixels``).
            journal: Whether unsaved work is kept on the disk.
            settings: Of ``faceposer.gui.settings.Settings``, besides the size and the folder of the test.
        """
        ...
