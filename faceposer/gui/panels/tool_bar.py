"""The tool bar at the left of the view, and the options of the chosen tool in the side panel."""

from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.errors import counted
from faceposer.geometry.strokes import STROKE_SHAPES
from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details.stroke import ENERGY_TIPS
from faceposer.gui.widgets.basic import button_width, caption, choice, fitted_button, heading
from faceposer.gui.widgets.sliders import row_label, slider
from faceposer.gui.widgets.text import text_width
from faceposer.gui.widgets.theme import ACCENT_DARK, HELD, Icon, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.model.character import Character
from faceposer.session.place_names import MEASURES
from faceposer.solve.constraints.stroke import STROKE_ENERGIES
from faceposer.tools.distance_tool import add_distance
from faceposer.tools.fix_tool import fixed_region_index, toggle_fixed_region

STRIP_WIDTH = 3.2
TOOL_ICONS = {
    "point": Icon.POINT,
    "distance": Icon.DISTANCE,
    "stroke": Icon.STROKE,
    "curve": Icon.CURVE,
    "sketch": Icon.SKETCH,
    "fix": Icon.FIX,
    "gaze": Icon.GAZE,
    "trajectory": Icon.PATH,
    "head": Icon.HEAD,
}
#: Regions with a button, by their labels; names with spaces belong to characters trained from examples.
HELD_REGIONS: dict[str, tuple[str, ...]] = {
    "Mouth": ("mouth", "lip_upper", "lip_lower"),
    "Eyes": ("lids_left", "lids_right", "eye_left", "eye_right", "eye left", "eye right"),
    "Brows": ("brow_left", "brow_right", "forehead", "brow left", "brow right"),
    "Nose": ("nose",),
    "Cheeks": ("cheek_left", "cheek_right"),
    "Jaw": ("jaw",),
}


def draw_tool_strip(context: EditorContext) -> None:
    """Draw the buttons of the tools in a column, and that of symmetry."""
    usable = [tool.name for tool in context.toolbox.usable_tools]
    # Smaller buttons if the window is too low for all of them.
    spacing = imgui.get_style().item_spacing.y
    room = imgui.get_content_region_avail().y - em(0.4) - (len(usable) + 2) * spacing
    side = max(min(em(2.3), room / (len(usable) + 1)), em(1.0))
    for name in usable:
        _strip_button(
            context, f"tool-{name}", TOOL_ICONS.get(name, Icon.POINT), side, context.toolbox.chosen.name == name
        )
    imgui.dummy((0.0, em(0.4)))
    _strip_button(context, "symmetry", Icon.SYMMETRY, side, context.toolbox.tool_settings.symmetry.on)


def _strip_button(context: EditorContext, action: str, icon: str, side: float, on: bool) -> None:
    colour = ImVec4(*ACCENT_DARK) if on else ImVec4(0.0, 0.0, 0.0, 0.0)
    imgui.push_style_color(imgui.Col_.button, colour)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0.0, 0.0))
    imgui.begin_disabled(not context.actions[action].enabled())
    if imgui.button(f"{icon}##{action}", ImVec2(side, side)):
        context.actions[action].run()
    imgui.end_disabled()
    imgui.pop_style_var()
    imgui.pop_style_color()
    context.widget_rects.record(action)
    tooltip(context.actions[action].tooltip)


def draw_tool_options(context: EditorContext) -> None:
    """Draw the options of the chosen tool, if it has any."""
    name = context.toolbox.chosen.name
    draw = {
        "distance": _distance,
        "stroke": _stroke,
        "curve": _curve,
        "fix": _fix,
    }.get(name)
    if draw is not None:
        heading(context.fonts, context.toolbox.chosen.label)
        draw(context)


def _distance(context: EditorContext) -> None:
    """Draw a button for each common distance."""
    features = context.session.model.character.feature_points
    known = [(title, pair) for title, pair in MEASURES.items() if set(pair) <= features.keys()]
    if not known:
        caption("Drag from one point of the face to another.")
    for i, (title, (first, second)) in enumerate(known):
        if i % 2:
            imgui.same_line()
        width = button_width(2) if not i % 2 else imgui.get_content_region_avail().x
        tip = f"Add a distance constraint for the {title}, set with a slider"
        pressed = fitted_button(context.widget_rects, title.capitalize(), f"measure:{title}", width, tip)
        if pressed and not context.busy:
            add_distance((features[first], features[second]), context.viewport, context.toolbox.tool_settings)


def _stroke(context: EditorContext) -> None:
    options, tool = context.toolbox.tool_settings.options, context.toolbox.stroke_tool
    tips = ("An open line.", "A closed line.", "A filled region.")
    labels = [shape.capitalize() for shape in STROKE_SHAPES]
    options.shape = STROKE_SHAPES[
        choice(context.widget_rects, "shape", labels, STROKE_SHAPES.index(options.shape), tips)
    ]
    options.brush = _brush(context, "brush", options.brush, 60.0)
    chosen = choice(
        context.widget_rects, "energy", ("Distance", "Image"), STROKE_ENERGIES.index(options.energy), ENERGY_TIPS
    )
    options.energy = STROKE_ENERGIES[chosen]
    caption("Now draw the target of the stroke." if tool.draws_target else "Draw a stroke on the face.")


def _curve(context: EditorContext) -> None:
    count = len(context.toolbox.curve_tool.points)
    if not count:
        caption("Click points of a curve on the face, then accept it and drag its control points.")
        return
    imgui.begin_disabled(count < 2)
    if imgui.button(f"Accept {counted(count, 'point')}", (-1.0, 0.0)):
        context.toolbox.accept()
    imgui.end_disabled()
    context.widget_rects.record("curve:accept")
    tooltip(f"Accept the curve, then drag its control points{context.actions['apply'].bracketed_shortcut}")


def _fix(context: EditorContext) -> None:
    options = context.toolbox.tool_settings.options
    tips = ("Paint the area to hold.", "Encircle the area to hold.")
    chosen = choice(context.widget_rects, "fix", ("Brush", "Lasso"), int(options.fix_mode == "lasso"), tips)
    options.fix_mode = "lasso" if chosen else "brush"
    if options.fix_mode == "brush":
        options.fix_brush = _brush(context, "fix-brush", options.fix_brush, 160.0)
    known = regions_to_hold(context.session.model.character)
    padding = 2.0 * imgui.get_style().frame_padding.x
    widest = max((text_width(title) + padding for title, _ in known), default=1.0)
    columns = min(max(int(imgui.get_content_region_avail().x // widest), 1), 3)
    for i, (title, names) in enumerate(known):
        if i % columns:
            imgui.same_line()
        width = button_width(columns - i % columns)
        held = fixed_region_index(names, context.viewport) is not None
        if held:
            imgui.push_style_color(imgui.Col_.button, ImVec4(*HELD[:3], 0.55))
        verb = "Release" if held else "Hold"
        tip = f"{verb} the {title.lower()} in place" if not held else f"{verb} the {title.lower()}"
        pressed = fitted_button(context.widget_rects, title, f"hold:{title}", width, tip)
        if held:
            imgui.pop_style_color()
        if pressed and not context.busy:
            toggle_fixed_region(names, context.viewport, context.toolbox.tool_settings)


def regions_to_hold(character: Character) -> list[tuple[str, tuple[str, ...]]]:
    """Return label and names of each region with a button: those of ``HELD_REGIONS``, or all if there are none."""
    regions = character.regions
    known = [(title, names) for title, names in HELD_REGIONS.items() if any(name in regions for name in names)]
    return known or [(name.replace("_", " ").capitalize(), (name,)) for name in sorted(regions)]


def _brush(context: EditorContext, name: str, value: float, most: float) -> float:
    keys = [context.actions[action].shortcut for action in ("brush-thinner", "brush-wider")]
    tip = f"Width of the brush{f'  ({keys[0]} and {keys[1]})' if all(keys) else ''}"
    row_label("Brush", tip)
    imgui.set_next_item_width(-1.0)
    _, value = slider(f"##{name}", value, 1.0, most, "%.0f px", imgui.SliderFlags_.clamp_on_input.value)
    context.widget_rects.record(name)
    tooltip(tip)
    return value
