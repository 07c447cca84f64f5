"""``faceposer identity info``: describes the head of a character."""

import argparse
import dataclasses
import json
from typing import TYPE_CHECKING, Any

from faceposer.cli.identity.heads import HEAD_HELP, OpenedHead, opened_head
from faceposer.errors import printable

if TYPE_CHECKING:
    from faceposer.identity.attributes import Attribute

NAME = "info"


def add_parser(subcommands: Any) -> None:
    """Add the parser of ``info`` to ``subcommands``."""
    parser = subcommands.add_parser(
        NAME,
        help="describe a head: attributes, skin, distance from the average",
        description="Describe the head of a character: its attributes, its skin, and its distance from the average "
        "(docs/identity.md).",
    )
    parser.add_argument("character", metavar="CHARACTER", help=HEAD_HELP)
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(options: argparse.Namespace) -> int:
    """Print the description and return the exit status."""
    head = opened_head(options.character)
    about = description_of(head)
    if options.json:
        print(json.dumps(about, indent=1, allow_nan=False))
    else:
        print("\n".join(_lines(head, about)))
    return 0


def description_of(head: OpenedHead) -> dict[str, Any]:
    """Return the JSON description of a head."""
    from faceposer.identity.texture_model import load_texture_model

    editor, identity = head.editor, head.identity
    texture: dict[str, Any] = {"kind": "own"}
    if identity.texture is not None:
        model = load_texture_model()
        texture = {
            "kind": "model",
            "tone": model.tone(identity.texture.coefficients),
            "age": model.label(identity.texture.coefficients, "age"),
            "gender": model.label(identity.texture.coefficients, "gender"),
            "layers": dataclasses.asdict(identity.texture.layers),
            "eyes": identity.texture.eyes,
        }
    values = editor.measure(identity)
    return {
        "name": editor.character.name,
        "title": editor.character.title,
        "topology": "man",
        "skin_vertices": editor.template.n_skin,
        "control_vertices": editor.template.n_control,
        "modes": editor.model.n_coefficients,
        "distance": editor.distance(identity),
        "farther_from_average": editor.model.commonness(identity.shape.mean(axis=0)),
        "texture": texture,
        "attributes": {
            attribute.name: _described(attribute, values[attribute.name]) for attribute in editor.attributes.attributes
        },
    }


def _described(attribute: "Attribute", value: float) -> dict[str, Any]:
    result: dict[str, Any] = {"value": value, "limits": list(attribute.limits)}
    if attribute.unit:
        result["measurement"], result["unit"] = attribute.measurement(value), attribute.unit
    if attribute.relative_to:
        result["relative_to"] = attribute.relative_to
    return result


def _lines(head: OpenedHead, about: dict[str, Any]) -> list[str]:
    texture = about["texture"]
    skin = "the character's own image"
    if texture["kind"] == "model":
        skin = f"of the model, tone {texture['tone']:.2f}, age {texture['age']:.2f}, gender {texture['gender']:.2f}"
    lines = [
        printable(f"{about['title']} ('{about['name']}')"),
        f"topology: that of the built-in man, {about['skin_vertices']} vertices of the skin, {about['modes']} modes",
        f"distance from the average: {about['distance']:.2f} (people: about 1); {about['farther_from_average']:.0%} of "
        "random heads are farther",
        f"skin: {skin}",
    ]
    groups: dict[str, list[Attribute]] = {}
    for attribute in head.editor.attributes.attributes:
        groups.setdefault(attribute.group, []).append(attribute)
    width = max(len(name) for name in about["attributes"])
    for group, attributes in groups.items():
        lines += ["", group]
        for attribute in attributes:
            entry = about["attributes"][attribute.name]
            lines.append(f"  {attribute.name:{width}} {entry['value']:6.2f}{_measured(attribute, entry)}")
    return lines


def _measured(attribute: "Attribute", entry: dict[str, Any]) -> str:
    ends = f"{attribute.less} to {attribute.more}"
    if not attribute.unit:
        return f"            {ends}"
    if attribute.relative_to:
        return f"  {entry['measurement']:+6.2f} {attribute.unit}  {ends}, against {attribute.relative_to}"
    return f"  {entry['measurement']:6.2f} {attribute.unit}  {ends}"
