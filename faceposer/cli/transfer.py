"""``faceposer transfer``: transfers a pose or an animation to another character (docs/transfer.md)."""

import argparse
import re
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faceposer.cli.arguments import add_contact_option, add_materials_option, add_rate_option, output_path
from faceposer.cli.progress_line import ProgressLine
from faceposer.errors import FacePoserError, counted, printable
from faceposer.files.atomic import check_not_input
from faceposer.files.paths import folder_of

if TYPE_CHECKING:
    from faceposer.model.face_model import FaceModel
    from faceposer.model.performance import Performance
    from faceposer.session.document import Document
    from faceposer.transfer.source_heads import HeadTransfer
    from faceposer.transfer.transfer import Transfer

NAME = "transfer"

# Number of characters at the start of a file that contain its format name.
_HEAD = 4096
# Share of the motion, in squares, and weight of a key, from which a source is outside the keys.
_MUCH_MISSED, _STRONG = 0.05, 3.0
# Frame rate of a single pose, which has none of its own.
_DEFAULT_RATE = 60.0


def add_parser(commands: Any) -> None:
    """Add the parser of ``transfer`` to ``commands``."""
    parser = commands.add_parser(
        NAME,
        help="transfer an expression or an animation to another character",
        description="Transfer a pose or an animation from one character to another; their meshes may differ "
        "(docs/transfer.md).",
    )
    parser.add_argument(
        "source",
        type=Path,
        metavar="SOURCE",
        help="session, pose, capture (.csv, .txt), weights (.json, .glb) or posed mesh (.obj, .ply)",
    )
    parser.add_argument(
        "target",
        metavar="CHARACTER",
        help="target character: a name or a character file (.npz); with examples, also its neutral mesh (.obj, .ply)",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=output_path,
        metavar="OUT",
        required=True,
        help="session, or weights for the animation of a capture (.json); or .csv, .glb, .gif, .mp4, .obj, .ply, .png",
    )
    add_contact_option(parser)
    add_materials_option(parser)
    parser.add_argument(
        "--from",
        dest="character",
        metavar="CHARACTER",
        help="character of a source that is not a session (default: that of a pose, or man)",
    )
    parser.add_argument(
        "--method",
        choices=("distances", "weights", "examples"),
        default="distances",
        help="match distances between feature points, copy the weights of ARKit shapes that both characters have, or "
        "follow pairs of key poses (default: distances)",
    )
    parser.add_argument("--keys", type=Path, metavar="DIR", help="folder of key poses, for --method examples")
    parser.add_argument(
        "--regions",
        choices=("whole", "halves", "parts"),
        help="clone the face as a whole, its upper and lower half, or brows, eyes and lower face separately "
        "(default: as the folder of keys says)",
    )
    parser.add_argument(
        "--pairs", metavar="full|paper|FILE", help="distances to match: a built-in list, or a JSON file"
    )
    parser.add_argument(
        "--scaling",
        choices=("neutral", "paper"),
        default="neutral",
        help="map the neutral face to the neutral face, or only minimum and maximum to each other as in the paper "
        "(default: neutral)",
    )
    parser.add_argument(
        "--frames", type=_frames, metavar="I|I:J", help="one frame, or frames I to J - 1, counted from 0"
    )
    add_rate_option(parser, "a capture or weights")


def _frames(text: str) -> slice:
    match = re.fullmatch(r"([0-9]{1,9})(?:(:)([0-9]{0,9}))?", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not a frame such as 120 or a range such as 100:200")
    first = int(match[1])
    last = first + 1 if match[2] is None else int(match[3]) if match[3] else None
    if last is not None and last <= first:
        raise argparse.ArgumentTypeError(f"the range '{text}' is empty")
    return slice(first, last)


def run(options: argparse.Namespace) -> int:
    """Transfer the source, write the output and return the exit status."""
    from faceposer.interchange.formats import check_writable, offered

    form = check_writable(options.output)
    check_not_input(options.output, options.source, options.target, options.pairs)
    suffix = options.output.suffix.lower()
    holds_animation = form.animated
    _check_method(options)
    from faceposer.session.opening import load_model
    from faceposer.transfer.pairs import DEFAULT_PAIRS, PRESETS, read_pairs
    from faceposer.transfer.transfer import Transfer, make_transfer, transfer_performance

    pairs = DEFAULT_PAIRS
    if options.pairs is not None:
        pairs = PRESETS[options.pairs] if options.pairs in PRESETS else read_pairs(Path(options.pairs))
    source = _source(options)
    transfer: Transfer
    if options.method == "examples":
        transfer, target = _by_examples(options, source.model)
    else:
        target = load_model(options.target)
        transfer = make_transfer(source.model, target, options.method, pairs, options.scaling)
    if suffix == ".json" and source.document is not None:
        if options.method == "examples":
            _tell_reach(options.keys, transfer, source.still)
        _write_session(options, source, transfer, target)
        return 0
    # For a session, a single pose is the one that it shows, not the first of its animation.
    performance = source.still if not holds_animation and source.document is not None else source.performance
    moving = len(performance) > 1
    if options.method == "examples":
        _tell_reach(options.keys, transfer, performance)
    if moving and not holds_animation:
        raise FacePoserError(
            f"The source has {counted(len(performance), 'frame')}, but a '{suffix}' file holds one; choose a "
            f"frame with --frames, "
            f"or an output that ends in one of {', '.join(offered(lambda form: form.animated))}."
        )
    began = time.perf_counter()
    line = ProgressLine()
    try:
        result = transfer_performance(transfer, performance, line.progress if moving else None)
        spent = 1e3 * (time.perf_counter() - began) / len(result)
        _write(options.output, options.target, target, result, line, options)
    finally:
        line.clear()
    content = counted(len(result), "frame") if len(result) > 1 else "pose"
    print(f"{options.output} written: {content} by {options.method}, {spent:.1f} ms per frame")
    return 0


def _check_method(options: argparse.Namespace) -> None:
    if options.pairs is not None and options.method != "distances":
        raise FacePoserError(
            f"--pairs applies to the method 'distances' only; leave out --pairs or --method {options.method}."
        )
    if options.method == "examples":
        if options.keys is None:
            raise FacePoserError("--method examples needs --keys DIR, a folder of key poses (keys init).")
        check_not_input(options.output, options.keys / "keys.json")
    elif options.keys is not None or options.regions is not None:
        raise FacePoserError("--keys and --regions apply to the method 'examples' only; add --method examples.")


def _by_examples(options: argparse.Namespace, source: "FaceModel") -> "tuple[HeadTransfer, FaceModel]":
    """Return the transfer by the keys of the folder, and the model of its results."""
    from faceposer.cli.opening import print_notes
    from faceposer.session.key_folder import KeyFolder
    from faceposer.session.keys import check_characters, load_keys
    from faceposer.transfer.source_heads import HeadTransfer

    keys = KeyFolder.read(options.keys)
    check_characters(keys, source, options.target)
    suffix = options.output.suffix.lower()
    if suffix == ".json" and keys.is_mesh:
        raise FacePoserError(
            f"The target of '{options.keys}' is a mesh without shapes, which has no session or weights; choose an "
            "output that ends in .obj, .ply, .glb, .png, .gif or .mp4."
        )
    # Sessions and weights are of the character's own shapes.
    loaded = load_keys(keys, "weights" if suffix in (".json", ".csv") else "auto", options.regions)
    print_notes(options.keys, loaded.remarks)
    return HeadTransfer(loaded.transfer, source), loaded.transfer.target


def _tell_reach(keys: Path, transfer: "Transfer", performance: "Performance") -> None:
    """Print a note if frames are far outside the keys."""
    from faceposer.cli.opening import print_notes
    from faceposer.transfer.key_coverage import coverage
    from faceposer.transfer.source_heads import HeadTransfer

    assert isinstance(transfer, HeadTransfer)
    reach = coverage(transfer.keys, transfer.converted(performance.coefficients))
    if reach.missed > _MUCH_MISSED or reach.strengths.max() > _STRONG:
        worst = int(reach.distances.argmax())
        where = f" in frame {worst}" if len(performance) > 1 else ""
        most = reach.strengths.max()
        strong = f", and are exaggerated up to {most:.1f} times" if most > 1.0 else ""
        print_notes(
            keys,
            f"The source is outside the keys: they miss {100 * reach.missed:.0f} % of its motion, up to "
            f"{10 * reach.distances[worst]:.1f} mm{where}{strong}; 'keys check --on' names frames that would help as "
            "keys.",
        )


@dataclass(frozen=True, eq=False)
class _Source:
    """Source of a transfer.

    Attributes:
        model: The face.
        performance: Its motion; one frame if it has no animation.
        still: The pose that it shows, as one frame.
        document: The session that it comes from, if any.
    """

    model: "FaceModel"
    performance: "Performance"
    still: "Performance"
    document: "Document | None" = None


def _source(options: argparse.Namespace) -> _Source:
    from faceposer.cli.opening import open_with_remark, print_notes
    from faceposer.geometry.mesh_io import POSED_MESH_SUFFIXES
    from faceposer.interchange.reading import read_performance, read_pose
    from faceposer.model.performance import Performance
    from faceposer.session.file_kinds import kind_of
    from faceposer.session.opening import load_model
    from faceposer.training.recordings import WEIGHTS

    path: Path = options.source
    suffix = path.suffix.lower()
    if suffix not in POSED_MESH_SUFFIXES + WEIGHTS:
        raise FacePoserError(
            f"'{path}' is not a supported source; give a session or a pose (.json), weights ({', '.join(WEIGHTS)}) or "
            f"a posed mesh ({', '.join(POSED_MESH_SUFFIXES)})."
        )
    if suffix == ".json" and kind_of(path) == "pose":
        return _pose_source(options)
    if suffix == ".json" and not _holds_weights(path):
        if options.character is not None or options.frames is not None or options.rate is not None:
            raise FacePoserError(
                f"'{path}' is a session, which has its own character and frame rate; leave out --from, --frames and "
                "--rate."
            )
        session = open_with_remark(str(path))
        session.wait()
        still = Performance(session.coefficients[None], _DEFAULT_RATE)
        return _Source(session.model, session.animation.performance or still, still, session.document)
    model = load_model(options.character or "man")
    if suffix in POSED_MESH_SUFFIXES:
        pose = read_pose(path, model)
        print(printable(f"{path}: {pose.note}"))
        still = Performance(pose.coefficients[None], _DEFAULT_RATE)
        return _Source(model, still, still)
    read = read_performance(path, model, options.rate)
    print_notes(path, read.note)
    poses = read.performance.coefficients
    chosen = poses[options.frames] if options.frames is not None else poses
    if not len(chosen):
        raise FacePoserError(f"'{path}' has {counted(len(poses), 'frame')}, none of them in the range of --frames.")
    performance = Performance(chosen, read.performance.rate)
    return _Source(model, performance, performance)


def _pose_source(options: argparse.Namespace) -> _Source:
    """Return the source that is a pose of the library, on the character that it was made on or that is given."""
    from faceposer.model.performance import Performance
    from faceposer.poses.applying import applied
    from faceposer.poses.pose_file import read_pose
    from faceposer.session.opening import load_model

    path: Path = options.source
    if options.frames is not None or options.rate is not None:
        raise FacePoserError(f"'{path}' is a single pose; leave out --frames and --rate.")
    pose = read_pose(path)
    try:
        model = load_model(options.character or pose.character or "man")
    except FacePoserError as error:
        if options.character is not None:
            raise
        raise FacePoserError(
            f"The pose '{path}' was made on the character '{pose.character}', which is not known here; give its file "
            "with --from."
        ) from error
    still = Performance(applied(model, model.neutral(), pose)[None], _DEFAULT_RATE)
    return _Source(model, still, still)


def _holds_weights(path: Path) -> bool:
    """Return True if ``path`` has weights, of the program or another tool; all else is left to the session reader."""
    from faceposer.files.reading import open_text
    from faceposer.training.weights_file import FORMAT

    try:
        with open_text(path, "utf-8-sig") as file:
            head = file.read(_HEAD)
    except (OSError, ValueError):
        return False
    return f'"{FORMAT}"' in head or '"faceposer.' not in head


def _write_session(options: argparse.Namespace, source: _Source, transfer: "Transfer", target: "FaceModel") -> None:
    """Write the session of the target with everything that can be transferred."""
    from faceposer.session.document import portable_character, write_document
    from faceposer.session.transferred import transferred

    assert source.document is not None
    pose = source.still.coefficients[0]
    character = portable_character(options.target, folder_of(options.output))
    document = transferred(source.document, pose, transfer, character, target)
    document = replace(document, contact=document.contact and options.contact)
    write_document(options.output, document.with_version_data(target))
    keys = 0 if document.keyframes is None else len(document.keyframes.keys)
    content = counted(keys, "key frame") if keys else "pose"
    print(f"{options.output} written: {content} by {options.method}")


def _write(
    path: Path,
    character: str,
    model: "FaceModel",
    performance: "Performance",
    line: ProgressLine,
    options: argparse.Namespace,
) -> None:
    """Write a single pose as a session or in any other format, several as an animation."""
    from faceposer.interchange.formats import write
    from faceposer.render.options import OutputOptions
    from faceposer.session.document import Document, portable_character, write_document

    pose = performance.coefficients[0]
    output_options = OutputOptions(contact=options.contact, materials=options.materials)
    if len(performance) > 1:
        write(path, model, performance, output_options, line.progress)
    elif path.suffix.lower() == ".json":
        document = Document(portable_character(character, folder_of(path)), contact=options.contact)
        write_document(path, document.with_start(pose).posed(pose).with_version_data(model))
    else:
        write(path, model, pose, output_options)
