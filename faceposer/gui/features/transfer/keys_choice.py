"""Part of the transfer dialog for the method "examples": the folder of key poses, regions and coverage."""

from typing import TYPE_CHECKING

from imgui_bundle import ImVec4, imgui

from faceposer.gui.widgets.basic import button_width, caption, choice, fitted_button, wrapped_text
from faceposer.gui.widgets.sliders import row_label
from faceposer.gui.widgets.text import displayed, shortened
from faceposer.gui.widgets.theme import FAINT, WARNING, Icon, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.transfer.key_parameters import REGIONS

if TYPE_CHECKING:
    from faceposer.gui.features.transfer.state import TransferState

_LABEL = 5.2
_REGION_LABELS = ("Whole face", "Halves", "Parts")
_REGION_TIPS = (
    "Clone the face as a whole, as the keys show it",
    "Clone the upper and lower half of the face separately, so that fewer keys give more expressions",
    "Clone brows, eyes and lower face separately, so that fewer keys give more expressions",
)


def draw_keys_choice(state: "TransferState") -> None:
    """Draw the folder of keys, the choice of regions, and how far the pose is from the keys."""
    rects, feature = state.context.widget_rects, state.by_keys
    opened = feature.opened
    row_label("Key poses", "Folder of key poses", _LABEL)
    imgui.align_text_to_frame_padding()
    name = "None" if opened.folder is None else displayed(opened.folder.name)
    imgui.text_colored(ImVec4(*FAINT), shortened(name, imgui.get_content_region_avail().x))
    tooltip("" if opened.folder is None else str(opened.folder))
    row_label("", "", _LABEL)
    width = button_width(3)
    if fitted_button(rects, "Open...", "transfer:keys:open", width, "Open a folder of key poses"):
        feature.ask_for_folder()
    imgui.same_line()
    if fitted_button(rects, "New...", "transfer:keys:new", width, "Create a folder of key poses for this target"):
        state.new_keys()
    imgui.same_line()
    if fitted_button(rects, "Edit", "transfer:keys:edit", width, "Show the key poses below the view") and state.open:
        state.hide()
        if not feature.shown:
            feature.toggle()
    if opened.reading and opened.keys is None:
        caption("Reading key poses...")
    if opened.keys is None:
        if opened.folder is None:
            caption("Open a folder of key poses, or create one: it proposes what expressions look like on the target.")
        return
    other = state.target_of_keys
    if other is not None:
        label = f"Change the target to {other[1]}"
        tip = "Choose the character for which these key poses were made"
        if fitted_button(rects, label, "transfer:keys:target", imgui.get_content_region_avail().x, tip):
            state.choose_target_of_keys()
    row_label("Regions", "Regions of the face that are cloned separately", _LABEL)
    chosen = choice(rects, "transfer:regions", _REGION_LABELS, REGIONS.index(opened.keys.folder.regions), _REGION_TIPS)
    feature.set_regions(REGIONS[chosen])
    imgui.dummy((0.0, em(0.2)))
    distance, remark = state.reach
    if remark:
        imgui.push_style_color(imgui.Col_.text, ImVec4(*WARNING))
        wrapped_text(f"{Icon.WARNING}  {remark}")
        imgui.pop_style_color()
    elif distance:
        caption(distance)
