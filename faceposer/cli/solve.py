"""``faceposer solve``: solves the pose of a session file without a window."""

import argparse
from pathlib import Path
from typing import Any

from faceposer.cli.arguments import add_contact_option, add_materials_option, add_spread, output_path
from faceposer.errors import FacePoserError
from faceposer.files.atomic import check_not_input, check_output

NAME = "solve"
# Longest time for a solve, in seconds.


def add_parser(commands: Any) -> None:
    """Add the parser of ``solve`` to ``commands``."""
    parser = commands.add_parser(
        NAME, help="solve the pose of a session", description="Solve a session and write the posed face."
    )
    parser.add_argument("session", type=Path, metavar="SESSION", help="session file (docs/session-format.md)")
    parser.add_argument(
        "-o", "--output", type=output_path, metavar="OUT.obj", required=True, help="posed mesh to write"
    )
    parser.add_argument(
        "--report", type=output_path, metavar="R.json", help="also write energy, residuals and ARKit weights"
    )
    add_spread(parser, "that of the session")
    add_contact_option(parser)
    add_materials_option(parser)


def run(options: argparse.Namespace) -> int:
    """Solve the session, write the posed mesh and return the exit status."""
    check_output(options.output, ".obj")
    if options.report is not None:
        check_output(options.report, ".json")
        check_not_input(options.report, options.session)
    from dataclasses import replace

    from faceposer.cli.opening import print_remark
    from faceposer.files.writing import write_json
    from faceposer.interchange.meshes import write_posed_obj
    from faceposer.session.document import read_document
    from faceposer.session.opening import session_for
    from faceposer.session.report import solve_report

    if options.session.suffix.lower() != ".json":
        raise FacePoserError(f"'{options.session}' is not a session file; give one that ends in '.json'.")
    # A session without coefficients is solved on opening.
    document = replace(read_document(options.session), coefficients=None)
    if options.spread is not None:
        document = replace(document, spread=options.spread)
    session = session_for(document, options.session)
    print_remark(session)
    session.wait()
    if session.solution is None:  # without constraints, opening solves nothing
        session.apply()
        session.wait()
    solution = session.solution
    assert solution is not None
    contact = document.contact and options.contact
    write_posed_obj(options.output, session.model, session.coefficients, contact, options.materials)
    if options.report is not None:
        report = solve_report(session.model, session.document, solution)
        write_json(options.report, report, "report")
    constraints = session.document.constraints
    for i, (constraint, residual) in enumerate(zip(constraints, solution.residuals_px, strict=True)):
        print(f"constraint {i} ({constraint.kind}): {residual:.2f} px off")
    print(f"{options.output} written, {solution.seconds * 1e3:.1f} ms, energy {solution.energy:.4g}")
    return 0
