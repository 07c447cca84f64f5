"""The three networks of ``assets/landmarks.npz``, and their forward pass.

The file has a member ``meta``, JSON in UTF-8, with the operations of each network, and their weights in half precision
as members ``NETWORK.NUMBER``. ``scripts/build_landmarks.py`` makes it from MediaPipe's networks (Apache-2.0).
"""

import json
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.arrays import DamagedError, TooLargeError, read_arrays
from faceposer.landmarks import layers
from faceposer.resources import asset_path

Floats = NDArray[np.float32]

FORMAT = "faceposer.landmarks"
_MAX_BYTES, _MAX_MEMBERS, _MAX_OPERATIONS = 8 << 20, 1000, 500


@dataclass(frozen=True)
class Operation:
    """One operation.

    Attributes:
        kind: "conv", "depthwise", "max_pool", "prelu", "relu", "add", "pad", "reshape" or "concatenate".
        inputs: Numbers of the tensors that it reads; those of weights are listed in the network's constants.
        output: Number of the tensor that it writes.
        stride: Step of its windows in pixels.
        same: True for padding that keeps the size of the image.
        size: Rows and columns of a pool's windows; channels that are added; the shape to which to reshape; the axis to
            concatenate.
    """

    kind: str
    inputs: tuple[int, ...]
    output: int
    stride: int = 1
    same: bool = False
    size: tuple[int, ...] = ()


@dataclass(frozen=True)
class Network:
    """A network for single images.

    Attributes:
        operations: In the order of their execution.
        constants: Weights by the number of their tensor, in single precision.
        side: Width and height of its input in pixels.
        input: Number of the tensor of the input.
        outputs: Numbers of the tensors of the outputs.
    """

    operations: tuple[Operation, ...]
    constants: dict[int, Floats]
    side: int
    input: int
    outputs: tuple[int, ...]

    def __call__(self, image: Floats) -> tuple[Floats, ...]:
        """Return the outputs for ``image``, shape (side, side, 3)."""
        if image.shape != (self.side, self.side, 3):
            raise ValueError(f"the image must be of shape {(self.side, self.side, 3)}, not {image.shape}")
        tensors = {self.input: np.ascontiguousarray(image, dtype=np.float32)}
        for number, operation in enumerate(self.operations):
            tensors[operation.output] = self._result(operation, tensors)
            for used in operation.inputs:
                if self._last_uses.get(used) == number:
                    tensors.pop(used, None)
        return tuple(tensors[number] for number in self.outputs)

    @cached_property
    def _last_uses(self) -> dict[int, int]:
        """Number of the last operation that reads each tensor, except the outputs."""
        uses = {used: number for number, operation in enumerate(self.operations) for used in operation.inputs}
        return {used: number for used, number in uses.items() if used not in self.outputs}

    def _result(self, operation: Operation, tensors: dict[int, Floats]) -> Floats:
        x = tensors[operation.inputs[0]]
        weights = [self.constants[i] for i in operation.inputs[1:] if i in self.constants]
        match operation.kind:
            case "conv":
                return layers.convolution(x, weights[0], weights[1], operation.stride, operation.same)
            case "depthwise":
                return layers.depthwise(x, weights[0], weights[1], operation.stride, operation.same)
            case "max_pool":
                return layers.max_pool(x, (operation.size[0], operation.size[1]), operation.stride, operation.same)
            case "prelu":
                return layers.prelu(x, weights[0])
            case "relu":
                return np.maximum(x, np.float32(0.0))
            case "add":
                return x + tensors[operation.inputs[1]]
            case "pad":
                return layers.more_channels(x, operation.size[0])
            case "reshape":
                return x.reshape(operation.size)
            case "concatenate":
                return np.concatenate([tensors[i] for i in operation.inputs], axis=operation.size[0])
        raise ValueError(f"unknown operation {operation.kind}")


def load_networks(path: Path) -> dict[str, Network]:
    """Read the networks in ``path``, by name.

    Raises:
        FacePoserError: If the file is missing, damaged or of another format.
    """
    try:
        members = read_arrays(path, _MAX_BYTES, _MAX_MEMBERS)
        meta = json.loads(bytes(members["meta"]).decode("utf-8"))
        if meta["format"] != FORMAT:
            raise ValueError("another format")
        return {name: _network(name, facts, members) for name, facts in meta["networks"].items()}
    except OSError as error:
        raise FacePoserError(
            f"The landmark networks '{path}' cannot be read ({error.strerror or 'damaged'}); install Face Poser again."
        ) from error
    except (AttributeError, DamagedError, LookupError, RecursionError, TooLargeError, TypeError, ValueError) as error:
        raise FacePoserError(f"The landmark networks '{path}' are damaged; install Face Poser again.") from error


def _network(name: str, facts: dict[str, Any], members: Any) -> Network:
    if len(facts["operations"]) > _MAX_OPERATIONS:
        raise ValueError("too many operations")
    operations = tuple(
        Operation(str(kind), tuple(map(int, inputs)), int(output), int(stride), bool(same), tuple(map(int, size)))
        for kind, inputs, output, stride, same, size in facts["operations"]
    )
    constants = {int(number): members[f"{name}.{number}"].astype(np.float32) for number in facts["constants"]}
    return Network(operations, constants, int(facts["side"]), int(facts["input"]), tuple(map(int, facts["outputs"])))


@lru_cache(maxsize=1)
def networks() -> dict[str, Network]:
    """Return the networks of the installation: "detection", "points" and "iris".

    Raises:
        FacePoserError: If their file is missing or damaged.
    """
    return load_networks(asset_path("landmarks.npz"))
