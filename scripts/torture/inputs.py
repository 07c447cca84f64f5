"""Small inputs for commands, and the commands that write each kind of file."""

import io
import json
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from faceposer.cli import main
from faceposer.geometry.camera import Camera, OrbitView
from faceposer.interchange.meshes import write_posed_obj
from faceposer.landmarks.drawing import draw
from faceposer.landmarks.painting import painted_character
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import feature_curves
from faceposer.model.framing import face_view
from faceposer.photo.places import GUIDED
from faceposer.session.document import Document, write_document
from faceposer.session.opening import load_model
from faceposer.solve.constraints.point import PointConstraint

CHARACTER = "low"
_SHAPES = ("jawOpen", "mouthSmileLeft", "mouthSmileRight", "browInnerUp", "eyeBlinkLeft", "eyeBlinkRight")


@dataclass(frozen=True)
class Command:
    """A command that writes a file or a folder.

    Attributes:
        name: Name for reports.
        words: Its words; "{in}" is the folder of the inputs, "{out}" the output without its suffix.
        suffix: Suffix of the output, "" for a folder.
        draws: True if it needs OpenGL.
    """

    name: str
    words: tuple[str, ...]
    suffix: str
    draws: bool = False

    def called(self, inputs: Path, output: Path) -> list[str]:
        """Return the words for inputs in the folder ``inputs`` and the whole path ``output``."""
        return [word.replace("{in}", str(inputs)).replace("{out}", str(output)) for word in self.words]


COMMANDS: tuple[Command, ...] = (
    Command("solve", ("solve", "{in}/session.json", "-o", "{out}"), ".obj"),
    Command("report", ("solve", "{in}/session.json", "-o", "{in}/other.obj", "--report", "{out}"), ".json"),
    Command("glb", ("export", "{in}/session.json", "-o", "{out}"), ".glb"),
    Command("ply", ("export", CHARACTER, "-o", "{out}"), ".ply"),
    Command("obj", ("export", CHARACTER, "-o", "{out}"), ".obj"),
    Command("csv", ("export", CHARACTER, "--animation", "{in}/take.csv", "-o", "{out}"), ".csv"),
    Command("json", ("export", CHARACTER, "--animation", "{in}/take.csv", "-o", "{out}"), ".json"),
    Command("sequence", ("export", CHARACTER, "--animation", "{in}/take.csv", "--sequence", "ply", "-o", "{out}"), ""),
    Command("train", ("train", "--rig", "{in}/rig", "-o", "{out}"), ".npz"),
    Command("photo", ("photo", CHARACTER, "{in}/face.png", "--pins", "{in}/pins.json", "-o", "{out}"), ".json"),
    Command("sketch", ("sketch", CHARACTER, "{in}/strokes.json", "-o", "{out}"), ".json"),
    Command(
        "sketch report",
        ("sketch", CHARACTER, "{in}/strokes.json", "-o", "{in}/other.json", "--report", "{out}"),
        ".json",
    ),
    Command("animate", ("animate", CHARACTER, "{in}/trajectories.json", "-o", "{out}"), ".json"),
    Command("landmarks", ("landmarks", "{in}/portrait.png", "-o", "{out}"), ".json"),
    Command("landmarks image", ("landmarks", "{in}/portrait.png", "--image", "{out}"), ".png"),
    Command("transfer", ("transfer", "{in}/session.json", CHARACTER, "--method", "weights", "-o", "{out}"), ".json"),
    Command("render", ("render", "{in}/session.json", "-o", "{out}", "--size", "64x64"), ".png", draws=True),
    Command(
        "gif",
        ("export", CHARACTER, "--animation", "{in}/take.csv", "--size", "32x32", "-o", "{out}"),
        ".gif",
        draws=True,
    ),
)


def make_inputs(folder: Path, names: Sequence[str] = _SHAPES) -> FaceModel:
    """Write the inputs of ``COMMANDS`` to ``folder`` and return the face model of their character."""
    model = load_model(CHARACTER)
    character = model.character
    folder.mkdir(parents=True, exist_ok=True)
    write_document(folder / "session.json", session_document(model).with_version_data(model))
    (folder / "rig").mkdir(exist_ok=True)
    write_posed_obj(folder / "rig" / "neutral.obj", model, model.neutral(), False, False)
    for name in names:
        write_posed_obj(folder / "rig" / f"{name}.obj", model, model.coefficients_of({name: 1.0}), False, False)
    rows = [f"00:00:{i // 30:02}:{i % 30:02}.000,2,{i / 10},{i / 20}" for i in range(6)]
    (folder / "take.csv").write_text("\n".join(["Timecode,BlendShapeCount,JawOpen,MouthSmileLeft", *rows]) + "\n")
    Image.new("RGB", (400, 300), (90, 90, 90)).save(folder / "face.png")
    camera = Camera(np.diag([1.0, -1.0, -1.0]), np.array([3.0, -2.0, 120.0]), 900.0, (400, 300))
    seen = camera.project(character.vertices[[character.feature_points[name] for name in GUIDED]]).tolist()
    pins = [{"point": name, "pixel": pixel} for name, pixel in zip(GUIDED, seen, strict=True)]
    portrait = draw(painted_character(character), face_view(character).camera((400, 400)))
    Image.fromarray(portrait.image).save(folder / "portrait.png")
    (folder / "strokes.json").write_text(json.dumps(_brow_stroke(model)))
    chin = character.vertices[character.feature_points["2.1"]].astype(np.float64)
    moves = [{"name": "2.1", "positions": [(chin - (0.0, 0.1 * frame, 0.0)).tolist() for frame in range(6)]}]
    trajectories = {"format": "faceposer.trajectories", "version": 1, "rate": 30, "points": moves}
    (folder / "trajectories.json").write_text(json.dumps(trajectories))
    (folder / "pins.json").write_text(json.dumps({"format": "faceposer.pins", "version": 1, "pins": pins}))
    return model


def _brow_stroke(model: FaceModel) -> dict[str, Any]:
    """Return a file of strokes with a raised brow."""
    camera = face_view(model.character).camera((640, 480))
    brow = feature_curves(model.character)["left brow"][0]
    pixels = camera.project(model.positions_at(brow.points, model.neutral()) + (0.0, 0.3, 0.0)).tolist()
    view = {"view": "front", "size": [640, 480]}
    return {"format": "faceposer.strokes", "version": 1, "camera": view, "strokes": [{"pixels": pixels}]}


def preload(inputs: Path, commands: Sequence[Command]) -> None:
    """Run ``commands`` once in this process, so that its children find what they need in memory.

    Commands that draw are left out: a context of OpenGL must not be shared with children.
    """
    for command in commands:
        if command.draws:
            continue
        output = inputs / f"loaded-{command.name}{command.suffix}"
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()), suppress(SystemExit):
            main(command.called(inputs, output))


def session_document(model: FaceModel, prior_weight: float = 1.0) -> Document:
    """Return a session with a solved pin at the chin."""
    vertices = model.character.vertices
    camera = OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0)).camera((640, 480))
    vertex = model.character.feature_points["2.1"]
    u, v = camera.project(vertices[[vertex]])[0].tolist()
    return Document(CHARACTER, (PointConstraint(vertex, (u, v + 20.0), camera),), prior_weight)
