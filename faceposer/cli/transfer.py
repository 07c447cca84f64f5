"""``transfer``: carry a pose or an animation from one face to another (docs/transfer.md)."""

import argparse
import re
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faceposer.cli.arguments import add_contact_option, add_materials_option
from faceposer.cli.progress_line import ProgressLine
from faceposer.errors import FacePoserError, printable
from faceposer.files.atomic import check_apart

if TYPE_CHECKING:
    from faceposer.model.face_model import FaceModel
    from faceposer.model.performance import Performance
    from faceposer.session.document import Document
    from faceposer.transfer.transfer import Transfer

NAME = "transfer"

# Characters of a file within which it says what it is.
_HEAD = 4096
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
        "source",
        type=Path,
        metavar="SOURCE",
        help="session, capture (.csv, .txt), weights (.json, .glb) or posed mesh (.obj, .ply)",
    )
    parser.add_argument("target", metavar="CHARACTER", help="the face that gets the expression: a name or an .npz file")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="OUT",
        required=True,
        help="session or, of a capture, weights (.json); or .csv, .glb, .gif, .mp4, .obj, .ply, .png",
    )
    add_contact_option(parser)
    add_materials_option(parser)
    parser.add_argument(
        "--from",
        dest="character",
        metavar="CHARACTER",
        help="whose weights or mesh a source is that is no session (default: man)",
    )
    parser.add_argument(
        "--method",
        choices=("distances", "weights"),
        default="distances",
        help="by distances between points of the faces, or by the weights of ARKit's shapes that both have (default: "
        "distances)",
    )
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
    from faceposer.interchange.formats import check_writable, offered

    form = check_writable(options.output)
    check_apart(options.output, options.source, options.target, options.pairs)
    suffix = options.output.suffix.lower()
    holds_animation = form.animated
    if options.pairs is not None and options.method == "weights":
        raise FacePoserError("Pairs are for the method 'distances'; leave out --pairs or --method weights.")
    from faceposer.session.opening import load_model
    from faceposer.transfer.pairs import DEFAULT_PAIRS, PRESETS, read_pairs
    from faceposer.transfer.transfer import make_transfer, transfer_performance

    pairs = DEFAULT_PAIRS
    if options.pairs is not None:
        pairs = PRESETS[options.pairs] if options.pairs in PRESETS else read_pairs(Path(options.pairs))
    source = _source(options)
    target = load_model(options.target)
    transfer = make_transfer(source.model, target, options.method, pairs, options.scaling)
    if suffix == ".json" and source.document is not None:
        _write_session(options, source, transfer, target)
        return 0
    # A session's pose is the one that it shows.
    performance = source.still if not holds_animation and source.document is not None else source.performance
    moving = len(performance) > 1
    if moving and not holds_animation:
        raise FacePoserError(
            f"The source has {len(performance)} frames, and '{suffix}' holds one; choose one by --frames, or an output "
            f"that ends in one of {', '.join(offered(lambda form: form.animated))}."
        )
    began = time.perf_counter()
    line = ProgressLine()
    try:
        result = transfer_performance(transfer, performance, line.progress if moving else None)
        spent = 1e3 * (time.perf_counter() - began) / len(result)
        _write(options.output, options.target, target, result, line, options)
    finally:
        line.clear()
    what = f"{len(result)} frames" if len(result) > 1 else "pose"
    print(f"{options.output} written: {what} by {options.method}, {spent:.1f} ms a frame")
    return 0


@dataclass(frozen=True, eq=False)
class _Source:
    """What is carried over: a face's motion, the one pose that it shows, and the session that it is of, if any."""

    model: "FaceModel"
    performance: "Performance"
    still: "Performance"
    document: "Document | None" = None


def _source(options: argparse.Namespace) -> _Source:
    from faceposer.cli.opening import open_with_remark
    from faceposer.interchange.reading import MESHES, WEIGHTS, read_performance, read_pose
    from faceposer.model.performance import Performance
    from faceposer.session.opening import load_model

    path: Path = options.source
    suffix = path.suffix.lower()
    if suffix not in MESHES + WEIGHTS:
        raise FacePoserError(
            f"'{path}' is neither a session, nor weights ({', '.join(WEIGHTS)}), nor a posed mesh "
            f"({', '.join(MESHES)})."
        )
    if suffix == ".json" and not _holds_weights(path):
        if options.character is not None or options.frames is not None or options.rate is not None:
            raise FacePoserError(
                f"'{path}' is a session, which names its character and its rate; leave out --from, --frames and --rate."
            )
        session = open_with_remark(str(path))
        session.wait()
        still = Performance(session.coefficients[None], _USUAL_RATE)
        return _Source(session.model, session.animation.performance or still, still, session.document)
    model = load_model(options.character or "man")
    if suffix in MESHES:
        pose = read_pose(path, model)
        print(printable(f"{path}: {pose.note}"))
        still = Performance(pose.coefficients[None], _USUAL_RATE)
        return _Source(model, still, still)
    read = read_performance(path, model)
    if read.note:
        print(printable(f"{path}: {read.note}"))
    poses = read.performance.coefficients
    chosen = poses[options.frames] if options.frames is not None else poses
    if not len(chosen):
        raise FacePoserError(f"'{path}' has {len(poses)} frames, none of those that --frames asks for.")
    performance = Performance(chosen, options.rate or read.performance.rate)
    return _Source(model, performance, performance)


def _holds_weights(path: Path) -> bool:
    """Whether ``path`` is a file of weights, and not a session, whose reader judges all else."""
    from faceposer.files.reading import open_file
    from faceposer.interchange.weights_json import FORMAT

    try:
        with open_file(path) as file:
            return f'"{FORMAT}"'.encode() in file.read(_HEAD)
    except OSError:
        return False


def _write_session(options: argparse.Namespace, source: _Source, transfer: "Transfer", target: "FaceModel") -> None:
    """Write the session of another face, with all that can be carried over."""
    from faceposer.session.document import character_from, write_document
    from faceposer.session.transferred import transferred

    assert source.document is not None
    pose = source.still.coefficients[0]
    character = character_from(options.target, options.output.parent)
    document = transferred(source.document, pose, transfer, character, target)
    document = replace(document, contact=document.contact and options.contact)
    write_document(options.output, document.stamped(target))
    keys = 0 if document.keyframes is None else len(document.keyframes.keys)
    what = f"{keys} keys" if keys else "pose"
    print(f"{options.output} written: {what} by {options.method}")


def _write(
    path: Path,
    character: str,
    model: "FaceModel",
    performance: "Performance",
    line: ProgressLine,
    options: argparse.Namespace,
) -> None:
    """Write one pose as a session or as any other file holds it, more as an animation."""
    from faceposer.interchange.formats import write
    from faceposer.render.options import OutputOptions
    from faceposer.session.document import Document, character_from, write_document

    pose = performance.coefficients[0]
    output_options = OutputOptions(contact=options.contact, materials=options.materials)
    if len(performance) > 1:
        write(path, model, performance, output_options, line.progress)
    elif path.suffix.lower() == ".json":
        document = Document(character_from(character, path.parent), contact=options.contact)
        write_document(path, document.starting_from(pose).posed(pose).stamped(model))
    else:
        write(path, model, pose, output_options)
