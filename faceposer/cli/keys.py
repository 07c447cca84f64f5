"""``faceposer keys``: folders of key poses for cloning by examples (docs/transfer.md)."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faceposer.cli.arguments import output_path, whole_number
from faceposer.cli.progress_line import ProgressLine
from faceposer.errors import FacePoserError, counted, printable
from faceposer.files.atomic import check_folder_of, check_not_input, check_output, check_sequence_folder

if TYPE_CHECKING:
    from faceposer.poses.pose_file import Pose
    from faceposer.session.key_folder import KeyFolder
    from faceposer.transfer.examples import ExampleTransfer

NAME = "keys"


def add_parser(commands: Any) -> None:
    """Add the parser of ``keys`` to ``commands``."""
    keys = commands.add_parser(
        NAME,
        help="create and check pairs of key poses",
        description="Create and check folders of key poses: pairs of an expression of one character and what it looks "
        "like on another (docs/transfer.md).",
    )
    actions = keys.add_subparsers(dest="action", required=True)
    _add_init(actions)
    _add_add(actions)
    remove = actions.add_parser("remove", help="remove a pair", description="Remove a pair of key poses.")
    remove.add_argument("folder", type=Path, metavar="DIR", help="folder of key poses")
    remove.add_argument("name", metavar="NAME", help="name of the key")
    rename = actions.add_parser(
        "rename", help="rename a pair", description="Rename a pair of key poses, its files and the poses in them."
    )
    rename.add_argument("folder", type=Path, metavar="DIR", help="folder of key poses")
    rename.add_argument("name", metavar="NAME", help="name of the key")
    rename.add_argument("new", metavar="NEW", help="its new name")
    choose = actions.add_parser(
        "choose",
        help="add the frames of an animation that help most",
        description="Add the frames of an animation that help most as key poses; the target's poses are proposed.",
    )
    choose.add_argument("folder", type=Path, metavar="DIR", help="folder of key poses")
    choose.add_argument("take", type=Path, metavar="TAKE", help="weights of the source (.csv, .txt, .json, .glb)")
    choose.add_argument("--count", type=_count, metavar="N", default=5, help="number of keys to add (default: 5)")
    compose = actions.add_parser(
        "compose",
        help="combine emotional and verbal key poses",
        description="Add the combination of each emotional key (tag 'expression') with each verbal key (tag 'viseme'). "
        "Combinations made before are made again.",
    )
    compose.add_argument("folder", type=Path, metavar="DIR", help="folder of key poses")
    compose.add_argument(
        "--printed", action="store_true", help="switch between both kinds at the importance .5, as in the paper"
    )
    importance = actions.add_parser(
        "importance",
        help="write the importance of each vertex for speech",
        description="Write the importance of each vertex for speech, as an image or as arrays.",
    )
    importance.add_argument("folder", type=Path, metavar="DIR", help="folder of key poses")
    importance.add_argument("-o", "--output", type=output_path, metavar="OUT", required=True, help=".png or .npz")
    importance.add_argument(
        "--side", choices=("source", "target"), default="source", help="character (default: source)"
    )
    check = actions.add_parser(
        "check",
        help="check the key poses, and their coverage of an animation",
        description="Check that the keys can be used. With --on, report how far frames of an animation are from all "
        "keys, and which frames would help most as keys.",
    )
    check.add_argument("folder", type=Path, metavar="DIR", help="folder of key poses")
    check.add_argument("--on", type=Path, metavar="TAKE", help="weights of the source (.csv, .txt, .json, .glb)")
    check.add_argument("--count", type=_count, metavar="N", default=5, help="number of frames to name (default: 5)")
    check.add_argument("--json", type=output_path, metavar="OUT", help="file for the report")


def _add_init(actions: Any) -> None:
    init = actions.add_parser(
        "init",
        help="create a folder of key poses",
        description="Create a folder of key poses from the pose libraries of two characters; poses that the target "
        "lacks are proposed by a transfer, for you to edit.",
    )
    init.add_argument("source", metavar="SOURCE", help="character that plays: a name or a character file (.npz)")
    init.add_argument(
        "target", metavar="TARGET", help="character that follows; or its neutral mesh (.obj, .ply), without proposals"
    )
    init.add_argument("-o", "--output", type=output_path, metavar="DIR", required=True, help="new folder")
    init.add_argument("--poses", type=Path, metavar="FOLDER", help="poses of the source (default: the built-in ones)")
    init.add_argument(
        "--all", dest="every", action="store_true", help="take all built-in poses, disgust and contempt, too"
    )
    _add_proposal(init)


def _add_add(actions: Any) -> None:
    add = actions.add_parser("add", help="add or replace a pair", description="Add or replace a pair of key poses.")
    add.add_argument("folder", type=Path, metavar="DIR", help="folder of key poses")
    add.add_argument("name", metavar="NAME", help="name of the key")
    for side in ("source", "target"):
        remark = "" if side == "source" else " (default: a proposal)"
        add.add_argument(
            f"--{side}",
            type=Path,
            metavar="FILE",
            required=side == "source",
            help=f"pose, session, weights or mesh of the {side}{remark}",
        )
    add.add_argument("--frame", type=_frame, metavar="I", default=0, help="frame of the source's weights, from 0")
    add.add_argument("--replace", action="store_true", help="replace the key of this name")
    _add_proposal(add)


def _add_proposal(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--propose",
        choices=("auto", "distances", "weights"),
        default="auto",
        help="how poses of the target are proposed (default: by weights between rigs with the same shapes)",
    )


def _count(text: str) -> int:
    from faceposer.transfer.examples import MOST_KEYS

    count = whole_number(text, 1, MOST_KEYS)
    if count is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from 1 to {MOST_KEYS}")
    return count


def _frame(text: str) -> int:
    frame = whole_number(text, 0, 999_999_999)
    if frame is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not the number of a frame")
    return frame


def run(options: argparse.Namespace) -> int:
    """Run the chosen action and return the exit status."""
    actions = {
        "init": _init,
        "add": _add,
        "remove": _remove,
        "rename": _rename,
        "choose": _choose,
        "compose": _compose,
        "importance": _importance,
        "check": _check,
    }
    return actions[options.action](options)


def _init(options: argparse.Namespace) -> int:
    check_sequence_folder(options.output)
    from faceposer.session.key_proposals import PROPOSED, create_keys

    line = ProgressLine()
    try:
        keys = create_keys(
            options.output,
            options.source,
            options.target,
            options.poses,
            options.every,
            options.propose,
            progress=line.progress,
        )
    finally:
        line.clear()
    entries = keys.entries()
    tagged = [entry.name for entry in entries if entry.target is not None and PROPOSED in _pose(entry.target).tags]
    print(f"{options.output} written: {counted(len(entries), 'key')}, {len(tagged)} of them proposed")
    if keys.is_mesh:
        print(
            f"Sculpt the targets, and save them as '{keys.folder / 'target' / (entries[0].name + '.obj')}' and so on."
        )
    return 0


def _pose(path: Path) -> "Pose":
    from faceposer.poses.pose_file import read_pose

    return read_pose(path)


def _add(options: argparse.Namespace) -> int:
    from faceposer.session.key_edits import add_key
    from faceposer.session.key_entries import KeyTakenError
    from faceposer.session.key_folder import KeyFolder

    keys = KeyFolder.read(options.folder)
    try:
        name, note = add_key(
            keys, options.name, options.source, options.target, options.frame, options.replace, options.propose
        )
    except KeyTakenError as error:
        raise FacePoserError(f"{error.taken}; choose another name, or add --replace.") from error
    print(printable(f"{options.folder}: key '{name}' written{f'. {note}' if note else ''}"))
    return 0


def _remove(options: argparse.Namespace) -> int:
    from faceposer.session.key_folder import KeyFolder

    KeyFolder.read(options.folder).remove(options.name)
    print(printable(f"{options.folder}: key '{options.name}' removed"))
    return 0


def _rename(options: argparse.Namespace) -> int:
    from faceposer.session.key_edits import rename_key
    from faceposer.session.key_folder import KeyFolder

    name = rename_key(KeyFolder.read(options.folder), options.name, options.new)
    print(printable(f"{options.folder}: key '{options.name}' renamed to '{name}'"))
    return 0


def _choose(options: argparse.Namespace) -> int:
    from faceposer.session.key_edits import choose_keys
    from faceposer.session.key_folder import KeyFolder

    line = ProgressLine()
    try:
        chosen = choose_keys(KeyFolder.read(options.folder), options.take, options.count, line.progress)
    finally:
        line.clear()
    for name, helpful in chosen:
        print(
            printable(f"key '{name}' added: frame {helpful.frame}, {100 * helpful.missed:.2f} % of the motion missed")
        )
    if len(chosen) < options.count:
        print("The keys reach all frames; no further frame helps.")
    return 0


def _compose(options: argparse.Namespace) -> int:
    from faceposer.session.key_compositions import compose_keys
    from faceposer.session.key_folder import KeyFolder

    line = ProgressLine()
    try:
        report = compose_keys(KeyFolder.read(options.folder), "switch" if options.printed else "smooth", line.progress)
    finally:
        line.clear()
    print(
        f"{options.folder}: {counted(report.composed, 'key')} composed of {report.expressions} emotional and "
        f"{report.visemes} verbal ones; {report.keys} with the neutral face"
    )
    if report.kept:
        print(
            f"{counted(report.kept, 'combination')} kept as you changed them; remove one before you compose it again."
        )
    return 0


def _importance(options: argparse.Namespace) -> int:
    check_output(options.output, ".png", ".npz")
    from faceposer.session.key_compositions import write_importance
    from faceposer.session.key_folder import KeyFolder

    write_importance(KeyFolder.read(options.folder), options.side, options.output)
    print(f"{options.output} written")
    return 0


def _check(options: argparse.Namespace) -> int:
    if options.json is not None:
        check_folder_of(options.json)
        check_not_input(options.json, options.on, options.folder / "keys.json")
    from faceposer.cli.opening import print_notes
    from faceposer.session.key_folder import KeyFolder
    from faceposer.session.key_kinds import check_kinds
    from faceposer.session.keys import load_keys

    keys = KeyFolder.read(options.folder)
    check_kinds(keys)
    loaded = load_keys(keys)
    print_notes(options.folder, loaded.notes)
    for reason in loaded.left_out.values():
        print_notes(options.folder, f"Left out. {reason}")
    pairs = loaded.transfer.pairs
    form = "poses of its shapes" if loaded.has_own_shapes else "blends of meshes"
    print(f"{options.folder}: {counted(len(pairs) + 1, 'key')} with the neutral face; the target gets {form}")
    report: dict[str, Any] = {"keys": [pair.name for pair in pairs], "own_shapes": loaded.has_own_shapes}
    report["left_out"] = dict(loaded.left_out)
    if options.on is not None:
        report |= _coverage(loaded.transfer, options.on, options.count, keys)
    if options.json is not None:
        from faceposer.files.writing import write_json

        write_json(options.json, report, "report")
    # Scripts have to see that something is wrong.
    return 2 if loaded.left_out else 0


def _coverage(transfer: "ExampleTransfer", take: Path, count: int, keys: "KeyFolder") -> dict[str, Any]:
    """Print how the keys cover ``take``, and return it for the report."""
    from faceposer.cli.opening import print_notes
    from faceposer.interchange.reading import read_performance
    from faceposer.transfer.key_coverage import coverage, helpful_frames

    read = read_performance(take, transfer.source)
    print_notes(take, read.note)
    poses = read.performance.coefficients
    covered = coverage(transfer, poses)
    worst = int(covered.distances.argmax())
    helpful = helpful_frames(transfer, poses, count)
    mean, most = 10.0 * covered.distances.mean(), 10.0 * covered.distances[worst]
    print(
        f"{take}: {counted(len(poses), 'frame')}; the keys miss {100 * covered.missed:.2f} % of the motion. The "
        f"feature points are {mean:.2f} mm from the nearest combination of keys on average, at most {most:.2f} mm in "
        f"frame {worst}, and keys are exaggerated up to {covered.strengths.max():.1f} times."
    )
    for frame in helpful:
        print(f"  frame {frame.frame} as a key leaves {100 * frame.missed:.2f} % missed")
    return {
        "frames": len(poses),
        "missed": covered.missed,
        "distances_cm": covered.distances.tolist(),
        "motions_cm": covered.motions.tolist(),
        "strengths": covered.strengths.tolist(),
        "helpful_frames": [{"frame": frame.frame, "missed": frame.missed} for frame in helpful],
    }
