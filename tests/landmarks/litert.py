"""Outputs of MediaPipe's networks in LiteRT, with which those of the program are compared.

Written to ``litert_outputs.npz`` from the wheel that ``scripts/build_landmarks.py`` downloads, with ai-edge-litert::

    python -m tests.landmarks.litert WHEEL
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scripts.build_landmarks import FILES, read_wheel

Floats = NDArray[np.float32]
OUTPUTS = Path(__file__).with_name("litert_outputs.npz")
# Of the detector's 896 rows, so many apart are kept.
_ROWS = 16


def image_for(name: str, side: int) -> Floats:
    """Return the input of the network ``name``, shape (side, side, 3): noise, the same everywhere."""
    image = np.random.default_rng(0).random((side, side, 3)).astype(np.float32)
    return 2.0 * image - 1.0 if name == "detection" else image


def kept(output: Floats) -> Floats:
    """Return the part of ``output`` that the file has."""
    return output[::_ROWS] if output.shape[0] > 500 else output


def litert_outputs(content: bytes, name: str) -> list[Floats]:
    """Return the outputs in LiteRT of the network ``name``, whose file has this ``content``."""
    from ai_edge_litert.interpreter import Interpreter

    interpreter = Interpreter(model_content=content, num_threads=1)
    interpreter.allocate_tensors()
    entry = interpreter.get_input_details()[0]
    interpreter.set_tensor(entry["index"], image_for(name, entry["shape"][1])[None])
    interpreter.invoke()
    return [interpreter.get_tensor(details["index"])[0] for details in interpreter.get_output_details()]


if __name__ == "__main__":
    files = read_wheel(Path(sys.argv[1]))
    arrays = {
        f"{name}.{i}": kept(output) for name in FILES for i, output in enumerate(litert_outputs(files[name], name))
    }
    np.savez_compressed(OUTPUTS, **arrays)
