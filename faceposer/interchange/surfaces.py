"""Material parameters of a character's surfaces, for export where no texture defines them."""

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


def is_png(image: bytes) -> bool:
    """Return True if the encoded ``image`` is PNG; otherwise it is JPEG."""
    return image.startswith(_PNG)
