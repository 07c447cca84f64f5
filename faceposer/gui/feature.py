"""Feature plug-ins: parts of the window with menu entries, a tab, dialogs and overlays of their own."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack

from imgui_bundle import imgui

from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext, F
from faceposer.gui.viewport import Pixel
from faceposer.gui.widgets.dialogs import Question


class Feature:
    """Base class of features; subclasses override the hooks they need.

    Attributes:
        tab: Title and tooltip of the tab in the side panel, or None for no tab.
        tool_name: Name of the tool for which the feature draws the options, or "".
    """

    tab: tuple[str, str] | None = None
    tool_name: str = ""

    def __init__(self, context: EditorContext) -> None:
        self.context = context

    @property
    def traced(self) -> bool:
        """True if the tab has photos: the options of tools that trace photos, and constraints, are shown in it, too."""
        return False

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep without an event."""
        return math.inf

    @property
    def hint(self) -> str:
        """Hint for the mouse while this feature uses it, otherwise ""."""
        return ""

    @property
    def edited_instead(self) -> str:
        """What the window edits in place of the session, for the status bar, or ""."""
        return ""

    @property
    def is_modal(self) -> bool:
        """True if a dialog of the feature blocks the view."""
        return False

    @property
    def blocks_files(self) -> bool:
        """True if files dropped onto the window must be ignored."""
        return False

    @property
    def quit_question(self) -> Question | None:
        """Question before the window closes, with the choice to continue first; None if nothing would be lost."""
        return None

    def leave(self, proceed: Callable[[], None]) -> bool:
        """Ask about work of the feature before the session is left; return True if it calls ``proceed`` afterwards."""
        return False

    def contains(self, position: Pixel) -> bool:
        """Return True if a window of the feature over the view covers ``position``, in window units."""
        return False

    def cancel(self) -> bool:
        """Handle Esc outside a gesture; return True if it closed anything."""
        return False

    @property
    def busy(self) -> bool:
        """True if the feature changes the document or moves the face, as during playback."""
        return False

    @property
    def strip_height(self) -> float:
        """Height of the feature's strip below the view, in window units; 0 for none."""
        return 0.0

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the menu entries, in order; those of the menu "File" are placed above "Quit"."""
        return ()

    @property
    def selects(self) -> bool:
        """True if the feature has a selection that "Delete" removes."""
        return False

    def delete_selected(self) -> None:
        """Remove the selection."""

    def before_press(self) -> None:
        """Prepare for a press on the view."""

    def session_changed(self) -> None:
        """React to a change of the edited session."""

    def model_changed(self) -> None:
        """React to another face model of the session: its head was edited, or such an edit undone."""

    def update(self) -> None:
        """Do the work of one turn of the loop, before session and face are updated."""

    def late_update(self) -> None:
        """Do the work of one turn of the loop, after session and face are updated."""

    def take_key(self, key: str) -> bool:
        """Handle a pressed key, such as "Ctrl+Z", before any action; return True if it was handled."""
        return False

    def accept_files(self, dropped: tuple[str, ...]) -> bool:
        """Open the dropped files ``dropped``; return True if the feature handles such files."""
        return False

    def draw_tool_options(self) -> None:
        """Draw the options of the tool ``tool_name``."""

    def draw_tab(self) -> None:
        """Draw the content of the tab."""

    def draw_strip(self) -> None:
        """Draw the strip below the view into the current window of Dear ImGui."""

    def draw_behind(self, draw: imgui.ImDrawList) -> None:
        """Draw over the face and below all constraints."""

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw over the face and all constraints."""

    def draw_window(self) -> None:
        """Draw a window above the panels and below all dialogs."""

    def draw_dialog(self) -> None:
        """Draw the dialog of the feature, if it is open."""

    def draw_around_dialogs(self, draw_dialogs: Callable[[], None]) -> bool:
        """Draw a dialog within which other dialogs may open, by calling ``draw_dialogs``; return True if it is open."""
        return False

    def close(self) -> None:
        """Stop background work and release resources, at the end of the program."""

    def join(self) -> None:
        """Wait for background work, after the window is closed."""


class Features:
    """All features of the window, with the interface of one."""

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
        """Seconds for which the loop may sleep without an event."""
        return min((feature.patience for feature in self._features), default=math.inf)

    @property
    def hint(self) -> str:
        """Hint of the feature that uses the mouse, or ""."""
        return next((feature.hint for feature in self._features if feature.hint), "")

    @property
    def edited_instead(self) -> str:
        """What the window edits in place of the session, or ""."""
        return next((feature.edited_instead for feature in self._features if feature.edited_instead), "")

    @property
    def is_modal(self) -> bool:
        """True if a dialog of any feature blocks the view."""
        return any(feature.is_modal for feature in self._features)

    @property
    def blocks_files(self) -> bool:
        """True if dropped files must be ignored."""
        return any(feature.blocks_files for feature in self._features)

    @property
    def quit_question(self) -> Question | None:
        """First question before the window closes, if any."""
        return next((q for q in (feature.quit_question for feature in self._features) if q is not None), None)

    def leave(self, proceed: Callable[[], None]) -> bool:
        """Let the first feature that has work of its own ask about it; return True if one calls ``proceed``."""
        return any(feature.leave(proceed) for feature in self._features)

    def contains(self, position: Pixel) -> bool:
        """Return True if a window of any feature covers ``position``."""
        return any(feature.contains(position) for feature in self._features)

    def cancel(self) -> bool:
        """Let the first feature that can handle Esc do so; return True if one did."""
        return any(feature.cancel() for feature in self._features)

    def __iter__(self) -> Iterator[Feature]:
        return iter(self._features)

    @property
    def busy(self) -> bool:
        """True if any feature changes the document or moves the face."""
        return any(feature.busy for feature in self._features)

    def take_key(self, key: str) -> bool:
        """Offer a key to each feature in turn; return True if one handled it."""
        return any(feature.take_key(key) for feature in self._features)

    @property
    def with_tab(self) -> list[Feature]:
        """Features with a tab, in order."""
        return [feature for feature in self._features if feature.tab is not None]

    @property
    def with_strip(self) -> list[tuple[Feature, float]]:
        """Features with a visible strip below the view, and its height, from top to bottom."""
        sized = ((feature, feature.strip_height) for feature in self._features)
        return [(feature, height) for feature, height in sized if height > 0]

    def actions(self) -> dict[str, Action | Submenu]:
        """Return the menu entries of all features by name, in order."""
        return {entry.name: entry for feature in self._features for entry in feature.actions()}

    @property
    def selects(self) -> bool:
        """True if any feature has a selection."""
        return any(feature.selects for feature in self._features)

    def delete_selected(self) -> None:
        """Remove the selection of all features."""
        for feature in self._features:
            if feature.selects:
                feature.delete_selected()

    def before_press(self) -> None:
        """Prepare all features for a press on the view."""
        for feature in self._features:
            feature.before_press()

    def session_changed(self) -> None:
        """Notify all features of a change of the edited session."""
        for feature in self._features:
            feature.session_changed()

    def model_changed(self) -> None:
        """Notify all features of another face model of the session."""
        for feature in self._features:
            feature.model_changed()

    def accept_files(self, dropped: tuple[str, ...]) -> bool:
        """Offer dropped files to each feature in turn; return True if one handled them."""
        modal = self.is_modal
        if any(feature.accept_files(dropped) for feature in self._features):
            return True
        # A dialog that does not take the files may have closed, and no longer be in the way of another feature.
        closed = modal and not self.is_modal
        return closed and any(feature.accept_files(dropped) for feature in self._features)

    def draw_tool_options(self, tool: str) -> bool:
        """Draw the options of ``tool`` if it belongs to a feature; return True if it does."""
        owners = [feature for feature in self._features if feature.tool_name == tool]
        for feature in owners:
            feature.draw_tool_options()
        return bool(owners)

    def draw_behind(self, draw: imgui.ImDrawList) -> None:
        """Draw over the face and below the constraints."""
        for feature in self._features:
            feature.draw_behind(draw)

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw over the face and the constraints."""
        for feature in self._features:
            feature.draw_over(draw)

    def draw_windows(self) -> None:
        """Draw the windows of all features."""
        for feature in self._features:
            feature.draw_window()

    def draw_dialogs(self) -> None:
        """Draw the open dialogs of all features."""
        for feature in self._features:
            feature.draw_dialog()

    def draw_around_dialogs(self, draw_dialogs: Callable[[], None]) -> bool:
        """Draw the dialog within which others may open; return True if it is open."""
        return any(feature.draw_around_dialogs(draw_dialogs) for feature in self._features)

    def close(self) -> None:
        """Close all features, the last first, even if one raises: unsaved work must be kept in any case."""
        with ExitStack() as stack:
            for feature in self._features:
                stack.callback(feature.close)

    def join(self) -> None:
        """Wait for background work of all features."""
        for feature in self._features:
            feature.join()
