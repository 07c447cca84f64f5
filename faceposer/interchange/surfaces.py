"""Material parameters of a character's surfaces, for export where no texture defines them."""

from pathlib import Path

from faceposer.errors import FacePoserError, short_name
from faceposer.model.character import Character
from faceposer.model.materials import BASE_COLOURS

_ROUGHNESS = {"eye": 0.12, "teeth": 0.3, "gums": 0.35, "tongue": 0.45}
_SKIN_ROUGHNESS = 0.55
# Opacity of transparent shells.
_OPACITY = {"film": 0.05}
_PNG = b"\x89PNG\r\n\x1a\n"


def roughness(material: str) -> float:
    """Return the roughness of ``material``, 0 to 1, as physically based shading defines it."""
    return _ROUGHNESS.get(material, _SKIN_ROUGHNESS)


def base_colour(material: str) -> tuple[float, float, float]:
    """Return the linear colour of ``material``: red, green and blue from 0 to 1."""
    return BASE_COLOURS[material]


def opacity(material: str) -> float:
    """Return the opacity of ``material``, 0 to 1."""
    return _OPACITY.get(material, 1.0)


def check_textures(path: Path, kind: str, character: Character, remedy: str = "") -> None:
    """Check that all textures of ``character`` can be decoded, before they are written.

    Args:
        path: The file to write, for the message.
        kind: Noun for the file, such as "model".
        character: The character.
        remedy: Further remedy, such as "or leave out the textures".

    Raises:
        FacePoserError: If a texture is damaged.
    """
    for name, reason in character.damaged_textures.items():
        raise FacePoserError(
            f"The {kind} '{path}' cannot be written: the texture '{short_name(name)}' of the character is unusable, "
            f"since {reason}; create the character again{remedy}."
        )


def is_png(image: bytes) -> bool:
    """Return True if the encoded ``image`` is PNG; otherwise it is JPEG."""
    return image.startswith(_PNG)
