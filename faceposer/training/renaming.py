"""Other names for a character and its shapes."""

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
    """Return ``character`` with other names, those that are None staying as they are.

    Args:
        character: The character.
        where: What it is in, to begin a sentence with.
        name: Short name.
        title: Name to show.
        credits: Where it comes from, and its licence.
        shapes: New names of shapes by their old ones.

    Raises:
        FacePoserError: If there is no such shape, or two would have the same name.
    """
    for old in shapes:
        if old not in character.shape_names:
            raise FacePoserError(f"{where} has no shape '{old}'; see 'faceposer character info --json'.")
    names = tuple(shapes.get(shape, shape) for shape in character.shape_names)
    twice = next((shape for shape in names if names.count(shape) > 1), None)
    if twice is not None:
        raise FacePoserError(f"Two shapes would be called '{twice}'; choose another name for one of them.")
    statistics = character.statistics
    if statistics is not None:
        # The statistics speak of the shapes by their names.
        theirs = tuple(shapes.get(shape, shape) for shape in statistics.shape_names)
        statistics = replace(statistics, shape_names=theirs)
    return replace(
        character,
        name=character.name if name is None else name,
        title=character.title if title is None else title,
        credits=character.credits if credits is None else credits,
        shape_names=names,
        statistics=statistics,
    )
