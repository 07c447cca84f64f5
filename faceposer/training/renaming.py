"""Renaming of characters and their shapes."""

from collections.abc import Mapping
from dataclasses import replace

from faceposer.errors import FacePoserError
from faceposer.model.character import Character


def renamed(
    character: Character,
    where: str,
    name: str | None,
    title: str | None,
    credits: str | None,
    shapes: Mapping[str, str],
) -> Character:
    """Return ``character`` with new names; None keeps a name.

    Args:
        character: The character.
        where: Name of its file, as the start of an error message.
        name: New short name.
        title: New displayed name.
        credits: New source and licence.
        shapes: New names of shapes by old names.

    Raises:
        FacePoserError: If there is no such shape, or two shapes would have the same name.
    """
    for old in shapes:
        if old not in character.shape_names:
            raise FacePoserError(
                f"{where} has no shape '{old}'; 'faceposer character info --json' lists the names of its shapes."
            )
    names = tuple(shapes.get(shape, shape) for shape in character.shape_names)
    duplicate = next((shape for shape in names if names.count(shape) > 1), None)
    if duplicate is not None:
        raise FacePoserError(f"Two shapes would be called '{duplicate}'; choose another name for one of them.")
    statistics = character.statistics
    if statistics is not None:
        # The statistics refer to shapes by name.
        renamed_shapes = tuple(shapes.get(shape, shape) for shape in statistics.shape_names)
        statistics = replace(statistics, shape_names=renamed_shapes)
    return replace(
        character,
        name=character.name if name is None else name,
        title=character.title if title is None else title,
        credits=character.credits if credits is None else credits,
        shape_names=names,
        statistics=statistics,
    )
