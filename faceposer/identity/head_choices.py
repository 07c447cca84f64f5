"""Heads as commands and programs ask for them, by values of attributes and names of skins, which are checked."""

import dataclasses
import difflib
import math
from collections.abc import Collection, Mapping

from faceposer.errors import FacePoserError, short_name
from faceposer.identity.attributes import ETHNICITIES, HeadAttributes
from faceposer.identity.editing import HeadEditor
from faceposer.identity.identity import GROTESQUE, Identity, SkinTexture
from faceposer.identity.texture_model import LIMIT, load_texture_model
from faceposer.model.character import Character
from faceposer.model.character_names import joined_credits

#: Skins that are not names of the texture model: a random one, and the character's own image.
RANDOM_SKIN, OWN_SKIN = "random", "own"
#: Largest seed, spread of random heads relative to people, factor of a caricature, and tone of a skin.
MOST_SEED, MOST_VARIETY, MOST_CARICATURE, MOST_TONE = 2**32 - 1, 2.0, GROTESQUE, LIMIT
#: Spread of random heads if none is given.
VARIETY = 0.8
# Rounding in values that are to add up to zero.
_ROUNDING = 1e-6


def checked_values(attributes: HeadAttributes, values: Mapping[str, float]) -> dict[str, float]:
    """Return ``values`` by names of attributes, in which "_" may replace "-".

    Raises:
        FacePoserError: If there is no such attribute, or a value is not within its natural limits.
    """
    known = {attribute.name for attribute in attributes.attributes}
    result: dict[str, float] = {}
    for given, value in values.items():
        name = given.replace("_", "-")
        if name not in known:
            close = difflib.get_close_matches(name, known, 1)
            guess = f"; did you mean '{close[0]}'?" if close else f"; attributes are {', '.join(attributes.names)}."
            raise FacePoserError(f"There is no attribute '{short_name(given)}' of heads{guess}")
        low, high = attributes[name].limits
        if not (math.isfinite(value) and low <= value <= high):
            raise FacePoserError(
                f"The attribute '{name}' must be a number from {low:g} to {high:g}, not {value:g}; 0 is average."
            )
        if name in result:
            raise FacePoserError(f"The attribute '{name}' is given twice; give one value.")
        result[name] = float(value)
    shares = [result[name] for name in ETHNICITIES if name in result]
    if len(shares) == len(ETHNICITIES) and abs(sum(shares)) > _ROUNDING:
        raise FacePoserError(
            f"The values of {', '.join(ETHNICITIES)} must add up to 0, not {sum(shares):g}; leave one of them out."
        )
    return result


def checked_segments(editor: HeadEditor, names: Collection[str]) -> tuple[str, ...]:
    """Return the names of segments.

    Raises:
        FacePoserError: If there is no such segment.
    """
    for name in names:
        if name not in editor.segment_names:
            raise FacePoserError(
                f"There is no segment '{short_name(name)}' of heads; segments are {', '.join(editor.segment_names)}."
            )
    return tuple(names)


def skin_names() -> dict[str, str]:
    """Return the names of the skins that the texture model was learned from, by short names such as "old-dark-male"."""
    short = {}
    for name in load_texture_model().skins:
        words = name.replace("skinned", "").replace("diffuse", "").rstrip("_")
        short["-".join(word for word in words.split("_") if word)] = name
    return short


def with_skin(
    editor: HeadEditor, identity: Identity, choice: str | None = None, tone: float | None = None, seed: int = 0
) -> Identity:
    """Return the head with another skin.

    Args:
        editor: Editor of the character.
        identity: A head.
        choice: "random" for one that fits the head's age and gender, "own" for the character's own image, a name of
            ``skin_names``, or None to keep the present one.
        tone: Tone in standard deviations, negative light, positive dark; None to keep it. The character's own image is
            replaced by the skin of the model that is most like it, since only those have a tone.
        seed: Seed of a random skin.

    Raises:
        FacePoserError: If there is no such skin.
    """
    if choice == RANDOM_SKIN:
        texture: SkinTexture | None = editor.random_texture(seed, identity)
    elif choice == OWN_SKIN:
        texture = None
    elif choice is None:
        texture = identity.texture
    else:
        texture = _named_skin(editor, identity, choice)
    if tone is not None:
        texture = texture or editor.own_texture()
        toned = load_texture_model().with_tone(texture.coefficients, tone)
        texture = dataclasses.replace(texture, coefficients=tuple(toned.tolist()))
    return dataclasses.replace(identity, texture=texture)


def changed_head(
    editor: HeadEditor,
    identity: Identity,
    caricature: float = 1.0,
    values: Mapping[str, float] | None = None,
    skin: str | None = None,
    tone: float | None = None,
    seed: int = 0,
) -> Identity:
    """Return a head as a caricature, then with other attributes, and last with another skin.

    Args:
        editor: Editor of the character.
        identity: A head.
        caricature: Factor on the deviation from the average.
        values: Values by name of attribute.
        skin: As for ``with_skin``.
        tone: As for ``with_skin``.
        seed: Seed of a random skin, and of the pattern of asymmetry.

    Raises:
        FacePoserError: If an attribute or the skin does not exist, or a value is out of range.
    """
    wanted = checked_values(editor.attributes, values or {})
    if caricature != 1.0:
        identity = identity.scaled(caricature)
    if tone is not None and skin is None and identity.texture is None:
        # A skin with a tone also follows age and gender, as that of the character would.
        identity = dataclasses.replace(identity, texture=editor.own_texture())
    if wanted:
        identity = editor.with_attributes(identity, wanted, seed=seed)
    return with_skin(editor, identity, skin, tone, seed)


def _named_skin(editor: HeadEditor, identity: Identity, choice: str) -> SkinTexture:
    names = skin_names()
    skins = load_texture_model().skins
    name = names.get(choice, choice)
    if name not in skins:
        raise FacePoserError(
            f"There is no skin '{short_name(choice)}'; skins are {RANDOM_SKIN}, {OWN_SKIN}, {', '.join(names)}."
        )
    return dataclasses.replace(editor.random_texture(0, identity), coefficients=tuple(skins[name].tolist()))


def mixed_heads(editor: HeadEditor, one: Identity, other_editor: HeadEditor, other: Identity, share: float) -> Identity:
    """Return the head on the line from ``one``, a head of ``editor``, at ``share`` 0, to ``other``, at 1.

    Skins are mixed, too: instead of differing images of the characters, the skins of the model most like them.
    """
    if one.texture is None and other.texture is None:
        images = [each.character.textures.get("skin") for each in (editor, other_editor)]
        if images[0] == images[1]:
            return one.mixed(other, share)
    if share > 0.0:
        one, other = (
            head if head.texture is not None else dataclasses.replace(head, texture=each.own_texture())
            for head, each in ((one, editor), (other, other_editor))
        )
    return one.mixed(other, share)


def named_character(editor: HeadEditor, identity: Identity, name: str, title: str) -> Character:
    """Return the character of ``editor`` with the head ``identity``, and with other names.

    Its credits name the sources of the model, unless it is the character's own head.

    Raises:
        FacePoserError: If the identity does not have the numbers of the model.
    """
    character = editor.with_head(identity)
    sources = [editor.character.credits]
    if character is not editor.character:
        sources.append(editor.model.credits)
    if identity.texture is not None:
        sources.append(load_texture_model().credits)
    return dataclasses.replace(character, name=name, title=title, credits=joined_credits(*sources))
