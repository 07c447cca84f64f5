"""Base colours of materials without a texture."""

#: Linear colour, red, green and blue from 0 to 1, by material.
BASE_COLOURS: dict[str, tuple[float, float, float]] = {
    "skin": (0.58, 0.34, 0.26),
    "eye": (0.75, 0.72, 0.70),
    "teeth": (0.80, 0.74, 0.62),
    "gums": (0.42, 0.13, 0.12),
    "tongue": (0.46, 0.16, 0.15),
    "lashes": (0.02, 0.015, 0.012),
    "film": (0.80, 0.80, 0.80),
}
