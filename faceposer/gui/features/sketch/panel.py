"""Options of the tool Sketch."""

from typing import get_args

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details.sketch import draw_feature_list
from faceposer.gui.widgets.basic import caption, choice, heading
from faceposer.solve.constraints.sketch import SketchMethod
from faceposer.tools.sketch_tool import UNNAMED, UNRECOGNISED, SketchTool

_METHODS: tuple[SketchMethod, ...] = get_args(SketchMethod)
_METHOD_TIPS = (
    "The strokes are constraints of the solve, like pins and curves.",
    "The face starts from the pose of Gunnarsson and Maddock 2010, completed from the matched points. The weights of "
    "sketches do not count then.",
)


def draw_sketch_options(context: EditorContext, tool: SketchTool, preparing: bool) -> None:
    """Draw the method of the pose, and the state of the last stroke; ``preparing`` while there is no recogniser."""
    session = context.session
    heading(context.fonts, tool.label)
    before = _METHODS.index(session.document.sketch_method)
    labels = [method.capitalize() for method in _METHODS]
    chosen = choice(context.widget_rects, "sketch-method", labels, before, _METHOD_TIPS)
    if chosen != before and not context.busy:
        session.set_sketch_method(_METHODS[chosen])
    if preparing:
        caption("Preparing the recogniser for this character...")
    elif tool.unnamed:
        count = len(tool.unnamed)
        if count > 1:
            caption(f"{count} strokes depict no feature. Name the last:")
        elif tool.unnamed[-1].depth >= session.depth:
            caption(f"{UNRECOGNISED}. Name it:")
        else:
            caption("A stroke depicts no feature. Name it:")
        imgui.set_next_item_width(-1.0)
        opened = imgui.begin_combo("##unnamed", "Name the stroke", imgui.ComboFlags_.height_largest.value)
        context.widget_rects.record("sketch-name")
        if opened:
            draw_feature_list(context, UNNAMED)
            imgui.end_combo()
    else:
        caption("Draw a brow, a lid, a lip, a nose wing, a cheek line or the jaw line as it should look, in any view.")
