"""``faceposer render``: renders a character, a session or a mesh as a PNG image."""

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from faceposer.cli.arguments import add_contact_option, image_size, output_path
from faceposer.errors import FacePoserError
from faceposer.files.atomic import check_output

NAME = "render"
_VIEWS = ("front", "three-quarter", "left", "right")
_LARGEST_SIDE = 8192


def add_parser(commands: Any) -> None:
    """Add the parser of ``render`` to ``commands``."""
    parser = commands.add_parser(
        NAME, help="render a face", description="Render a character, a session or a mesh as a PNG image."
    )
    parser.add_argument("what", metavar="CHARACTER|SESSION|MESH", help="name of a character, session file or mesh file")
    parser.add_argument("-o", "--output", type=output_path, metavar="OUT.png", required=True, help="image to write")
    parser.add_argument("--view", choices=_VIEWS, default="front", help="view to render (default: front)")
    parser.add_argument(
        "--size",
        type=partial(image_size, least=1, most=_LARGEST_SIDE),
        metavar="WxH",
        default=(960, 960),
        help="width and height in pixels (default: 960x960)",
    )
    add_contact_option(parser)
    parser.add_argument("--no-expression-lines", action="store_true", help="render the skin without expression lines")
    parser.add_argument("--transparent", action="store_true", help="make the background transparent")


def run(options: argparse.Namespace) -> int:
    """Write the image and return the exit status."""
    check_output(options.output, ".png")
    from faceposer.geometry.mesh_companions import check_not_of_meshes
    from faceposer.geometry.mesh_io import MESH_SUFFIXES

    check_not_of_meshes(options.output, options.what)
    if Path(options.what).suffix.lower() in MESH_SUFFIXES:
        from faceposer.cli.opening import print_notes
        from faceposer.geometry.camera import OrbitView
        from faceposer.geometry.mesh_io import read_mesh, texture_notes
        from faceposer.render.images import write_png
        from faceposer.render.offscreen import render_mesh

        mesh = read_mesh(Path(options.what))
        print_notes(options.what, " ".join(texture_notes(Path(options.what), mesh)))
        view = OrbitView.preset(mesh.vertices.min(axis=0), mesh.vertices.max(axis=0), options.view)
        camera = view.camera(options.size)
        image = render_mesh(mesh.vertices, mesh.triangles(), camera, transparent=options.transparent)
        write_png(options.output, image)
    else:
        from faceposer.api import Face
        from faceposer.files import paths

        if Path(options.what).suffix.lower() not in ("", ".json", ".npz") and paths.exists(options.what):
            from faceposer.cli.remedies import remedy_for

            raise FacePoserError(
                f"'{options.what}' cannot be rendered; give a character (.npz), a session (.json) or a mesh "
                f"({', '.join(MESH_SUFFIXES)})."
                f"{remedy_for(Path(options.what))}"
            )
        from faceposer.cli.opening import open_with_remark

        face = Face(open_with_remark(options.what))
        face.contact = face.contact and options.contact
        face.render(
            options.output,
            options.view,
            options.size,
            expression_lines=not options.no_expression_lines,
            transparent=options.transparent,
        )
    print(f"{options.output} written")
    return 0
