"""Writing of material libraries for Wavefront OBJ (MTL)."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

# Control characters, line ends and surrogates, which names cannot contain.
_UNWRITABLE = re.compile(r"[\x00-\x1f\x7f\x85\u2028\u2029\ud800-\udfff]")


@dataclass(frozen=True)
class MtlMaterial:
    """A Phong material in MTL.

    Attributes:
        name: Name, as in ``usemtl``.
        diffuse: Kd, sRGB colour from 0 to 1, multiplied with the texture.
        specular: Ks, grey level from 0 to 1.
        exponent: Ns, exponent of the highlight, 0 to 1000.
        picture: File name of the colour texture in the folder of the library; "" for none.
        transparent: True to use the alpha channel of the texture as opacity.
        opacity: d, 0 to 1.
    """

    name: str
    diffuse: tuple[float, float, float]
    specular: float
    exponent: float
    picture: str = ""
    transparent: bool = False
    opacity: float = 1.0


def writable_name(name: str) -> str:
    """Return ``name`` with underscores for all characters that OBJ and MTL cannot represent."""
    return _UNWRITABLE.sub("_", name)


def mtl_text(materials: Sequence[MtlMaterial], comment: str = "") -> str:
    """Return the content of a material library; ``comment`` is its first line."""
    lines = [f"# {comment}"] if comment else []
    for material in materials:
        red, green, blue = material.diffuse
        lines += [
            "",
            f"newmtl {writable_name(material.name)}",
            f"Kd {red:.4f} {green:.4f} {blue:.4f}",
            f"Ks {material.specular:.4f} {material.specular:.4f} {material.specular:.4f}",
            f"Ns {material.exponent:.2f}",
            f"d {material.opacity:g}",
            "illum 2",
        ]
        if material.picture:
            lines.append(f"map_Kd {material.picture}")
            lines += [f"map_d {material.picture}"] if material.transparent else []
    return "\n".join(lines) + "\n"
