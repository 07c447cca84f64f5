"""What is done with a mutated file of each kind, and which mutations it gets."""

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from faceposer.animation.trajectory_io import read_trajectories
from faceposer.geometry.marker_io import fill_gaps, read_markers
from faceposer.geometry.marker_map import read_marker_map
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.mesh_sequence import open_sequence
from faceposer.geometry.rig_io import read_rig
from faceposer.gui.settings import load_settings
from faceposer.interchange.meshes import foreign_library
from faceposer.interchange.reading import read_performance
from faceposer.model.character_file import load_character, save_character
from faceposer.model.expression_statistics import load_expression_statistics
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.photo.pins_file import read_pins
from faceposer.photo.reading import inspect_photo, read_photo
from faceposer.poses.applying import weights_on
from faceposer.poses.pose_file import read_pose
from faceposer.session.autosave import find_orphans
from faceposer.session.opening import load_model, open_session
from faceposer.sketch.strokes_file import read_strokes
from faceposer.sketch.svg_file import read_svg
from faceposer.solve.camera_io import read_camera
from faceposer.training.summary import findings_of, text_of_summary
from scripts.torture import mutations
from scripts.torture.mutations import Mutation

Values = Iterator[Any]


@dataclass(frozen=True)
class Reader:
    """A kind of file.

    Attributes:
        name: Name in reports and of its seeds.
        read: Reads a file and yields all numbers that result, which must be finite.
        structure: Mutations of its structure; bytes are changed as well.
        share: Relative number of mutations.
    """

    name: str
    read: Callable[[Path], Values]
    structure: tuple[Mutation, ...]
    share: float = 1.0


@cache
def _low() -> FaceModel:
    return load_model("low")


def prepare() -> None:
    """Load what the readers need, before the first file."""
    _low()
    open_session("low").wait()


def _session(path: Path) -> Values:
    session = open_session(str(path))
    session.wait(60.0)
    yield session.coefficients
    yield session.vertices
    yield session.residuals_px
    session.document.with_version_data(session.model).to_json()


def _journal(path: Path) -> Values:
    folder = path.parent / "journals"
    folder.mkdir()
    shutil.copy(path, folder / "1-a.json")
    found = find_orphans(folder)
    for orphan in found.orphans:
        session = orphan.open()
        session.wait(60.0)
        yield session.vertices
        orphan.release()


def _settings(path: Path) -> Values:
    os.environ["XDG_STATE_HOME"] = str(path.parent / "state")
    folder = path.parent / "state" / "faceposer"
    folder.mkdir(parents=True)
    shutil.copy(path, folder / "window.json")
    settings = load_settings()
    yield [settings.ui_scale, settings.key_light, settings.ambient_light, *settings.window_size]


def _pose(path: Path) -> Values:
    pose = read_pose(path)
    yield list(pose.weights.values())
    weights = weights_on(pose, _low().character)
    yield () if weights is None else weights


def _performance(path: Path) -> Values:
    read = read_performance(path, _low())
    yield read.performance.coefficients
    yield read.performance.rate


def _trajectories(path: Path) -> Values:
    character = _low().character
    camera = None if path.suffix == ".json" else read_camera(path.parents[1] / "seeds" / "camera.json", character)
    trajectories = read_trajectories(path, character, camera=camera)
    yield trajectories.positions[trajectories.seen]
    yield trajectories.rate


def _camera(path: Path) -> Values:
    camera = read_camera(path, _low().character)
    yield camera.project(_low().character.vertices)


def _pins(path: Path) -> Values:
    yield [pin.pixel for pin in read_pins(path)]


def _drawing(path: Path) -> Values:
    for stroke in read_svg(path).strokes:
        yield stroke.points


def _strokes(path: Path) -> Values:
    for stroke in read_strokes(path, _low().character):
        yield stroke.pixels
        yield stroke.camera.rotation


def _marker_map(path: Path) -> Values:
    character = _low().character
    places = read_marker_map(path).surface_points(character.vertices, character.triangles, character.feature_points)
    yield places.barycentric


def _markers(path: Path) -> Values:
    motion, _ = fill_gaps(read_markers(path))
    yield motion.positions[motion.seen]
    yield motion.rate or 0.0


def _character(path: Path) -> Values:
    character = load_character(path)
    model = build_face_model(character)
    yield model.surface(model.neutral(), True)
    yield model.basis
    if not all(line.isprintable() for line in text_of_summary(character).splitlines()):
        raise ValueError("the summary is not printable")
    findings_of(character, model)
    save_character(path.with_name("saved.npz"), character)
    yield load_character(path.with_name("saved.npz")).vertices


def _examples(path: Path) -> Values:
    sequence = open_sequence(path)
    yield sequence.neutral.vertices
    yield from sequence.read(0, min(len(sequence), 50))


def _statistics(path: Path) -> Values:
    statistics = load_expression_statistics(path)
    yield statistics.means
    yield statistics.covariances


def _mesh(path: Path) -> Values:
    mesh = read_mesh(path)
    yield mesh.vertices
    yield mesh.uv
    yield mesh.normals
    yield mesh.triangles()


def _library(path: Path) -> Values:
    """Read an OBJ file with the mutated material library beside it."""
    path.rename(path.with_name("mesh.mtl"))
    mesh = shutil.copy(path.parents[1] / "seeds" / "mesh.obj", path.parent)
    foreign_library(Path(mesh))
    yield from _mesh(Path(mesh))


def _folder(path: Path) -> Values:
    """Read a folder of shapes, one of them mutated."""
    seed = path.parents[1] / "seeds" / "plain.obj"
    shutil.copy(seed, path.parent / "neutral.obj")
    rig = read_rig(path.parent)
    yield rig.mesh.vertices
    yield from rig.targets.values()


def _gltf(path: Path) -> Values:
    rig = read_rig(path)
    yield rig.mesh.vertices
    yield rig.mesh.uv
    yield from rig.targets.values()


def _image(path: Path) -> Values:
    found = inspect_photo(path)
    yield found.size
    yield found.focal or 0.0
    yield read_photo(path, 512).shape


READERS: dict[str, Reader] = {
    reader.name: reader
    for reader in (
        Reader("session", _session, (mutations.json_structure,), 3.0),
        Reader("journal", _journal, (mutations.json_structure,), 0.5),
        Reader("settings", _settings, (mutations.json_structure,)),
        Reader("pose", _pose, (mutations.json_structure,)),
        Reader("weights", _performance, (mutations.json_structure,)),
        Reader("live link", _performance, (mutations.table,)),
        Reader("face cap", _performance, (mutations.table,)),
        Reader("trajectories", _trajectories, (mutations.json_structure, mutations.table)),
        Reader("camera", _camera, (mutations.json_structure,)),
        Reader("pins", _pins, (mutations.json_structure,)),
        Reader("strokes", _strokes, (mutations.json_structure,)),
        Reader("drawing", _drawing, (mutations.lines,)),
        Reader("marker map", _marker_map, (mutations.json_structure,)),
        Reader("markers", _markers, (mutations.table,)),
        Reader("c3d", _markers, (mutations.words_of_16_bits,)),
        Reader("character", _character, (mutations.archive,), 0.3),
        Reader("examples", _examples, (mutations.archive,)),
        Reader("statistics", _statistics, (mutations.archive,), 0.2),
        Reader("obj", _mesh, (mutations.lines,), 2.0),
        Reader("mtl", _library, (mutations.lines,), 0.5),
        Reader("ply", _mesh, (mutations.lines,)),
        Reader("off", _mesh, (mutations.lines,), 0.5),
        Reader("stl", _mesh, (mutations.lines,), 0.5),
        Reader("shape folder", _folder, (mutations.lines,)),
        Reader("gltf", _gltf, (mutations.gltf,), 2.0),
        Reader("gltf weights", _performance, (mutations.gltf,), 2.0),
        Reader("image", _image, ()),
    )
}


def finite(values: Values) -> bool:
    """Return True if all numbers in ``values`` are finite, after reading them."""
    # All parts are read, whatever the first of them has.
    found = [bool(np.isfinite(np.asarray(value, dtype=np.float64)).all()) for value in values]
    return all(found)
