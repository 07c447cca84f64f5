"""What the window has beside tools and constraints: each feature brings its own menu entries, tab and dialogs."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

from imgui_bundle import imgui

from faceposer.gui.actions import Action, Submenu

if TYPE_CHECKING:
    from faceposer.gui.app import App


class Feature:
    """A part of the window that the frame loop and the layout call; one overrides what it needs.

    Attributes:
        tab: Title of its tab in the side panel and the text of its tooltip, or None to have no tab.
    """

    tab: tuple[str, str] | None = None

    def __init__(self, app: "App") -> None:
        self.app = app

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep as far as this feature goes."""
        return math.inf

    @property
    def hint(self) -> str:
        """What the mouse will do where this feature has it, or ""."""
        return ""

    @property
    def covers(self) -> bool:
        """Whether a dialog of its own keeps the pointer from the view."""
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

    def follow(self) -> None:
        """Do what is to be done once in every turn of the loop, before anything is drawn."""

    def drop(self, paths: tuple[str, ...]) -> bool:
        """Take the files ``paths`` that were dropped onto the window; return whether they are for this feature."""
        return False

    def draw_tab(self) -> None:
        """Draw the content of its tab."""

    def draw_strip(self) -> None:
        """Draw its strip beneath the view; the window of Dear ImGui is begun."""

    def draw_behind(self, draw: imgui.ImDrawList) -> None:
        """Draw over the picture of the face but beneath all constraints."""

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw over the picture of the face and all constraints."""

    def draw_dialog(self) -> None:
        """Draw its dialog, where one is open."""

    def close(self) -> None:
        """End what runs and free what it holds; the program ends."""


F = TypeVar("F", bound=Feature)


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
    def covers(self) -> bool:
        """Whether any has a dialog open."""
        return any(feature.covers for feature in self._features)

    @property
    def busy(self) -> bool:
        """Whether any holds the document or the face."""
        return any(feature.busy for feature in self._features)

    @property
    def with_tab(self) -> list[Feature]:
        """Those that have a tab, in order."""
        return [feature for feature in self._features if feature.tab is not None]

    @property
    def with_strip(self) -> list[tuple[Feature, float]]:
        """Those that want a strip beneath the view now, with its height, from top to bottom."""
        sized = ((feature, feature.strip_height) for feature in self._features)
        return [(feature, height) for feature, height in sized if height > 0]

    def actions(self, file_menu: bool) -> list[Action | Submenu]:
        """Return the entries for the menu "File", or all others."""
        entries = (action for feature in self._features for action in feature.actions())
        return [entry for entry in entries if (entry.menu == "File") == file_menu]

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

    def drop(self, paths: tuple[str, ...]) -> bool:
        """Give dropped files to the first feature that takes them; return whether one did."""
        return any(feature.drop(paths) for feature in self._features)

    def follow(self) -> None:
        """Let all do what is due in this turn of the loop."""
        for feature in self._features:
            feature.follow()

    def draw_behind(self, draw: imgui.ImDrawList) -> None:
        """Draw over the picture, beneath the constraints."""
        for feature in self._features:
            feature.draw_behind(draw)

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw over everything in the view."""
        for feature in self._features:
            feature.draw_over(draw)

    def draw_dialogs(self) -> None:
        """Draw the dialogs that are open."""
        for feature in self._features:
            feature.draw_dialog()

    def close(self) -> None:
        """End all."""
        for feature in self._features:
            feature.close()


def build_features(app: "App") -> Features:
    """Return the features of ``app``, in the order of their tabs."""
    from faceposer.gui.features.animation_files.feature import AnimationFiles
    from faceposer.gui.features.export.feature import Exchange
    from faceposer.gui.features.photo.feature import Photos
    from faceposer.gui.features.poses.feature import PosesFeature
    from faceposer.gui.features.range_marks.feature import RangeMarks
    from faceposer.gui.features.timeline.feature import Timeline
    from faceposer.gui.features.trajectories.feature import Following
    from faceposer.gui.features.transfer.feature import Transferring

    exchange = Exchange(app)
    exchange.performance = lambda: app.session.animation.performance
    return Features(
        [
            PosesFeature(app),
            Photos(app),
            Timeline(app),
            Following(app, app.wake),
            AnimationFiles(app),
            Transferring(app),
            exchange,
            RangeMarks(app),
        ]
    )
