"""Settings of a sketch, and the list of the features that a stroke may depict."""

from collections.abc import Sequence

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details.sliders import weight_slider
from faceposer.gui.widgets.basic import disabled
from faceposer.gui.widgets.text import text_width
from faceposer.gui.widgets.theme import FAINT, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.model.feature_curves import drawable_features
from faceposer.sketch.recognition import Candidate
from faceposer.solve.constraints.sketch import SketchConstraint

# Least probability that is shown.
_NOTABLE = 0.005
# Width of the list, in units of the font size.
_LIST = 11.0


def draw(context: EditorContext, index: int, constraint: SketchConstraint) -> None:
    """Draw the list of features, the button for the next one, and the weight."""
    _draw_combo(context, index, constraint.feature)
    tool = context.toolbox.sketch_tool
    others = any(candidate.feature != constraint.feature for candidate in tool.candidates_of(index, context.viewport))
    with disabled(not others):
        if imgui.button("Next feature", (-1.0, 0.0)) and not context.busy:
            tool.choose_next(index, context.viewport)
    context.widget_rects.record("sketch:next")
    tip = "The next most probable feature; a click on the name at the stroke does the same"
    tooltip(tip if others else "No other feature is probable; choose any from the list above")
    weight_slider(context, index, constraint)


def draw_feature_list(context: EditorContext, index: int) -> None:
    """Draw a row for each feature that stroke ``index`` may depict, and choose that pressed.

    Negative indices are those of unnamed strokes.
    """
    tool = context.toolbox.sketch_tool
    constraints = context.session.document.constraints
    present = ""
    if index < 0:
        candidates = tool.unnamed[index].candidates if len(tool.unnamed) >= -index else ()
    elif isinstance(sketch := constraints[index] if index < len(constraints) else None, SketchConstraint):
        present, candidates = sketch.feature, tool.candidates_of(index, context.viewport)
    else:
        imgui.close_current_popup()
        return
    character, style = context.session.model.character, imgui.get_style()
    for name, share in _listed(candidates, drawable_features(character)):
        pressed, _ = imgui.selectable(f"##{name}", name == present, 0, (max(em(_LIST), 0.0), 0.0))
        context.widget_rects.record(f"feature:{name}")
        imgui.same_line(style.window_padding.x)
        imgui.text_unformatted(name)
        if share >= _NOTABLE:
            text = f"{100.0 * share:.0f} %"
            imgui.same_line(style.window_padding.x + em(_LIST) - text_width(text))
            imgui.text_colored(FAINT, text)
        if pressed and name != present:
            choose_feature(context, index, name)


def _listed(candidates: Sequence[Candidate], drawable: Sequence[str]) -> list[tuple[str, float]]:
    """Return names and probabilities: first the candidates, then the other features, in their fixed order."""
    found = [(candidate.feature, candidate.probability) for candidate in candidates]
    known = {name for name, _ in found}
    return found + [(name, 0.0) for name in drawable if name not in known]


def choose_feature(context: EditorContext, index: int, name: str) -> None:
    """Make sketch ``index``, or the unnamed stroke of that negative index, depict the feature ``name``."""
    tool = context.toolbox.sketch_tool
    if context.busy:
        return
    if index < 0:
        tool.name_stroke(name, context.viewport, index)
    else:
        tool.choose_feature(index, name, context.viewport)
    context.redraw()


def _draw_combo(context: EditorContext, index: int, present: str) -> None:
    """Draw the drop-down list of features of sketch ``index``."""
    imgui.set_next_item_width(-1.0)
    opened = imgui.begin_combo("##feature", present, imgui.ComboFlags_.height_largest.value)
    context.widget_rects.record("detail:feature")
    if opened:
        draw_feature_list(context, index)
        imgui.end_combo()
    else:
        tooltip("Feature that the stroke depicts, the most probable first")
