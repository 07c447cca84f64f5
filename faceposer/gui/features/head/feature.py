"""The tab of the head in the window, with its menu."""

from collections.abc import Sequence

from imgui_bundle import imgui

from faceposer.gui.actions import Action, Submenu
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.head.panel import HeadPanel
from faceposer.gui.features.head.state import HeadState
from faceposer.gui.features.head.variations import Variations


class HeadFeature(HeadState, Feature):
    """The tab "Head", on characters that have the topology of the morphable model.

    Attributes:
        variations: Grid of random heads to choose from.
    """

    tool_name = "head"

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        Feature.__init__(self, context)
        self.variations = Variations(self)
        self._panel = HeadPanel(self, self.variations)

    # Called by the window

    @property
    def tab(self) -> tuple[str, str] | None:  # type: ignore[override]
        """Title and tooltip of the tab; None on characters without the model."""
        return ("Head", "Who the character is: shape and skin of the head") if self.applies else None

    @property
    def patience(self) -> float:
        """Seconds for which the loop may sleep."""
        return 0.0 if self.variations.waiting else super().patience

    def actions(self) -> Sequence[Action | Submenu]:
        """Return the entries of the menu "Head"."""

        def free() -> bool:
            return self.applies and not self.context.busy and not self.context.session.head_held

        return (
            Action(
                "head-random",
                "Random head",
                "Head",
                self.randomise,
                (),
                free,
                separated=True,
                help="Change to a random head",
            ),
            Action("head-average", "Average head", "Head", self.average, (), free, help="Change to the average head"),
            Action(
                "head-original",
                "Original head",
                "Head",
                self.restore_original,
                (),
                lambda: free() and self.context.session.document.identity is not None,
                help="Return to the head of the character's file",
            ),
            Action(
                "head-variations",
                "Variations...",
                "Head",
                self.show_variations,
                (),
                free,
                help="Choose among nine heads around this one, in the tab Head",
            ),
            Action(
                "head-save",
                "Save head as character...",
                "Head",
                self.ask_to_save,
                (),
                free,
                separated=True,
                help="Save the character with this head under a new name",
            ),
        )

    def show_variations(self) -> None:
        """Offer variations of the head in its tab."""
        self.context.show_tab("Head")
        self.variations.make()

    def session_changed(self) -> None:
        """Serve the new session's character."""
        self._editor, self._drag, self._measured = None, None, (None, {})
        self.model_changed()

    def model_changed(self) -> None:
        """Discard thumbnails of variations that another edit has left."""
        shown = self.context.session.document.identity
        if shown is None and self._editor is not None:
            shown = self._editor.own
        if shown is None or not self.variations.offers(shown):
            self.variations.close()

    def update(self) -> None:
        """End the drag of a slider that is no longer drawn, and draw the next thumbnail.

        Raises:
            Exception: The error of the preparation.
        """
        if self._drag is not None and imgui.get_frame_count() > self._drawn:
            self._end_drag(keep=True)
        if self._job is not None and self._job.done:
            job, self._job = self._job, None
            self.context.redraw()
            if job.error is not None:
                raise job.error
        if not self.context.busy:
            self.variations.draw_next()

    def draw_tab(self) -> None:
        """Draw the tab."""
        self._panel.draw()

    def draw_tool_options(self) -> None:
        """Draw the options of the tool."""
        self._panel.draw_tool_options()

    def close(self) -> None:
        """Release the thumbnails."""
        self.variations.release()

    def join(self) -> None:
        """Wait for the preparation."""
        if self._job is not None:
            self._job.join()
