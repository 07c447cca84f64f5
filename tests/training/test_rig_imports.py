"""What is inferred about a rig's files is said; what cannot be an expression is refused before anything is written."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.obj_io import write_obj
from faceposer.geometry.polygon_mesh import MorphMesh
from faceposer.geometry.rig_io import read_rig
from faceposer.model.character import Character
from faceposer.model.character_file import load_character, save_character
from faceposer.progress import Progress
from faceposer.training.examples import ExampleOptions, character_from_examples
from faceposer.training.kinds import kind_of
from faceposer.training.rigs import RigOptions, character_from_morphs
from faceposer.training.summary import text_of_summary
from tests.geometry.test_gltf_io import Builder
from tests.training.faces import base, morph_mesh, write_examples

OPTIONS = RigOptions("me", "Me")


def imported(rig: MorphMesh) -> Character:
    return character_from_morphs(rig, "me.glb", OPTIONS, Progress())


def notes_of(rig: MorphMesh) -> list[str]:
    return [str(warning) for warning in imported(rig).summary["warnings"]]


def test_how_names_were_read_is_in_every_summary() -> None:
    rig = morph_mesh()
    named = {f"{name}_Head_Mesh": offsets for name, offsets in rig.targets.items()}
    character = imported(replace(rig, targets={**named, "Joy": rig.targets["jawOpen"]}))
    assert set(character.shape_names) == set(rig.targets)
    assert character.summary["not_arkit"] == ["Joy"]
    assert "Note: Names such as 'eyeBlinkLeft_Head_Mesh' are read without" in text_of_summary(character)


def test_targets_of_two_meshes_under_other_names_are_one_shape() -> None:
    rig = morph_mesh()
    tongue = next(part for part in base().parts if part.material == "tongue")
    inside = np.zeros((len(rig.mesh.vertices), 1), dtype=bool)
    inside[slice(*tongue.vertices)] = True
    targets = {f"{name}_Head": np.where(inside, 0, offsets) for name, offsets in rig.targets.items()}
    targets |= {f"{name}_Tongue": np.where(inside, offsets, 0) for name, offsets in rig.targets.items()}
    character = imported(replace(rig, targets=targets))
    np.testing.assert_allclose(character.shapes, imported(rig).shapes, atol=1e-4)
    assert any("were added to the shape of that name" in note for note in character.summary["warnings"])


def test_duplicates_matter_only_where_the_shape_is_used() -> None:
    rig = morph_mesh()
    assert (
        notes_of(replace(rig, targets={**rig.targets, "Joy": rig.targets["jawOpen"]}, unusable={"Joy": "Two."})) == []
    )
    with pytest.raises(FacePoserError, match="Twice"):
        imported(replace(rig, unusable={"jawOpen": "Twice."}))
    twice = {**rig.targets, "JAW_OPEN": rig.targets["jawOpen"], "Jaw-open": rig.targets["mouthClose"]}
    assert "2 further names of the same shapes" in notes_of(replace(rig, targets=twice))[0]
    del twice["jawOpen"]
    with pytest.raises(FacePoserError, match="both 'JAW_OPEN' and 'Jaw-open', which denote the same shape, jawOpen"):
        imported(replace(rig, targets=twice))


@pytest.mark.parametrize(("factor", "said"), [(100.0, "divided by 100"), (0.01, "multiplied by 100")])
def test_displacements_in_another_unit_are_converted(factor: float, said: str) -> None:
    rig = morph_mesh()
    scaled = replace(rig, targets={name: factor * offsets for name, offsets in rig.targets.items()})
    character = imported(scaled)
    np.testing.assert_allclose(character.shapes, imported(rig).shapes, atol=1e-3)
    assert said in character.summary["warnings"][0]


def test_displacements_that_no_face_has_are_refused() -> None:
    rig = morph_mesh()
    with pytest.raises(FacePoserError, match=r"The shape \w+ of the rig 'me.glb' moves vertices by \d+ cm"):
        imported(replace(rig, targets={name: 20.0 * offsets for name, offsets in rig.targets.items()}))
    with pytest.raises(FacePoserError, match=r"The shape jawOpen of the rig 'me.glb' moves"):
        imported(replace(rig, targets={**rig.targets, "jawOpen": 100.0 * rig.targets["jawOpen"]}))


def test_positions_in_place_of_displacements(tmp_path: Path) -> None:
    face = base()
    names = [name for name, shape in zip(face.shape_names, face.shapes, strict=True) if shape.any()][:8]
    points = face.vertices.astype("<f4")
    offsets = [face.shapes[face.shape_names.index(name)].astype("<f4") for name in names]
    builder = Builder()
    targets = tuple(points + offset if i < 3 else offset for i, offset in enumerate(offsets))
    primitive = builder.primitive(points, face.triangles.astype("<u4").reshape(-1, 1).ravel(), targets)
    builder.node(mesh=builder.mesh(primitive, names=names))
    rig = read_rig(builder.write(tmp_path / "a.glb"))
    for name, offset in zip(names, offsets, strict=True):
        np.testing.assert_allclose(rig.targets[name], offset, atol=1e-4)
    assert "3 targets have positions instead of displacements" in rig.notes[0]


def test_mirrored_meshes_are_told_from_names_of_the_viewer() -> None:
    rig = morph_mesh()
    mirror = np.array([-1.0, 1.0, 1.0])
    mesh = replace(rig.mesh, vertices=rig.mesh.vertices * mirror)
    targets = {name: (offsets * mirror).astype(np.float32) for name, offsets in rig.targets.items()}
    assert notes_of(MorphMesh(mesh, targets))[0].startswith("The mesh is mirrored: its left shapes move its right")
    other = {
        name.replace("Left", "?").replace("Right", "Left").replace("?", "Right"): offsets
        for name, offsets in rig.targets.items()
    }
    assert "or its shapes are named from the viewer's side" in notes_of(replace(rig, targets=other))[0]


def test_no_character_is_written_that_cannot_be_read_again(tmp_path: Path) -> None:
    character = imported(morph_mesh())
    path = tmp_path / "a.npz"
    with pytest.raises(FacePoserError, match=r"not written to '.*a\.npz': its shapes move vertices by up to .* cm"):
        save_character(path, replace(character, shapes=1e5 * character.shapes))
    assert not path.exists()
    # A file name of other bytes than text.
    save_character(path, replace(character, summary={**character.summary, "source": "caf\udce9"}))
    assert load_character(path).summary["source"] == "caf?"


def test_folders_are_rigs_however_their_files_are_called(tmp_path: Path) -> None:
    for i, name in enumerate(("jawOpen", "mouthClose", "eyeBlinkLeft", "eyeBlinkRight", "browInnerUp")):
        (tmp_path / f"{i}_{name}_Head.obj").write_text("")
        (tmp_path / f"._{i}_{name}_Head.obj").write_text("")
    assert kind_of(tmp_path) == "rig"
    (tmp_path / "0_jawOpen_Head.obj").unlink()
    assert kind_of(tmp_path) == "examples"


def rewritten(folder: Path, frame: str, change: object) -> None:
    face = base()
    vertices = np.array([line.split()[1:] for line in (folder / frame).read_text().splitlines() if line[:2] == "v "])
    write_obj(folder / frame, change(vertices.astype(np.float64)), face.polygons)  # type: ignore[operator]


def test_examples_of_another_size_are_scaled_and_others_are_refused(tmp_path: Path) -> None:
    write_examples(tmp_path, 5)
    options = ExampleOptions("a", "A", segments="whole")
    plain = character_from_examples(tmp_path, options)
    rewritten(tmp_path, "frame2.obj", lambda v: 100.0 * v)
    scaled = character_from_examples(tmp_path, options)
    assert re.match(r"1 mesh has (99|10\d)\S* times the size of the neutral mesh", scaled.summary["warnings"][0])
    assert np.abs(scaled.shapes).max() == pytest.approx(np.abs(plain.shapes).max(), rel=0.02)
    for change, said in (
        (lambda v: v * (-1.0, 1.0, 1.0), "it is mirrored"),
        (lambda v: v[::-1], "its vertices"),
        (lambda v: 0.0 * v, "all on one line"),
    ):
        rewritten(tmp_path, "frame4.obj", change)
        with pytest.raises(FacePoserError) as refused:
            character_from_examples(tmp_path, options)
        assert re.search(rf"frame4\.obj'.*{said}", str(refused.value))
        (tmp_path / "frame4.obj").unlink()
        write_examples(tmp_path, 5)
