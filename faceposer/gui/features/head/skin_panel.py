"""The skin of the head in its tab: tone, age, and the layers of hair, brows and lips."""

from collections.abc import Callable
from dataclasses import replace

from imgui_bundle import ImVec4, imgui

from faceposer.gui.features.head.state import HeadState
from faceposer.gui.widgets.basic import button_width, caption, fitted_button, heading
from faceposer.gui.widgets.sliders import reset_button, row_label, slider, slider_room
from faceposer.identity.eye_colour import EYE_COLOURS
from faceposer.identity.identity import Identity, SkinTexture
from faceposer.identity.skin_layers import BROW_STYLES, HAIR_STYLES, Colour
from faceposer.identity.texture_model import LIMIT, load_texture_model

_SAME = 1e-3
_CLAMP = imgui.SliderFlags_.clamp_on_input.value
# Sliders of layers: field, label, tooltip.
_SHARES = (
    ("brow_strength", "Brow density", "Density of the brows"),
    ("beard", "Stubble", "Density of the stubble"),
    ("lip_redness", "Lipstick", "Redness of the lips, from that of the skin to lipstick"),
    ("lash_line", "Eyeliner", "Darkness of the edges of the lids"),
)
_Change = Callable[[SkinTexture], SkinTexture]


def draw_skin(head: HeadState) -> None:
    """Draw the section of the skin."""
    context = head.context
    heading(context.fonts, "Skin")
    texture = head.identity.texture
    if texture is None:
        caption("The character has a skin of its own, which does not follow age and gender until you edit it.")
        tip = "Replace the skin by one of the model that is most like it, whose tone, brows and hair can change"
        if fitted_button(context.widget_rects, "Edit the skin", "head:edit-skin", button_width(1), tip):
            head.set_identity(replace(head.identity, texture=head.own_texture), "Edit the skin")
        return
    model = load_texture_model()

    def with_coefficients(change: Callable[[tuple[float, ...]], list[float]]) -> _Change:
        return lambda before: replace(before, coefficients=tuple(change(before.coefficients)))

    tone = model.tone(texture.coefficients)
    row_label("Tone", "Tone of the skin, from light to dark")

    def toned(value: float) -> _Change:
        return with_coefficients(lambda c: model.with_tone(c, value).tolist())

    _row(head, "tone", "Set tone", tone, (-LIMIT, LIMIT), lambda own: model.tone(own.coefficients), toned)
    for name, title, limits in (("age", "Skin age", (-0.5, 1.5)), ("gender", "Skin gender", (-1.5, 1.5))):
        row_label(title, f"{title} as in the texture, apart from the shape")

        def labelled(value: float, name: str = name) -> _Change:
            return with_coefficients(lambda c: model.with_label(c, name, value).tolist())

        def own_label(own: SkinTexture, name: str = name) -> float:
            return model.label(own.coefficients, name)

        present = model.label(texture.coefficients, name)
        _row(head, f"skin-{name}", f"Set {title.lower()}", present, limits, own_label, labelled)
    _draw_styles(head, texture)
    _draw_eyes(head, texture)
    for field, title, tip in _SHARES:
        row_label(title, tip)

        def own_share(own: SkinTexture, field: str = field) -> float:
            return float(getattr(own.layers, field))

        def shared(value: float, field: str = field) -> _Change:
            return _with_layer(field, value)

        _row(head, field, f"Set {title.lower()}", getattr(texture.layers, field), (0.0, 1.0), own_share, shared)


def _draw_styles(head: HeadState, texture: SkinTexture) -> None:
    context, layers = head.context, texture.layers
    styles = (
        ("hair", "Hair", HAIR_STYLES, layers.hair, layers.hair_colour, "hair_colour"),
        ("brows", "Brow shape", BROW_STYLES, layers.brows, layers.brow_colour or layers.hair_colour, "brow_colour"),
    )
    for field, title, names, chosen, colour, colour_field in styles:
        row_label(title)
        imgui.set_next_item_width(-2.0 * imgui.get_frame_height())
        changed, index = imgui.combo(f"##{field}", names.index(chosen), [name.capitalize() for name in names])
        context.widget_rects.record(f"head:{field}")
        if changed and not context.busy:
            _set(head, f"Set {title.lower()}", _with_layer(field, names[index]))
        imgui.same_line()
        shown = ImVec4(*colour, 1.0)
        flags = imgui.ColorEditFlags_.no_inputs.value | imgui.ColorEditFlags_.no_alpha.value
        picked, new = imgui.color_edit4(f"##{colour_field}", shown, flags)
        context.widget_rects.record(f"head:{colour_field}")
        _apply(head, colour_field, f"Set colour of {field}", (picked, 0.0), _with_layer(colour_field, _rgb(new)))


def _draw_eyes(head: HeadState, texture: SkinTexture) -> None:
    context = head.context
    row_label("Eye colour", "Colour of the irises")
    names = ["own", *EYE_COLOURS]
    known = {colour: name for name, colour in EYE_COLOURS.items()}
    chosen = "own" if texture.eyes is None else known.get(texture.eyes, "other")
    shown = names if chosen in names else [*names, chosen]
    imgui.set_next_item_width(-2.0 * imgui.get_frame_height())
    changed, index = imgui.combo("##eyes", shown.index(chosen), [name.capitalize() for name in shown])
    context.widget_rects.record("head:eyes")
    if changed and not context.busy and shown[index] != "other":
        _set(head, "Set colour of eyes", lambda before: replace(before, eyes=EYE_COLOURS.get(shown[index])))
    imgui.same_line()
    colour = texture.eyes or EYE_COLOURS["blue"]
    flags = imgui.ColorEditFlags_.no_inputs.value | imgui.ColorEditFlags_.no_alpha.value
    picked, new = imgui.color_edit4("##eye-colour", ImVec4(*colour, 1.0), flags)
    context.widget_rects.record("head:eye-colour")
    _apply(head, "eye-colour", "Set colour of eyes", (picked, 0.0), lambda before: replace(before, eyes=_rgb(new)))


def _rgb(colour: ImVec4) -> Colour:
    red, green, blue = (min(max(round(float(colour[k]), 3), 0.0), 1.0) for k in range(3))
    return red, green, blue


def _row(
    head: HeadState,
    name: str,
    label: str,
    value: float,
    limits: tuple[float, float],
    own_value: Callable[[SkinTexture], float],
    change: Callable[[float], _Change],
) -> None:
    """Draw a slider and the button that brings back the value of the character's own skin."""
    low, high = limits
    imgui.set_next_item_width(slider_room())
    changed, new = slider(f"##{name}", value, min(low, value), max(high, value), "%.2f", _CLAMP)
    head.context.widget_rects.record(f"head:{name}")
    _apply(head, name, label, (changed, new), change(new))
    # The own skin is estimated when it is first needed, not in the first frame that shows a random one.
    own = head.known_own_texture
    same = own is not None and abs(value - own_value(own)) < _SAME
    tip = "Back to the value of the character's own skin"
    if reset_button(head.context.widget_rects, f"head:{name}", same, tip) and not head.context.busy:
        _set(head, label, change(own_value(head.own_texture)))


def _apply(head: HeadState, key: str, label: str, value: tuple[bool, float], change: _Change) -> None:
    head.edit(key, label, value[0], lambda before: _changed(before, change))


def _set(head: HeadState, label: str, change: _Change) -> None:
    head.set_identity(_changed(head.identity, change), label)


def _changed(identity: Identity, change: _Change) -> Identity:
    assert identity.texture is not None
    return replace(identity, texture=change(identity.texture))


def _with_layer(field: str, value: object) -> _Change:
    return lambda before: replace(before, layers=replace(before.layers, **{field: value}))  # type: ignore[arg-type]
