"""``transfer``: carry a pose or an animation from one face to another (docs/transfer.md)."""

import argparse
import json
import os
import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faceposer.errors import FacePoserError

if TYPE_CHECKING:
    from faceposer.model.face_model import FaceModel
    from faceposer.model.performance import Performance

NAME = "transfer"

_MAX_BYTES = 256 * 2**20
_USUAL_RATE = 60.0


def add_parser(commands: Any) -> None:
    """Add the parser of ``transfer`` to ``commands``."""
    parser = commands.add_parser(
        NAME,
        help="carry an expression or an animation to another face",
        description="Carry a pose or an animation from one face to another, whatever their meshes look like "
        "(docs/transfer.md).",
    )
    parser.add_argument(
        "source", type=Path, metavar="SOURCE", help="session (.json), capture (.csv, .txt) or animation (.json)"
    )
    parser.add_argument("target", metavar="SUBJECT", help="the face that gets the expression: a name or an .npz file")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="OUT", required=True, help="session or animation (.json), or mesh (.obj)"
    )
    parser.add_argument(
        "--from", dest="subject", metavar="SUBJECT", help="whose weights a capture or an animation has (default: man)"
    )
    parser.add_argument("--method", choices=("distances", "weights"), default="distances", help="(default: distances)")
    parser.add_argument(
        "--pairs", metavar="full|paper|FILE", help="distances to keep: a list of the program, or a JSON file"
    )
    parser.add_argument(
        "--scaling",
        choices=("neutral", "paper"),
        default="neutral",
        help="take neutral to neutral, or only minimum and maximum to each other, as the paper does (default: neutral)",
    )
    parser.add_argument(
        "--frames", type=_frames, metavar="I|I:J", help="one frame, or those from I to before J, counted from 0"
    )
    parser.add_argument(
        "--rate", type=_rate, metavar="HZ", help="frames per second of a capture (default: by its times)"
    )


def _frames(text: str) -> slice:
    match = re.fullmatch(r"(\d{1,9})(?:(:)(\d{0,9}))?", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"'{text}' is neither a frame such as 120 nor a range such as 100:200")
    first = int(match[1])
    last = first + 1 if match[2] is None else int(match[3]) if match[3] else None
    if last is not None and last <= first:
        raise argparse.ArgumentTypeError(f"'{text}' holds no frame")
    return slice(first, last)


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not 0.0 < rate <= 1000.0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of frames per second up to 1000")
    return rate


def run(options: argparse.Namespace) -> int:
    """Carry over what ``options`` ask for and return the exit status."""
    _check_output(options.output)
    suffix = options.output.suffix.lower()
    if options.pairs is not None and options.method == "weights":
        raise FacePoserError("Pairs are for the method 'distances'; leave out --pairs or --method weights.")
    from faceposer.session.opening import load_model
    from faceposer.transfer.pairs import DEFAULT_PAIRS, PRESETS, read_pairs
    from faceposer.transfer.transfer import make_transfer, transfer_performance

    pairs = DEFAULT_PAIRS
    if options.pairs is not None:
        pairs = PRESETS[options.pairs] if options.pairs in PRESETS else read_pairs(Path(options.pairs))
    source, performance = _source(options)
    moving = len(performance) > 1
    if moving and suffix == ".obj":
        raise FacePoserError(
            f"The source has {len(performance)} frames, and a mesh is one; choose one by --frames, or an output that "
            "ends in '.json'."
        )
    target = load_model(options.target)
    transfer = make_transfer(source, target, options.method, pairs, options.scaling)
    began = time.perf_counter()
    result = transfer_performance(transfer, performance, _progress if moving and sys.stderr.isatty() else None)
    spent = 1e3 * (time.perf_counter() - began) / len(result)
    _write(options.output, options.target, target, result)
    what = f"{len(result)} frames" if moving else "pose"
    print(f"{options.output} written: {what} by {options.method}, {spent:.1f} ms a frame")
    return 0


def _check_output(path: Path) -> None:
    """Refuse an output that could not be written before any work is done for it.

    Raises:
        FacePoserError: If the file could not be written.
    """
    if path.suffix.lower() not in (".json", ".obj"):
        raise FacePoserError(f"The output '{path}' must end in '.json' or '.obj'.")
    if path.is_dir():
        raise FacePoserError(f"The output '{path}' is a folder; give the name of a file.")
    if not path.parent.is_dir():
        raise FacePoserError(f"The folder '{path.parent}' of the output does not exist; make it first.")
    if not os.access(path.parent, os.W_OK):
        raise FacePoserError(f"The folder '{path.parent}' of the output cannot be written to; choose another.")


def _progress(share: float) -> None:
    sys.stderr.write(f"\r{100.0 * share:3.0f} %" if share < 1.0 else "\r     \r")
    sys.stderr.flush()


def _source(options: argparse.Namespace) -> "tuple[FaceModel, Performance]":
    """Return the face that the expression comes from, and its frames; a session is one."""
    from faceposer.model.performance import Performance
    from faceposer.session.opening import load_model, open_session

    path: Path = options.source
    suffix = path.suffix.lower()
    if suffix not in (".json", ".csv", ".txt"):
        raise FacePoserError(f"'{path}' is neither a session or an animation (.json) nor a capture (.csv, .txt).")
    data = _animation_data(path) if suffix == ".json" else None
    if suffix == ".json" and data is None:
        if options.subject is not None or options.frames is not None or options.rate is not None:
            raise FacePoserError(
                f"'{path}' is a session, which is one pose and names its subject; leave out --from, --frames and "
                "--rate."
            )
        session = open_session(str(path))
        session.wait()
        return session.model, Performance(session.coefficients[None], _USUAL_RATE)
    model = load_model(options.subject or "man")
    if data is not None:
        names, weights, rate = read_animation(data, path)
    else:
        names, weights, rate = _capture(path)
    chosen = weights[options.frames] if options.frames is not None else weights
    if not len(chosen):
        raise FacePoserError(f"'{path}' has {len(weights)} frames, none of those that --frames asks for.")
    return model, Performance.from_weights(model, _ordered(model, names, chosen, path), options.rate or rate)


def _capture(path: Path) -> tuple[tuple[str, ...], Any, float]:
    from faceposer.evaluation.takes import frames_a_second
    from faceposer.training.capture import read_capture

    capture = read_capture(path)
    return capture.shape_names, capture.weights, frames_a_second(path) or _USUAL_RATE


def _ordered(model: "FaceModel", names: Sequence[str], weights: Any, path: Path) -> Any:
    """Return ``weights``, (F, n), of the shapes ``names`` in the order of the model's shapes, (F, S)."""
    import numpy as np

    from faceposer.model.shape_names import match_arkit

    subject = model.subject
    columns = {name: i for i, name in enumerate(names)}
    arkit = match_arkit(subject.shape_names, f"The subject '{subject.name}'").shapes
    ordered = np.zeros((len(weights), len(subject.shape_names)))
    found = 0
    for row, name in enumerate(subject.shape_names):
        column = columns.get(name, columns.get(arkit.get(name, "")))
        if column is not None:
            ordered[:, row] = weights[:, column]
            found += 1
    if not found:
        raise FacePoserError(
            f"The subject '{subject.name}' has none of the shapes that '{path}' gives weights of; say by --from whose "
            "they are."
        )
    return ordered


def _animation_data(path: Path) -> dict[str, Any] | None:
    """Return the content of an animation file, or None where ``path`` is something else, which its reader judges."""
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise FacePoserError(f"The animation '{path}' is larger than {_MAX_BYTES // 2**20} MB; cut it.")
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return data if isinstance(data, dict) and "weights" in data and "format" not in data else None


def read_animation(data: dict[str, Any], path: Path) -> tuple[tuple[str, ...], Any, float]:
    """Return names of shapes, weights of shape (F, S) and the rate that the animation ``data`` of ``path`` holds.

    Raises:
        FacePoserError: If something is missing or of the wrong kind.
    """
    import numpy as np

    names, rate = data.get("names"), data.get("rate", _USUAL_RATE)
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise FacePoserError(f"The animation '{path}': names must be a list of names of shapes.")
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 < rate <= 1000.0:
        raise FacePoserError(f"The animation '{path}': rate must be a number of frames per second up to 1000.")
    try:
        weights = np.array(data["weights"], dtype=np.float64)
    except (TypeError, ValueError):
        weights = np.zeros(0)
    if weights.ndim != 2 or not len(weights) or weights.shape[1] != len(names) or not np.isfinite(weights).all():
        raise FacePoserError(
            f"The animation '{path}': weights must be a list of frames, each of {len(names)} numbers, one per name."
        )
    return tuple(names), weights, float(rate)


def _write(path: Path, subject: str, model: "FaceModel", performance: "Performance") -> None:
    """Write one pose as a session or a mesh, more as an animation."""
    from faceposer.session.document import Document, subject_from, write_document, write_text
    from faceposer.session.export import write_posed_obj

    pose = performance.coefficients[0]
    if path.suffix.lower() == ".obj":
        write_posed_obj(path, model, pose)
    elif len(performance) == 1:
        write_document(path, Document(subject_from(subject, path.parent)).starting_from(pose).posed(pose))
    else:
        data = {
            "names": list(model.subject.shape_names),
            "rate": performance.rate,
            "weights": performance.weights(model).round(6).tolist(),
        }
        write_text(path, json.dumps(data) + "\n", "animation")
