"""Sketches in the window: the recogniser is prepared in the background; strokes get names and a list of features."""

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.features.sketch.overlay import SketchOverlay
from faceposer.gui.features.sketch.panel import draw_sketch_options
from faceposer.gui.panels.details.sketch import draw_feature_list
from faceposer.model.face_model import FaceModel
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob
from faceposer.session.sketching import session_sketcher
from faceposer.session.solver_worker import SolverWorker
from faceposer.tools.sketch_edits import prepare_recognition
from faceposer.tools.sketch_tool import SketchTool

_POPUP = "##features"


class SketchFeature(Feature):
    """The recogniser of the open character, and the list of features at a stroke."""

    tool_name = "sketch"

    def __init__(self, context: EditorContext) -> None:
        super().__init__(context)
        self._overlay = SketchOverlay(context)
        self._job: ThreadJob[None] | None = None
        # The model whose preparation has begun, and the one whose recogniser is ready.
        self._prepared: FaceModel | None = None
        self._ready: FaceModel | None = None
        self._listed: int | None = None

    @property
    def tool(self) -> SketchTool:
        """The tool that draws sketches."""
        return self.context.toolbox.sketch_tool

    @property
    def chosen(self) -> bool:
        """True if the tool is chosen."""
        return self.context.toolbox.chosen is self.tool

    @property
    def preparing(self) -> bool:
        """True while the recogniser is being prepared."""
        return self._job is not None and self._ready is not self.context.session.model

    @property
    def hint(self) -> str:
        """Message on a stroke that is not recognised, wherever the pointer is."""
        unfinished = self.chosen and (self.tool.waiting or self.tool.unnamed) and not self.context.toolbox.active
        return self.tool.hint(self.context.viewport) if unfinished else ""

    @property
    def selects(self) -> bool:
        """True if "Delete" removes strokes that wait for the recogniser, or the last one that depicts no feature."""
        tool = self.tool
        return bool(tool.waiting) or (self.chosen and bool(tool.unnamed) and not self.context.toolbox.selection)

    def delete_selected(self) -> None:
        """Discard the strokes that wait, or else the last one that depicts no feature."""
        if self.tool.waiting:
            self.tool.waiting.clear()
        else:
            self.tool.discard_last()

    def session_changed(self) -> None:
        """Serve the tool of the new session."""
        self.tool.preparing = lambda: self.preparing

    def update(self) -> None:
        """Prepare the recogniser once the tool is chosen, and recognise a stroke that has waited for it.

        Raises:
            Exception: The error of the preparation.
        """
        job, session = self._job, self.context.session
        if job is not None and job.done:
            self._job = None
            self.context.redraw()
            if job.error is not None:
                raise job.error
        if self._job is None and self.chosen and self._prepared is not session.model:
            self._prepared = session.model
            if isinstance(session.worker, SolverWorker):
                self._prepare(session.model)
        if not self.context.toolbox.active and self.tool.follow(self.context.viewport):
            self.context.redraw()
        if not self.context.busy and self.tool.advance(self.context.viewport):
            self.context.redraw()

    def draw_tool_options(self) -> None:
        """Draw the options of the tool."""
        draw_sketch_options(self.context, self.tool, self.preparing)

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw the names of the sketches, and the list of features if it is open."""
        tool = self.tool
        if self.context.comparing:
            tool.labels = tool.lists = {}
        else:
            self._overlay.draw(draw, tool, self.chosen)
        if tool.listing is not None:
            self._listed, tool.listing = tool.listing, None
            imgui.open_popup(_POPUP)
        if imgui.begin_popup(_POPUP):
            if self._listed is not None:
                draw_feature_list(self.context, self._listed)
            imgui.end_popup()

    def _prepare(self, model: FaceModel) -> None:
        """Prepare the recogniser of ``model`` in another thread, so that the first stroke does not wait for it."""

        def work(_progress: Progress) -> None:
            prepare_recognition(model)
            self._ready = model
            self.context.wake()
            # Needed if the user chooses the method of the paper.
            _ = session_sketcher(model).paper

        self._job = ThreadJob(work, self.context.wake)

    def join(self) -> None:
        """Wait for the preparation."""
        if self._job is not None:
            self._job.join()
