"""``faceposer landmarks``: finds the landmarks of faces in a photo or of a mesh."""

import argparse
from pathlib import Path
from typing import Any

from faceposer.cli.arguments import output_path
from faceposer.errors import FacePoserError, printable
from faceposer.files.atomic import check_distinct, check_output

NAME = "landmarks"


def add_parser(commands: Any) -> None:
    """Add the parser of ``landmarks`` to ``commands``."""
    parser = commands.add_parser(
        NAME,
        help="find the landmarks of faces",
        description="Find 468 points and the irises of faces in a photo, or the points and feature points of a mesh.",
    )
    parser.add_argument("what", metavar="PHOTO|MESH|CHARACTER", help="photo, mesh file, or character")
    parser.add_argument(
        "-o", "--output", type=output_path, metavar="POINTS.json", help="write the points (docs/landmarks.md)"
    )
    parser.add_argument(
        "--image", type=output_path, metavar="OUT.png", help="draw the points over the photo or the mesh"
    )
    parser.add_argument(
        "--pins", type=output_path, metavar="PINS.json", help="write pins on the face, for 'faceposer photo'"
    )
    parser.add_argument("--all", action="store_true", help="find all faces of the photo, also small ones")


def run(options: argparse.Namespace) -> int:
    """Find the landmarks, write what is asked for and return the exit status."""
    outputs = ((options.output, ".json"), (options.image, ".png"), (options.pins, ".json"))
    for path, suffix in outputs:
        if path is not None:
            check_output(path, suffix)
    check_distinct(*(path for path, _ in outputs))
    from faceposer.geometry.mesh_companions import check_not_of_meshes
    from faceposer.landmarks.reading import is_mesh

    for path, _ in outputs:
        check_not_of_meshes(path, options.what)
    if is_mesh(options.what):
        if options.pins is not None:
            raise FacePoserError("Pins are for photos; 'faceposer photo' aligns a character with a photo.")
        return _mesh(options)
    return _photo(options)


def _photo(options: argparse.Namespace) -> int:
    from faceposer.files.writing import write_json
    from faceposer.landmarks.overlay import photo_overlay, write_picture
    from faceposer.landmarks.points import find_all_landmarks, find_landmarks
    from faceposer.landmarks.report import photo_report, pins_report
    from faceposer.photo.reading import read_photo

    image = read_photo(Path(options.what))
    if options.all:
        faces = find_all_landmarks(image)
    else:
        face = find_landmarks(image)
        faces = [] if face is None else [face]
    if not faces:
        raise FacePoserError(
            f"No face was found in '{options.what}'; use a photo in which a face is larger and seen from the front."
        )
    for face in faces:
        left, top, right, bottom = face.box.round().astype(int).tolist()
        print(f"face of {right - left} x {bottom - top} px at ({left}, {top}), score {face.score:.3f}")
    if options.output is not None:
        height, width = image.shape[:2]
        report = photo_report(options.what, (width, height), faces)
        write_json(options.output, report, "file of landmarks", indent=None)
        print(f"{options.output} written")
    if options.pins is not None:
        write_json(options.pins, pins_report(faces[0]), "file of pins")
        print(f"{options.pins} written")
    if options.image is not None:
        write_picture(options.image, photo_overlay(image, faces))
        print(f"{options.image} written")
    return 0


def _mesh(options: argparse.Namespace) -> int:
    from faceposer.files.writing import write_json
    from faceposer.landmarks.feature_points import feature_places
    from faceposer.landmarks.on_meshes import find_mesh_landmarks
    from faceposer.landmarks.overlay import mesh_overlay, write_picture
    from faceposer.landmarks.reading import read_painted
    from faceposer.landmarks.report import mesh_report

    mesh = read_painted(options.what)
    found = find_mesh_landmarks(mesh)
    if found is None:
        raise FacePoserError(f"No face was found on '{options.what}'; give a mesh of a head with its face.")
    features = feature_places(found)
    scale = float(found.frame.scale)
    print(f"face in {len(found.views)} views, score {found.score:.3f}, 1 unit is {scale:.3g} cm")
    for name, feature in features.items():
        x, y, z = feature.place
        guess = ", extrapolated" if feature.extrapolated else ""
        print(printable(f"{name:5} {feature.title:34} vertex {feature.vertex:6}  ({x:.4g}, {y:.4g}, {z:.4g}){guess}"))
    if options.output is not None:
        write_json(options.output, mesh_report(options.what, found, features), "file of landmarks", indent=None)
        print(f"{options.output} written")
    if options.image is not None:
        write_picture(options.image, mesh_overlay(found, features))
        print(f"{options.image} written")
    return 0
