"""Contact is one switch: in sessions, in Python, in commands, and in every file that shows the face."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import faceposer
from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import read_mesh
from faceposer.interchange.formats import FORMATS
from faceposer.interchange.glb import CONTACT_NOTE, write_glb
from faceposer.interchange.meshes import write_sequence
from faceposer.model.performance import Performance
from faceposer.session.document import Document, read_document, write_document
from faceposer.session.opening import load_model, open_session
from tests.command_line import run

CLOSED = {"eyeBlinkLeft": 1.7, "eyeBlinkRight": 1.7}


@pytest.fixture
def session(tmp_path: Path) -> Path:
    path = tmp_path / "closed.json"
    write_document(path, Document("low").posed(load_model("low").coefficients_of(CLOSED)))
    return path


def test_a_session_keeps_that_contact_is_off(session: Path) -> None:
    assert "contact" not in json.loads(session.read_text())
    opened = open_session(str(session))
    assert opened.document.contact
    opened.set_contact(False)
    assert opened.undo_label == "Turn contact off"
    assert opened.dirty
    np.testing.assert_array_equal(opened.vertices, opened.model.instance(opened.coefficients))
    opened.save(session)
    assert json.loads(session.read_text())["contact"] is False
    again = open_session(str(session))
    assert not again.document.contact
    opened.undo()
    assert opened.document.contact
    assert not np.array_equal(opened.vertices, again.vertices)


def test_contact_is_true_or_false(session: Path) -> None:
    data = json.loads(session.read_text()) | {"contact": "yes"}
    session.write_text(json.dumps(data))
    with pytest.raises(FacePoserError, match=r"contact must be true or false"):
        read_document(session)
    face = faceposer.load("low")
    with pytest.raises(FacePoserError, match="contact must be True or False"):
        face.contact = "no"  # type: ignore[assignment]


@pytest.mark.gl
def test_vertices_meshes_and_pictures_agree(tmp_path: Path) -> None:
    face = faceposer.load("low")
    face.set_weights(CLOSED)
    shown = {}
    for contact in (True, False):
        face.contact = contact
        shown[contact] = face.vertices
        for suffix in ("obj", "ply"):
            mesh = read_mesh(face.export(tmp_path / f"{contact}.{suffix}"))
            np.testing.assert_allclose(mesh.vertices, face.vertices, atol=1e-4)
        drawn = face.render(tmp_path / f"{contact}.png", size=(96, 96))
        np.testing.assert_array_equal(drawn, np.asarray(Image.open(tmp_path / f"{contact}.png")))
    assert np.abs(shown[True] - shown[False]).max() > 0.1
    np.testing.assert_array_equal(shown[False], face.model.instance(face.coefficients))
    assert (tmp_path / "True.png").read_bytes() != (tmp_path / "False.png").read_bytes()


@pytest.mark.gl
def test_commands_leave_contact_out(session: Path, tmp_path: Path) -> None:
    model = load_model("low")
    p = model.coefficients_of(CLOSED)
    for command, suffix in (("export", "obj"), ("export", "png"), ("render", "png"), ("solve", "obj")):
        files = [tmp_path / f"{command}-{name}.{suffix}" for name in ("with", "without")]
        assert run(command, session, "-o", files[0]) == 0
        assert run(command, session, "-o", files[1], "--no-contact") == 0
        # Without constraints a solve goes back to within the rig's limits.
        if command == "export" and suffix == "obj":
            np.testing.assert_allclose(read_mesh(files[0]).vertices, model.surface(p), atol=1e-4)
            np.testing.assert_allclose(read_mesh(files[1]).vertices, model.instance(p), atol=1e-4)
        elif command != "solve":
            assert files[0].read_bytes() != files[1].read_bytes()


def test_a_sequence_and_a_transfer_follow_the_switch(session: Path, tmp_path: Path) -> None:
    model = load_model("low")
    p = model.coefficients_of(CLOSED)
    for contact in (True, False):
        files = write_sequence(tmp_path / f"{contact}", model, Performance(p[None], 30.0), "ply", contact=contact)
        np.testing.assert_allclose(read_mesh(files[0]).vertices, model.surface(p, contact), atol=1e-4)
    assert run("transfer", session, "man", "-o", tmp_path / "man.json", "--no-contact") == 0
    assert not read_document(tmp_path / "man.json").contact


def test_morph_targets_and_weights_are_the_same_with_contact_and_without(session: Path, tmp_path: Path) -> None:
    for suffix in ("glb", "csv"):
        files = [tmp_path / f"{name}.{suffix}" for name in ("with", "without")]
        assert run("export", session, "-o", files[0]) == 0
        assert run("export", session, "-o", files[1], "--no-contact") == 0
        assert files[0].read_bytes() == files[1].read_bytes()


def test_everybody_who_writes_weights_or_targets_is_told_that_contact_is_not_in_them(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for command in ("solve", "export", "animate", "transfer"):
        assert run(command, "--help") == 0
        said = " ".join(capsys.readouterr().out.split())
        assert "Morph targets (.glb) and weights (.csv, .json) never contain contact" in said, command
    for documented in (faceposer.Face.export, faceposer.Face.save, write_glb):
        said = " ".join((documented.__doc__ or "").split())
        assert re.search("contain (the )?contact", said), documented
        assert ".glb" in said or "cannot contain" in said, documented
    for suffix in (".glb", ".csv", ".json"):
        assert "without contact" in FORMATS[suffix].purpose, suffix
        assert not FORMATS[suffix].contact
    face = faceposer.load("low")
    face.export(tmp_path / "a.glb")
    assert CONTACT_NOTE.encode() in (tmp_path / "a.glb").read_bytes()
