"""Build the characters that are made with the morphable model of heads, or check the committed files.

Run from the root of a checkout, after the model, its attributes and its textures::

    python -m scripts.build_people            # write assets/characters/amara.npz and walter.npz
    python -m scripts.build_people --check    # rebuild in memory and compare with the committed files
"""

import argparse
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.identity.editing import head_editor
from faceposer.identity.eye_colour import EYE_COLOURS
from faceposer.identity.identity import SkinTexture
from faceposer.identity.skin_layers import random_layers
from faceposer.identity.texture_model import load_texture_model
from faceposer.model.character import Character
from faceposer.model.character_file import load_character, save_character
from scripts.build_assets import differences


@dataclass(frozen=True)
class Person:
    """Recipe of a person.

    Attributes:
        name: File name of the character.
        title: Displayed name.
        seed: Seed of the random head from which it starts.
        attributes: Values of attributes that are set on it.
        skin: Name of the skin of the texture model.
        tone: Tone of the skin in standard deviations.
        layers: Seed of hair, brows and stubble.
        eyes: Colour of the eyes.
    """

    name: str
    title: str
    seed: int
    attributes: Mapping[str, float]
    skin: str
    tone: float
    layers: int
    eyes: str


PEOPLE = (
    Person(
        "amara",
        "Amara",
        101,
        {"gender": 0.75, "age": -0.35, "african": 0.6, "weight": -0.3},
        "young_lightskinned_female_diffuse2",
        1.55,
        1,
        "dark brown",
    ),
    Person(
        "walter",
        "Walter",
        105,
        {"gender": -0.7, "age": 0.95, "caucasian": 0.35, "weight": 0.1},
        "old_darkskinned_male_diffuse",
        -0.45,
        5,
        "brown",
    ),
)
# Spread of the random heads, relative to people.
_SPREAD = 0.75


def build(person: Person) -> Character:
    """Return the character of ``person``, with the parts and shapes of the built-in man."""
    editor, textures = head_editor(load_character("man")), load_texture_model()
    head = editor.with_attributes(editor.random(person.seed, spread=_SPREAD), person.attributes)
    skin = textures.with_tone(textures.skins[person.skin], person.tone)
    layers = random_layers(person.layers, person.tone, person.attributes["gender"], max(person.attributes["age"], 0.0))
    texture = SkinTexture(tuple(skin.tolist()), layers, EYE_COLOURS[person.eyes])
    made = editor.with_head(replace(head, texture=texture))
    credits = f"{editor.model.credits} {textures.credits} {made.credits}"
    return replace(made, name=person.name, title=person.title, credits=credits)


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare with the existing files instead of writing")
    parser.add_argument("--output", type=Path, default=ROOT / "assets" / "characters", help="output folder")
    options = parser.parse_args()
    n_different = 0
    for person in PEOPLE:
        character, path = build(person), options.output / f"{person.name}.npz"
        if options.check:
            found = differences(character, load_character(path))
            n_different += len(found)
            print(f"{path}: {'differs in ' + ', '.join(sorted(found)) if found else 'as built'}")
        else:
            save_character(path, character)
            print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")
    return int(n_different > 0)


if __name__ == "__main__":
    sys.exit(main())
