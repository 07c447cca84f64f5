"""The identity of a head: its coefficients in the morphable model, and their place in files."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from msgspec import field as json_field
from numpy.typing import NDArray

from faceposer.files.json_documents import JsonError, JsonObject

Array = NDArray[np.float64]

#: Largest coefficient in standard deviations that a file may contain; nothing of the kind looks like a head.
MOST = 100.0
_Coefficient = Annotated[float, Meta(ge=-MOST, le=MOST)]
_Row = Annotated[list[_Coefficient], Meta(max_length=1000)]


@dataclass(frozen=True, eq=False)
class Identity:
    """Coefficients of a head in the morphable model (Blanz and Vetter 1999, eq. (1), with segments of section 3.1).

    Attributes:
        shape: Coefficients of the shape in standard deviations, one row per segment, shape (segments, modes). Equal
            rows mean one whole face.
        texture: Coefficients of the texture in standard deviations, shape (t,).
        offsets: Amounts by which attributes move the head outside the span of the modes, by name of the attribute.
    """

    shape: Array
    texture: Array = field(default_factory=lambda: np.zeros(0))
    offsets: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("shape", "texture"):
            values = np.array(getattr(self, name), dtype=np.float64)
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        object.__setattr__(self, "offsets", {name: float(v) for name, v in self.offsets.items() if v})
        if self.shape.ndim != 2 or self.texture.ndim != 1:
            raise ValueError("the shape has one row of coefficients per segment, the texture one row")

    def same(self, other: "Identity | None") -> bool:
        """Return True if ``other`` is the same head."""
        return self is other or (
            other is not None
            and np.array_equal(self.shape, other.shape)
            and np.array_equal(self.texture, other.texture)
            and self.offsets == other.offsets
        )

    def to_json(self) -> dict[str, Any]:
        """Return the identity as written in a file."""
        data: dict[str, Any] = {"shape": self.shape.tolist()}
        if self.texture.size:
            data["texture"] = self.texture.tolist()
        if self.offsets:
            data["offsets"] = dict(self.offsets)
        return data


class IdentityJson(JsonObject):
    """An identity in a file; coefficients are in standard deviations."""

    shape: Annotated[list[_Row], Meta(min_length=1, max_length=64)]
    texture: _Row = json_field(default_factory=list)
    offsets: dict[str, _Coefficient] = json_field(default_factory=dict)

    def __post_init__(self) -> None:
        if len({len(row) for row in self.shape}) > 1:
            raise JsonError("must have the same number of coefficients in each row", "shape")

    def identity(self) -> Identity:
        """Return the identity."""
        return Identity(np.array(self.shape), np.array(self.texture), self.offsets)
