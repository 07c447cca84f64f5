"""What the surfaces of a character look like to other programs where no picture says so."""

from faceposer.model.materials import BASE_COLOURS

_ROUGHNESS = {"eye": 0.12, "teeth": 0.3, "gums": 0.35, "tongue": 0.45}
_SKIN_ROUGHNESS = 0.55
# How much of what lies behind a clear shell is covered by it.
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


def is_png(picture: bytes) -> bool:
    """Whether the encoded image ``picture`` is PNG; otherwise it is JPEG."""
    return picture.startswith(_PNG)
