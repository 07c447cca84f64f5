"""Sketches: one stroke shows how a feature should look (Gunnarsson and Maddock); which one it is, is recognised."""

import math
import time
from collections.abc import Callable

import numpy as np

from faceposer.geometry.camera import Camera
from faceposer.geometry.strokes import smoothed
from faceposer.model.character import Character
from faceposer.model.feature_curves import drawable_features
from faceposer.session.sketching import drawn_stroke, drawn_strokes, session_sketcher, sketch_of
from faceposer.sketch.recognition import Candidate, DrawnStroke
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import as_pixels
from faceposer.tools.dragging import drag_drawn
from faceposer.tools.recognised_strokes import RecognisedStrokes, UnnamedStroke, UnnamedStrokes
from faceposer.tools.sketch_edits import depicting, drawn_in, inside, length, with_feature, with_sketch
from faceposer.tools.stroke_tool import distance_to_line, pixels_in_view
from faceposer.tools.tool import Gesture, PointerEvent, PosingTool, ToolContext, ToolSettings

Pixel = tuple[float, float]
#: Left, top, right and bottom in pixels of the view.
Box = tuple[float, float, float, float]

#: Stands for the last unnamed stroke among the indices of sketches; those before it have lower ones.
UNNAMED = -1
#: Message on a stroke that depicts no feature.
UNRECOGNISED = "No feature recognised: nothing has changed"
# In pixels at normal density: reach of strokes, extent of the largest click, length from which a stroke is previewed.
_REACH, _CLICK, _PREVIEWED = 7.0, 6.0, 30.0
# Distance beside the head in which a press begins a stroke, in pixels at normal density, and where it is looked for.
_BESIDE = 24.0
_RING = np.array(
    [(r * math.cos(a), r * math.sin(a)) for r in (0.5, 1.0) for a in np.linspace(0.0, 2 * math.pi, 13)[1:]]
)
# Seconds that the recognition of an unfinished stroke may take, and its largest share of the time of drawing.
_FRAME, _PREVIEW_SHARE = 1.0 / 60.0, 0.25


class SketchTool(PosingTool):
    """Draws features as they should look; the face takes that shape.

    Attributes:
        drawing: Pixels of the stroke being drawn in the camera of ``drawn_in``, or None.
        drawn_in: Camera under which the stroke is being drawn.
        preview: Feature that the unfinished stroke depicts, or None.
        waiting: Strokes that are drawn but not recognised, because the recogniser is being prepared, in their order.
        preparing: Returns True while the recogniser is being prepared in the background.
        labels: Boxes of the names in the view, by the index of the constraint, negative ones for ``unnamed``.
        lists: Boxes within them that open the list of features.
        listing: Index, likewise, of the stroke whose list of features is to be opened, or None.
        known: What the recognition of the strokes has found.
    """

    name = "sketch"
    label = "Sketch"
    key = "E"
    help = "Draw a feature as it should look: a brow, a lid, a lip; the face takes that shape"
    empty_text = "Draw a brow, a lid, a lip or another feature as it should look. The face takes that shape."
    drag_hint = "Move: draw the feature   ·   release: the face follows   ·   Esc: cancel"
    handle_hint = "Click: choose another feature   ·   Shift+drag: move the stroke   ·   right click: remove it"
    cursor = "draw"
    edited_by_points = False
    traces_photos = True

    def __init__(self, tool_settings: ToolSettings) -> None:
        """Use the shared ``tool_settings``."""
        super().__init__(tool_settings)
        self.drawing: list[Pixel] | None = None
        self.drawn_in: Camera | None = None
        self.preview: Candidate | None = None
        self.waiting: list[DrawnStroke] = []
        self._unnamed = UnnamedStrokes()
        self.preparing: Callable[[], bool] = lambda: False
        self.labels: dict[int, Box] = {}
        self.lists: dict[int, Box] = {}
        self.listing: int | None = None
        self.known = RecognisedStrokes()
        self._cost, self._depth = 0.0, 0

    def usable(self, character: Character) -> bool:
        """Return True if ``character`` has the points of any feature."""
        return bool(drawable_features(character))

    # Places in the view

    def sketch_at(self, position: Pixel, context: ToolContext) -> int | None:
        """Return the sketch whose label or stroke is at ``position``, or None; locked ones included."""
        constraints = context.session.document.constraints
        for i in reversed(range(len(constraints))):
            sketch = constraints[i]
            if isinstance(sketch, SketchConstraint) and i not in context.unmarked:
                if inside(self.labels.get(i), position):
                    return i
                seen = pixels_in_view(sketch.stroke, sketch.camera, context.camera)
                if seen is not None and distance_to_line(position, seen) <= _REACH * context.ui_scale:
                    return i
        return None

    @property
    def unnamed(self) -> tuple[UnnamedStroke, ...]:
        """The strokes that depict no feature, in the view in which they were drawn, the last one at the end."""
        return self._unnamed.shown

    def unnamed_at(self, position: Pixel, context: ToolContext) -> int | None:
        """Return the negative index of the unnamed stroke whose label or line is at ``position``, or None."""
        unnamed = self.unnamed
        for index in range(-1, -len(unnamed) - 1, -1):
            stroke = unnamed[index].stroke
            seen = pixels_in_view(as_pixels(stroke.pixels), stroke.camera, context.camera)
            near = seen is not None and distance_to_line(position, seen) <= _REACH * context.ui_scale
            if near or inside(self.labels.get(index), position):
                return index
        return None

    def follow(self, context: ToolContext) -> bool:
        """Show the unnamed strokes of the present view and history; return True if others were shown before."""
        before, session = self.unnamed, context.session
        self._unnamed.follow(session.depth, session.document.constraints, context.camera)
        return self.unnamed != before

    def works_at(self, position: Pixel, context: ToolContext) -> bool:
        """Return True if a press at ``position`` draws: on the head, also hair and neck, and a little beside it."""
        if context.pick(position) is not None:
            return True
        _, on_head = context.pick_many(np.add(position, _RING * (_BESIDE * context.ui_scale)))
        return bool(on_head.any())

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` draws or hits a label, or with Shift moves a sketch."""
        if event.button != "left" or event.modifiers - {"shift"}:
            return False
        index = self.sketch_at(event.position, context)
        if "shift" in event.modifiers:
            sketch = None if index is None else context.session.document.constraints[index]
            return isinstance(sketch, SketchConstraint) and not sketch.locked and drawn_in(sketch, context)
        on_mark = index is not None or self.unnamed_at(event.position, context) is not None
        return on_mark or self.works_at(event.position, context)

    def handle_under(self, position: Pixel, context: ToolContext) -> int | None:
        """Return the sketch whose feature a click at ``position`` would change, or None."""
        return self.sketch_at(position, context)

    # Gestures

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Draw a stroke, change the feature of one by a click, or with Shift move one."""
        if "shift" in event.modifiers:
            yield from self._move(event, context)
            return
        # on press
        camera, path = context.camera, [event.position]
        self.drawn_in, previewed, self._cost = camera, 0.0, 0.0
        try:
            while True:
                self.drawing = path
                event = yield
                # on release
                if event.kind == "release":
                    break
                # on move; after a zoom, the position is one of another view
                position = context.camera.transferred(event.position, camera)
                if position is not None:
                    path.append(position)
                now = time.perf_counter()
                if now - previewed > self._cost / _PREVIEW_SHARE:
                    self._update_preview(path, camera, context)
                    previewed = time.perf_counter()
        finally:
            self.drawing = self.preview = None
        if max(math.dist(path[0], position) for position in path) < _CLICK * context.ui_scale:
            self._click(path[0], context)
            return
        self.waiting.append(DrawnStroke(smoothed(path), camera))
        self.advance(context)

    def _update_preview(self, path: list[Pixel], camera: Camera, context: ToolContext) -> None:
        """Recognise the unfinished stroke, unless that takes longer than a frame."""
        if self.preparing() or self._cost > _FRAME or length(path) < _PREVIEWED * context.ui_scale:
            return
        # Seconds of this thread, since other programs may delay it.
        begin = time.thread_time()
        self.preview = self._candidates(DrawnStroke(smoothed(path), camera), context)[0]
        self._cost = time.thread_time() - begin
        if self._cost > _FRAME:
            # It would soon be out of date.
            self.preview = None

    def _click(self, position: Pixel, context: ToolContext) -> None:
        """Choose the next feature of the stroke at ``position``; if there is no other, ask for the list of features."""
        self.listing = next((i for i, box in self.lists.items() if inside(box, position)), None)
        if self.listing is not None:
            return
        index = self.sketch_at(position, context)
        if index is not None:
            if not self.choose_next(index, context):
                self.listing = index
            return
        unnamed = self.unnamed_at(position, context)
        if unnamed is not None:
            candidates = self.unnamed[unnamed].candidates
            if candidates:
                self.name_stroke(candidates[0].feature, context, unnamed)
            else:
                self.listing = unnamed

    def _move(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Move a sketch by the motion of the pointer."""
        index = self.sketch_at(event.position, context)
        if index is not None:
            yield from drag_drawn(index, "Move a sketch", event, context, self._settings)

    # Recognition

    def _candidates(
        self, stroke: DrawnStroke, context: ToolContext, without: int | None = None
    ) -> tuple[Candidate | None, tuple[Candidate, ...]]:
        """Return the feature of ``stroke``, None if it depicts none, and all candidates with matched points.

        Constraint ``without`` is left out of what is drawn already.
        """
        session = context.session
        constraints = [c for i, c in enumerate(session.document.constraints) if i != without]
        found = session_sketcher(session.model).recognise(stroke, session.coefficients, drawn_strokes(constraints))
        candidates = tuple(candidate for candidate in found.candidates if candidate.points)
        return found.best if found.best in candidates else None, candidates

    def advance(self, context: ToolContext) -> bool:
        """Recognise the first of the waiting strokes if the recogniser is prepared; return True if there was one."""
        if not self.waiting or self.preparing():
            return False
        stroke = self.waiting.pop(0)
        best, candidates = self._candidates(stroke, context)
        if best is None or not self._add(stroke, best, candidates, context):
            self._unnamed.add(stroke, candidates, context.session.depth)
            # "Delete" removes the last stroke.
            self._settings.selection.set()
        return True

    def _add(
        self, stroke: DrawnStroke, chosen: Candidate, candidates: tuple[Candidate, ...], context: ToolContext
    ) -> bool:
        """Add ``stroke`` as the ``chosen`` feature, as one step; return True if it could be."""
        session = context.session
        sketch, symmetric = sketch_of(stroke, chosen), self._settings.symmetry.on
        try:
            document, index, replaced = with_sketch(session, session.document, sketch, symmetric)
        except ValueError:
            return False
        if not self._has_room(document, "sketch", context):
            return False
        with session.edit(f"Sketch the {chosen.feature}"):
            session.replace(document)
        self.known.remember(sketch, candidates, replaced)
        self._settings.selection.set(index)
        return True

    def candidates_of(self, index: int, context: ToolContext) -> tuple[Candidate, ...]:
        """Return the features that sketch ``index`` may depict, the most probable first, from its recognition."""
        sketch = context.session.document.constraints[index]
        assert isinstance(sketch, SketchConstraint)
        known = self.known.candidates(sketch)
        if known is not None or self.preparing():
            return known or ()
        # Drawn in another session: recognised again, without what it was taken for.
        _, found = self._candidates(drawn_stroke(sketch), context, without=index)
        self.known.remember(sketch, found, ())
        return found

    def choose_next(self, index: int, context: ToolContext) -> bool:
        """Make sketch ``index`` depict the next of its candidates, as one step; after the last comes the first.

        Return True if there was another one.
        """
        sketch = context.session.document.constraints[index]
        assert isinstance(sketch, SketchConstraint)
        self._settings.selection.set(index)
        if sketch.locked:
            return True
        features = [candidate.feature for candidate in self.candidates_of(index, context)]
        at = features.index(sketch.feature) if sketch.feature in features else -1
        following = [*features[at + 1 :], *features[: max(at, 0)]]
        return any(self.choose_feature(index, feature, context) for feature in following)

    def choose_feature(self, index: int, feature: str, context: ToolContext) -> bool:
        """Make sketch ``index`` depict ``feature``, as one step; what it had replaced as another feature returns.

        Return True unless it is locked, depicts it already or cannot.
        """
        session = context.session
        sketch = session.document.constraints[index]
        if not isinstance(sketch, SketchConstraint) or sketch.locked or sketch.feature == feature:
            return False
        candidates = self.candidates_of(index, context)
        chosen = next((c for c in candidates if c.feature == feature), None) or self._matched(
            drawn_stroke(sketch), feature, context
        )
        if chosen is None:
            return False
        changed = depicting(sketch, chosen)
        try:
            document, index, replaced = with_feature(
                session, index, changed, self.known.replaced(sketch), self._settings.symmetry
            )
        except ValueError:
            return False
        if not self._has_room(document, "sketch", context):
            return False
        with session.edit(f"Sketch the {feature}"):
            session.replace(document)
        self.known.remember(changed, candidates, replaced)
        self._settings.selection.set(index)
        return True

    def name_stroke(self, feature: str, context: ToolContext, index: int = UNNAMED) -> None:
        """Make the unnamed stroke ``index`` depict ``feature``, as one step; undone, it is unnamed again."""
        unnamed = self.unnamed
        if len(unnamed) < -index:
            return
        named = unnamed[index]
        chosen = next((c for c in named.candidates if c.feature == feature), None) or self._matched(
            named.stroke, feature, context
        )
        if chosen is not None and self._add(named.stroke, chosen, named.candidates, context):
            self._unnamed.name(named, context.session.depth)

    def _matched(self, stroke: DrawnStroke, feature: str, context: ToolContext) -> Candidate | None:
        """Return the points of ``feature`` on ``stroke``, or None if there are none."""
        session = context.session
        found = session_sketcher(session.model).recognise(stroke, session.coefficients, feature=feature)
        return next((c for c in found.candidates if c.feature == feature and c.points), None)

    # Unfinished work

    def remove_at(self, position: Pixel, context: ToolContext) -> bool:
        """Remove the sketch, or the unnamed stroke, at ``position``; return True if there was one."""
        index = self.sketch_at(position, context)
        if index is not None:
            if context.session.document.constraints[index].locked:
                return False
            self._remove(index, "Remove a sketch", context)
            return True
        unnamed = self.unnamed_at(position, context)
        if unnamed is None:
            return False
        self._unnamed.discard([self.unnamed[unnamed]])
        return True

    @property
    def can_step_back(self) -> bool:
        """True if the last stroke waits, or depicts no feature and is newer than the last step of the history."""
        return bool(self.waiting) or (bool(self.unnamed) and self.unnamed[-1].depth >= self._depth)

    def follow_history(self, depth: int) -> None:
        """Record the depth of the session's history: of two strokes, the later one is undone first."""
        self._depth = depth

    def step_back(self) -> bool:
        """Discard the last stroke that waits, or else the last that depicts no feature; return True if there was one.

        One that is older than the last step of the history is kept.
        """
        if not self.can_step_back:
            return False
        if self.waiting:
            self.waiting.pop()
        else:
            self.discard_last()
        return True

    def discard_last(self) -> None:
        """Discard the last stroke that depicts no feature."""
        self._unnamed.discard(self.unnamed[-1:])

    def discard(self) -> bool:
        """Discard the strokes that wait and those that depict no feature; return True if there were any."""
        had = bool(self.waiting or self.unnamed)
        self.waiting = []
        self._unnamed.discard(self.unnamed)
        return had

    def left(self) -> None:
        """Keep all strokes: those that wait become sketches while another tool is used."""

    def hint(self, context: ToolContext) -> str:
        """Return the effect of a press, for the status bar."""
        if self.waiting:
            strokes = "stroke" if len(self.waiting) == 1 else f"{len(self.waiting)} strokes"
            return f"Preparing the recogniser for this character...   ·   Esc: discard the {strokes}"
        unnamed = len(self.unnamed)
        if unnamed > 1:
            return (
                f"{unnamed} strokes depict no feature   ·   click one to name it   ·   Delete: the last   ·   Esc: all"
            )
        if unnamed:
            text = UNRECOGNISED if self.unnamed[-1].depth >= context.session.depth else "A stroke depicts no feature"
            return f"{text}   ·   click the stroke to name it   ·   Delete, Esc: discard it"
        return "Draw a brow, lid, lip or other feature as it should look   ·   drag beside the head: orbit"
