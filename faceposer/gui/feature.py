"""Feature plug-ins: parts of the window that bring their own menu entries, tab, dialogs and overlays."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack

from imgui_bundle import imgui

from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext, F
from faceposer.gui.viewport import Pixel
from faceposer.gui.widgets.dialogs import Question


class Feature:
    """A part of the window that the frame loop and the layout call; one overrides what it needs.

    Attributes:
        tab: Title of its tab in the side panel and the text of its tooltip, or None to have no tab.
        tool_name: Name of the tool whose options it draws, or "".
    """

    tab: tuple[str, str] | None = None
    tool_name: str = ""

    def __init__(self, context: EditorContext) -> None:
        self.context = context

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep as far as this feature goes."""
        return math.inf

    @property
    def hint(self) -> str:
        """What the mouse will do where this feature has it, or ""."""
        return ""

    @property
    def is_modal(self) -> bool:
        """Whether a dialog of its own keeps the pointer from the view."""
        return False

    @property
    def blocks_files(self) -> bool:
        """Whether files that are dropped onto the window are ignored now."""
        return False

    @property
    def quit_question(self) -> Question | None:
        """What to ask before the window closes, the choice that goes on first; None if there is nothing to lose."""
        return None

    def contains(self, position: Pixel) -> bool:
        """Whether a window of its own over the view covers ``position``, in the window's units."""
        return False

    def cancel(self) -> bool:
        """Close what Esc closes when no gesture is under way; return whether there was anything."""
        return False

    @property
    def busy(self) -> bool:
        """Whether it holds the document or the face, as while an animation plays: nothing else may change it."""
        return False

    @property
    def strip_height(self) -> float:
        """Height of the strip that it wants beneath the view, in the window's units; 0 for none."""
        return 0.0

    def actions(self) -> Sequence[Action | Submenu]:
        """Return its menu entries, in order; those of the menu "File" come before "Quit"."""
        return ()

    @property
    def selects(self) -> bool:
        """Whether something of it is selected that "Delete" is to remove."""
        return False

    def delete_selected(self) -> None:
        """Remove what is selected."""

    def before_press(self) -> None:
        """Prepare for a press on the view."""

    def session_changed(self) -> None:
        """Take note that another session is edited from now on."""

    def update(self) -> None:
        """Do what is to be done once in every turn of the loop, before the face is brought up to date."""

    def late_update(self) -> None:
        """Likewise, once session and face are up to date."""

    def take_key(self, key: str) -> bool:
        """Take a key that was pressed, such as "Ctrl+Z", before everybody else; return whether it did."""
        return False

    def accept_files(self, paths: tuple[str, ...]) -> bool:
        """Take the files ``paths`` that were dropped onto the window; return whether they are for this feature."""
        return False

    def draw_tool_options(self) -> None:
        """Draw the options of the chosen tool, where that is the feature's."""

    def draw_tab(self) -> None:
        """Draw the content of its tab."""

    def draw_strip(self) -> None:
        """Draw its strip beneath the view; the window of Dear ImGui is begun."""

    def draw_behind(self, draw: imgui.ImDrawList) -> None:
        """Draw over the picture of the face but beneath all constraints."""

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw over the picture of the face and all constraints."""

    def draw_window(self) -> None:
        """Draw a window of its own above the panels and below all dialogs."""

    def draw_dialog(self) -> None:
        """Draw its dialog, where one is open."""

    def draw_around_dialogs(self, draw_dialogs: Callable[[], None]) -> bool:
        """Draw a dialog above which others may open, by calling ``draw_dialogs`` inside; return whether it did."""
        return False

    def close(self) -> None:
        """End what runs and free what it holds; the program ends."""

    def join(self) -> None:
        """Wait for what still runs beside, once the window is gone."""


class Features:
    """All features of the window, asked as one."""

    def __init__(self, features: Sequence[Feature]) -> None:
        self._features = tuple(features)

    def __getitem__(self, kind: type[F]) -> F:
        """Return the feature of class ``kind``.

        Raises:
            KeyError: If there is none.
        """
        for feature in self._features:
            if isinstance(feature, kind):
                return feature
        raise KeyError(kind)

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep."""
        return min((feature.patience for feature in self._features), default=math.inf)

    @property
    def hint(self) -> str:
        """What the mouse will do where any has it, or ""."""
        return next((feature.hint for feature in self._features if feature.hint), "")

    @property
    def is_modal(self) -> bool:
        """Whether any has a dialog open."""
        return any(feature.is_modal for feature in self._features)

    @property
    def blocks_files(self) -> bool:
        """Whether any ignores dropped files."""
        return any(feature.blocks_files for feature in self._features)

    @property
    def quit_question(self) -> Question | None:
        """The first question before the window closes, if any."""
        return next((q for q in (feature.quit_question for feature in self._features) if q is not None), None)

    def contains(self, position: Pixel) -> bool:
        """Whether a window of any covers ``position``."""
        return any(feature.contains(position) for feature in self._features)

    def cancel(self) -> bool:
        """Close what Esc closes in the first that has something to close."""
        return any(feature.cancel() for feature in self._features)

    def __iter__(self) -> Iterator[Feature]:
        return iter(self._features)

    @property
    def busy(self) -> bool:
        """Whether any holds the document or the face."""
        return any(feature.busy for feature in self._features)

    def take_key(self, key: str) -> bool:
        """Offer a key to each in turn, and return whether one took it."""
        return any(feature.take_key(key) for feature in self._features)

    @property
    def with_tab(self) -> list[Feature]:
        """Those that have a tab, in order."""
        return [feature for feature in self._features if feature.tab is not None]

    @property
    def with_strip(self) -> list[tuple[Feature, float]]:
        """Those that want a strip beneath the view now, with its height, from top to bottom."""
        sized = ((feature, feature.strip_height) for feature in self._features)
        return [(feature, height) for feature, height in sized if height > 0]

    def actions(self) -> dict[str, Action | Submenu]:
        """Return the menu entries of all, by their names, in order."""
        return {entry.name: entry for feature in self._features for entry in feature.actions()}

    @property
    def selects(self) -> bool:
        """Whether something is selected in any."""
        return any(feature.selects for feature in self._features)

    def delete_selected(self) -> None:
        """Remove what is selected in them."""
        for feature in self._features:
            if feature.selects:
                feature.delete_selected()

    def before_press(self) -> None:
        """Prepare all for a press on the view."""
        for feature in self._features:
            feature.before_press()

    def session_changed(self) -> None:
        """Tell all that another session is edited."""
        for feature in self._features:
            feature.session_changed()

    def accept_files(self, paths: tuple[str, ...]) -> bool:
        """Give dropped files to the first feature that takes them; return whether one did."""
        return any(feature.accept_files(paths) for feature in self._features)

    def draw_tool_options(self, tool: str) -> bool:
        """Draw the options of ``tool`` if it is a feature's; return whether it is."""
        owners = [feature for feature in self._features if feature.tool_name == tool]
        for feature in owners:
            feature.draw_tool_options()
        return bool(owners)

    def draw_behind(self, draw: imgui.ImDrawList) -> None:
        """Draw over the picture, beneath the constraints."""
        for feature in self._features:
            feature.draw_behind(draw)

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw over everything in the view."""
        for feature in self._features:
            feature.draw_over(draw)

    def draw_windows(self) -> None:
        """Draw the windows above the panels."""
        for feature in self._features:
            feature.draw_window()

    def draw_dialogs(self) -> None:
        """Draw the dialogs that are open."""
        for feature in self._features:
            feature.draw_dialog()

    def draw_around_dialogs(self, draw_dialogs: Callable[[], None]) -> bool:
        """Draw the dialog above which others may open, if there is one; return whether there is."""
        return any(feature.draw_around_dialogs(draw_dialogs) for feature in self._features)

    def close(self) -> None:
        """End all, the last first, whatever one of them raises: unsaved work must be kept in any case."""
        with ExitStack() as stack:
            for feature in self._features:
                stack.callback(feature.close)

    def join(self) -> None:
        """Wait for what still runs."""
        for feature in self._features:
            feature.join()
