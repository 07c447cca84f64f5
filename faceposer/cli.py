"""The commands. Heavy modules are imported by the command that needs them, so that help and errors come at once."""

import argparse
import json
import os
import re
import sys
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import NoReturn

from faceposer import cli_applications, cli_evaluation, cli_training
from faceposer.cli_applications.arguments import add_spread
from faceposer.cli_applications.contact_option import add_contact_option
from faceposer.errors import FacePoserError, NoWindowError
from faceposer.interchange.files import check_apart, check_output

_COMMANDS = (
    "solve",
    "render",
    "subjects",
    "demo",
    *cli_training.COMMANDS,
    *cli_evaluation.COMMANDS,
    *cli_applications.COMMANDS,
)
_VIEWS = ("front", "three-quarter", "left", "right")
_MAX_SIDE = 8192

_USAGE = """\
examples:
  faceposer                                  open the window with the man
  faceposer woman                            ... with the woman
  faceposer smile.json                       ... with a saved session
  faceposer solve smile.json -o smile.obj    pose without a window
  faceposer render woman -o woman.png        draw without a window
  faceposer subjects                         list the faces that come with the program
  faceposer demo -o DIR                      watch the program being used, as files
  faceposer train --rig me.glb -o me.npz     make a character of your own; also --examples, --markers
  faceposer subject info me.npz              say what is in a subject file; also check, rename
  faceposer export smile.json -o smile.glb   to other programs and back: meshes, weights, pictures, films
  faceposer animate man lips.csv --camera camera.json -o lips.json
                                             let the face follow trajectories of a few points
  faceposer transfer smile.json woman -o her-smile.json
                                             carry an expression or an animation to another face
  faceposer photo woman face.jpg --pins pins.json -o face.json
                                             pose after a photo
  faceposer evaluate -o DIR                  how near the prior and its rivals come to unseen expressions

'faceposer COMMAND --help' tells more of a command."""


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one sentence, without the usage before it."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{message[:1].upper()}{message[1:]}; see '{self.prog} --help'.\n")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line ``arguments``, those of the process if None, and exit with its status."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    # The matrices are small: threads of NumPy's own would only take time from the frames and the solver.
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    try:
        status = _run(words)
    except FacePoserError as error:
        print(error, file=sys.stderr)
        # A status of its own, by which scripts/run knows to play the demo instead.
        status = 3 if isinstance(error, NoWindowError) else 2
    except KeyboardInterrupt:
        status = 130
    except BrokenPipeError:
        status = 141
    sys.exit(status)


def _run(words: list[str]) -> int:
    if words and words[0] in _COMMANDS:
        options = _command_parser().parse_args(words)
        if options.command in cli_training.COMMANDS:
            return cli_training.run(options)
        if options.command in cli_evaluation.COMMANDS:
            return cli_evaluation.run(options, words)
        if options.command in cli_applications.COMMANDS:
            return cli_applications.run(options)
        return {"solve": _solve, "render": _render, "subjects": _subjects, "demo": _demo}[options.command](options)
    options = _window_parser().parse_args(words)
    return _window(options)


def _version() -> str:
    try:
        return f"Face Poser {metadata.version('faceposer')}"
    except metadata.PackageNotFoundError:
        return "Face Poser, not installed"


def _window_parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="faceposer",
        description="Pose a 3D face by dragging it: the whole face follows as a real face would.",
        epilog=_USAGE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "what", metavar="SUBJECT or SESSION", nargs="?", default="man", help="a face or a saved session"
    )
    parser.add_argument("--version", action="version", version=_version())
    parser.add_argument("--exit-after-first-frame", action="store_true", help=argparse.SUPPRESS)
    return parser


def _command_parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="faceposer")
    commands = parser.add_subparsers(dest="command", required=True)

    solve = commands.add_parser(
        "solve", help="pose a session's face", description="Solve a session and write the face."
    )
    solve.add_argument("session", type=Path, metavar="SESSION", help="session file (docs/session-format.md)")
    solve.add_argument("-o", "--output", type=Path, metavar="OUT.obj", required=True, help="posed mesh to write")
    solve.add_argument("--report", type=Path, metavar="R.json", help="also write energy, residuals and ARKit weights")
    add_spread(solve, "as the session has it")
    add_contact_option(solve)

    render = commands.add_parser(
        "render", help="draw a face", description="Draw a subject, a session or a mesh as PNG."
    )
    render.add_argument("what", metavar="SUBJECT|SESSION|MESH", help="name of a subject, session file or mesh file")
    render.add_argument("-o", "--output", type=Path, metavar="OUT.png", required=True, help="picture to write")
    render.add_argument("--view", choices=_VIEWS, default="front", help="where to look from (default: front)")
    render.add_argument("--size", type=_size, metavar="WxH", default=(960, 960), help="pixels (default: 960x960)")
    add_contact_option(render)

    render.add_argument(
        "--no-expression-lines", action="store_true", help="leave out the lines that a pose makes in the skin"
    )

    commands.add_parser("subjects", help="list the faces", description="List the faces that come with the program.")

    demo = commands.add_parser(
        "demo",
        help="play a scripted pose",
        description="Play a scripted pose through the real program, without a display, and write what it shows.",
    )
    demo.add_argument("-o", "--output", type=Path, metavar="DIR", required=True, help="folder to write into")
    cli_training.add_parsers(commands)
    cli_applications.add_parsers(commands)
    cli_evaluation.add_parsers(commands)
    return parser


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,5})[xX](\d{1,5})", text)
    sides = tuple(int(side) for side in match.groups()) if match else ()
    if len(sides) != 2 or not all(1 <= side <= _MAX_SIDE for side in sides):
        raise argparse.ArgumentTypeError(f"'{text}' is not a size such as 960x720, with sides from 1 to {_MAX_SIDE}")
    return (sides[0], sides[1])


def _solve(options: argparse.Namespace) -> int:
    check_output(options.output, ".obj")
    if options.report is not None:
        check_output(options.report, ".json")
        check_apart(options.report, options.session)
    from faceposer.api import Face
    from faceposer.cli_applications.opening import open_with_remark
    from faceposer.session.document import write_text
    from faceposer.session.report import solve_report

    if options.session.suffix.lower() != ".json":
        raise FacePoserError(f"'{options.session}' is no session file; give one that ends in '.json'.")
    face = Face(open_with_remark(str(options.session)))
    if options.spread is not None:
        face.spread = options.spread
    face.contact = face.contact and options.contact
    solution = face.solve()
    face.save(options.output)
    if options.report is not None:
        report = solve_report(face.model, face.session.document, solution)
        write_text(options.report, json.dumps(report, indent=1) + "\n", "report")
    for i, (constraint, residual) in enumerate(zip(face.constraints, solution.residuals_px, strict=True)):
        print(f"constraint {i} ({constraint.kind}): {residual:.2f} px off")
    print(f"{options.output} written, {solution.seconds * 1e3:.1f} ms, energy {solution.energy:.4g}")
    return 0


def _render(options: argparse.Namespace) -> int:
    check_output(options.output, ".png")
    from faceposer.geometry.mesh_io import MESH_SUFFIXES

    if Path(options.what).suffix.lower() in MESH_SUFFIXES:
        from faceposer.geometry.camera import OrbitView
        from faceposer.geometry.mesh_io import read_mesh
        from faceposer.viewer.offscreen import render_mesh
        from faceposer.viewer.pictures import write_png

        mesh = read_mesh(Path(options.what))
        view = OrbitView.preset(mesh.vertices.min(axis=0), mesh.vertices.max(axis=0), options.view)
        write_png(options.output, render_mesh(mesh.vertices, mesh.triangles(), view.camera(options.size)))
    else:
        from faceposer.api import Face
        from faceposer.cli_applications.opening import open_with_remark

        face = Face(open_with_remark(options.what))
        face.contact = face.contact and options.contact
        face.render(options.output, options.view, options.size, expression_lines=not options.no_expression_lines)
    print(f"{options.output} written")
    return 0


def _subjects(_options: argparse.Namespace) -> int:
    from faceposer.model.subject_file import available_subjects

    subjects = available_subjects()
    width = max((len(name) for name, _ in subjects), default=0)
    for name, title in subjects:
        print(f"{name:{width}}  {title}")
    return 0


def _demo(options: argparse.Namespace) -> int:
    from faceposer.viewer.demo import run

    run(options.output)
    return 0


def _window(options: argparse.Namespace) -> int:
    from faceposer.viewer.app import run

    return run(options.what, exit_after_first_frame=options.exit_after_first_frame)
