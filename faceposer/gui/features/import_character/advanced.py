"""Advanced settings of an import: sizes of the model, and what is otherwise inferred about a rig."""

from imgui_bundle import imgui

from faceposer.gui.features.import_character.form import ImportForm
from faceposer.gui.widgets.basic import choice
from faceposer.gui.widgets.sliders import row_label
from faceposer.gui.widgets.theme import em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.gui.widgets.widget_rects import WidgetRects

_NUMBERS = (
    ("dimensions", "Dimensions", 500, "Number of modes; 0 chooses it from the energy of the examples"),
    ("components", "Components", 500, "Number of factor analyzers of the prior; 0 chooses it from held-out data"),
    ("factors", "Factors", 500, "Number of factors of each analyzer; 0 chooses it from held-out data"),
)
_SIDES = ("auto", "as-named", "exchanged")
_SIDE_LABELS = ("Automatic", "As named", "Exchanged")
_SIDE_TIPS = (
    "Exchange left and right where shapes move the other side of the face, as named from the viewer's side",
    "Keep the names of the file, even if they move the other side of the face",
    "Exchange left and right in all names",
)
_ALIGN_LABELS = ("Automatic", "As stored")
_ALIGN_TIPS = (
    "Align shapes that are moved, scaled, turned or mirrored with the neutral face, and correct the unit and the sign "
    "of displacements",
    "Read the shapes where and in the unit in which they are stored",
)
_RANGES = (0, 1, 100)
_RANGE_LABELS = ("Automatic", "0 to 1", "0 to 100")
_RANGE_TIPS = (
    "By the version of VRM and the largest weight",
    "Weights of the expressions of a VRM avatar are from 0 to 1",
    "Weights of the expressions of a VRM avatar are from 0 to 100",
)


def draw_advanced(rects: WidgetRects, form: ImportForm, label_width: float) -> None:
    """Draw the advanced settings of ``form``. What was inferred is in the notes of the summary.

    Args:
        rects: Receives the places of the widgets.
        form: The entries.
        label_width: Width of the labels of the dialog, in em.
    """
    width = label_width - imgui.get_style().indent_spacing / em()
    if form.kind == "rig":
        _draw_reading(rects, form, width)
    for key, label, most, tip in _NUMBERS:
        if key == "dimensions" and form.kind == "rig":
            continue
        value = getattr(form, key)
        row_label(label, tip, width)
        imgui.set_next_item_width(em(8))
        _, value = imgui.input_int(f"##{key}", value)
        rects.record(f"import:{key}")
        tooltip(tip)
        setattr(form, key, min(max(value, 0), most))
        if not value:
            imgui.same_line()
            imgui.text_disabled("Chosen from the data")
    row_label("Credits", "Origin and licence of the character", width)
    imgui.set_next_item_width(-1.0)
    _, form.credits = imgui.input_text_with_hint("##credits", "Origin and licence", form.credits)
    rects.record("import:credits")


def _draw_reading(rects: WidgetRects, form: ImportForm, width: float) -> None:
    """Draw the readings of a rig's names, shapes and weights; *Automatic* infers them from the file."""
    row_label("Sides", "Left and right in the names of the shapes; the summary reports exchanged names", width)
    form.sides = _SIDES[choice(rects, "import:sides", _SIDE_LABELS, _SIDES.index(form.sides), _SIDE_TIPS)]  # type: ignore[assignment]
    row_label("Shapes", "Place, unit and sign of the shapes; the summary reports corrections", width)
    form.align_shapes = choice(rects, "import:align", _ALIGN_LABELS, int(not form.align_shapes), _ALIGN_TIPS) == 0
    if form.source.strip().strip("\"'").lower().endswith(".vrm"):
        row_label("Weights", "Range of the weights of a VRM avatar's expressions", width)
        chosen = choice(rects, "import:range", _RANGE_LABELS, _RANGES.index(form.weights_range), _RANGE_TIPS)
        form.weights_range = _RANGES[chosen]
