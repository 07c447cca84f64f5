"""TensorFlow Lite models as lists of operations and weights, read by the field numbers of its schema (version 3)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.landmark_building.flatbuffer import Table

#: Operations that occur in the networks, by their numbers in the schema.
_OPERATIONS = {
    0: "add",
    2: "concatenate",
    3: "conv",
    4: "depthwise",
    6: "dequantize",
    17: "max_pool",
    19: "relu",
    22: "reshape",
    34: "pad",
    54: "prelu",
}
_TYPES = {0: np.float32, 1: np.float16, 2: np.int32}
_ACTIVATIONS = {0: "none", 1: "relu", 3: "relu6"}


@dataclass(frozen=True)
class Operation:
    """One operation of a network.

    Attributes:
        kind: A value of ``_OPERATIONS``.
        inputs: Numbers of its tensors; constants are inputs, too.
        output: Number of its result.
        options: Strides, padding and activation.
    """

    kind: str
    inputs: tuple[int, ...]
    output: int
    options: dict[str, Any]


@dataclass(frozen=True)
class Model:
    """A network.

    Attributes:
        operations: In the order of their execution.
        constants: Weights by the number of their tensor.
        shapes: Shape of each tensor.
        inputs: Numbers of the network's inputs.
        outputs: Numbers of its outputs.
    """

    operations: tuple[Operation, ...]
    constants: dict[int, NDArray[Any]]
    shapes: tuple[tuple[int, ...], ...]
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]


def read_model(data: bytes) -> Model:
    """Read a model file.

    Raises:
        ValueError: If it has operations or types that Face Poser does not know.
    """
    root = Table.root(data)
    (graph,) = root.tables(2)
    buffers = root.tables(4)
    codes = [max(code.number(0, "b"), code.number(3)) for code in root.tables(1)]
    shapes, constants = [], {}
    for number, tensor in enumerate(graph.tables(0)):
        shapes.append(tuple(tensor.numbers(0)))
        raw = buffers[tensor.number(2, "I")].bytes_of(0)
        if raw.size:
            constants[number] = raw.view(_TYPES[tensor.number(1, "b")]).reshape(shapes[-1])
    operations = []
    for table in graph.tables(3):
        code = codes[table.number(0, "I")]
        if code not in _OPERATIONS:
            raise ValueError(f"unknown operation {code}")
        kind, inputs, (output,) = _OPERATIONS[code], table.numbers(1), table.numbers(2)
        if kind == "dequantize":  # weights stored in half precision
            constants[output] = constants[inputs[0]]
            continue
        operations.append(Operation(kind, tuple(inputs), output, _options(kind, table.table(4))))
    return Model(tuple(operations), constants, tuple(shapes), tuple(graph.numbers(1)), tuple(graph.numbers(2)))


def _options(kind: str, table: Table | None) -> dict[str, Any]:
    if kind == "add":
        _require(table is None or table.number(0, "b") == 0, "an activation after a sum")
        return {}
    if kind == "concatenate":
        assert table is not None
        return {"axis": table.number(0)}
    if kind not in ("conv", "depthwise", "max_pool"):
        return {}
    assert table is not None
    stride = (table.number(2), table.number(1))
    found: dict[str, Any] = {"same": table.number(0, "b") == 0, "stride": list(stride)}
    if kind == "max_pool":
        found["size"] = [table.number(4), table.number(3)]
        activation = table.number(5, "b")
    else:
        shift = int(kind == "depthwise")
        _require(not shift or table.number(3) == 1, "a depth multiplier")
        activation = table.number(3 + shift, "b")
        dilation = table.number(4 + shift, default=1), table.number(5 + shift, default=1)
        _require(dilation == (1, 1), "dilation")
    found["activation"] = _ACTIVATIONS[activation]
    return found


def _require(fulfilled: bool, what: str) -> None:
    if not fulfilled:
        raise ValueError(f"the network has {what}, which is not supported")
