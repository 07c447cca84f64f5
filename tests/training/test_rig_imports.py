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
from faceposer.training.canonical_frame import opposite_name
from faceposer.training.examples import ExampleOptions, character_from_examples
from faceposer.training.kinds import kind_of
from faceposer.training.rigs import RigOptions, character_from_morphs
from faceposer.training.summary import text_of_summary
from tests.geometry.test_gltf_io import Builder
from tests.training.faces import base, morph_mesh, rotation, write_examples

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
    with pytest.raises(FacePoserError, match=r"its displacements are about \d+ times those of a face .* unit"):
        imported(replace(rig, targets={name: 20.0 * offsets for name, offsets in rig.targets.items()}))
    with pytest.raises(
        FacePoserError, match=r"its shape jawOpen moves vertices by \d+ cm, \d+ times as far|moves vertices by 430 cm"
    ):
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
    assert re.match(r"3 targets, such as '\w+', have positions instead of displacements", rig.notes[0])


def exchanged_names(rig: MorphMesh, keep: tuple[str, ...] = ()) -> MorphMesh:
    """The rig with names from the viewer's side, except those to ``keep``."""
    return replace(
        rig, targets={name if name in keep else opposite_name(name): offsets for name, offsets in rig.targets.items()}
    )


def mirrored(rig: MorphMesh) -> MorphMesh:
    """The rig with a negative scale: its faces point inwards."""
    mirror = np.array([-1.0, 1.0, 1.0])
    mesh = replace(rig.mesh, vertices=rig.mesh.vertices * mirror)
    return MorphMesh(mesh, {name: (offsets * mirror).astype(np.float32) for name, offsets in rig.targets.items()})


def assert_looks_forward(character: Character) -> None:
    """Check that the corner and chin are in front, and the left shapes move the left side."""
    shapes = dict(zip(character.shape_names, character.shapes, strict=True))
    for name, offsets in shapes.items():
        if name.endswith(("Left", "Right")) and not name.startswith(("jaw", "mouthLeft", "mouthRight")):
            weights = np.einsum("nd,nd->n", offsets, offsets)
            middle = weights @ character.vertices / weights.sum()
            assert middle[0] * (1.0 if name.endswith("Left") else -1.0) > 0.5, name
            assert middle[2] > 2.0, name
    assert shapes["jawOpen"][:, 1].min() < -1.0
    assert shapes["jawForward"][:, 2].max() > 0.3
    assert shapes["jawLeft"][:, 0].max() > 0.3
    skin = character.part("skin") if any(part.name == "skin" for part in character.parts) else character.parts[0]
    triangles = character.triangles[slice(*character.part_triangles(skin))]
    corners = character.vertices[triangles]
    forward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    assert forward[corners[:, :, 2].mean(axis=1) > 6.0].sum() > 0.0, "the faces point outwards"


@pytest.mark.parametrize("seed", [None, 3])
@pytest.mark.parametrize("keep", [(), ("jawLeft", "jawRight", "mouthLeft", "mouthRight")])
def test_names_from_the_viewers_side_never_turn_the_face_around(seed: int | None, keep: tuple[str, ...]) -> None:
    rig = morph_mesh(None if seed is None else rotation(seed))
    character = imported(exchanged_names(rig, keep))
    assert_looks_forward(character)
    assert re.match(rf"{40 - len(keep)} shapes are named from the viewer's side", character.summary["warnings"][0])
    plain = imported(rig)
    np.testing.assert_allclose(character.vertices, plain.vertices, atol=0.02)
    named = dict(zip(character.shape_names, character.shapes, strict=True))
    for name, offsets in zip(plain.shape_names, plain.shapes, strict=True):
        np.testing.assert_allclose(named[name], offsets, atol=0.02)


def test_few_shapes_with_exchanged_names() -> None:
    names = (
        "jawOpen",
        "mouthSmileLeft",
        "mouthSmileRight",
        "eyeBlinkLeft",
        "eyeBlinkRight",
        "browInnerUp",
        "mouthPucker",
    )
    rig = morph_mesh()
    few = exchanged_names(replace(rig, targets={name: rig.targets[name] for name in names}))
    character = imported(few)
    assert np.argmax(character.vertices[:, 2]) == np.argmax(imported(rig).vertices[:, 2])
    assert "4 shapes are named from the viewer's side" in character.summary["warnings"][0]


def test_meshes_that_are_mirrored_as_a_whole_are_mirrored_back() -> None:
    rig = morph_mesh(rotation(4))
    character = imported(mirrored(rig))
    assert_looks_forward(character)
    assert character.summary["warnings"] == [
        "The mesh is mirrored: its faces point inwards and its left shapes move its right side. It was mirrored back; "
        "poses are saved as in the file."
    ]
    # Saved poses have the place and the orientation of the file.
    origin = character.origin
    assert origin is not None
    name = "mouthSmileLeft"
    offsets = character.shapes[character.shape_names.index(name)]
    np.testing.assert_allclose(
        origin.vertices_of(offsets), mirrored(rig).mesh.vertices + mirrored(rig).targets[name], atol=1e-3
    )


def test_sides_can_be_given() -> None:
    rig = morph_mesh()
    kept = character_from_morphs(exchanged_names(rig), "me.glb", replace(OPTIONS, sides="as-named"), Progress())
    assert "40 shapes move the other side of the face than their names say" in kept.summary["warnings"][0]
    left = kept.shapes[kept.shape_names.index("mouthSmileLeft")]
    assert kept.vertices[np.argmax(np.abs(left).max(axis=1)), 0] < -1.0
    corner = kept.vertices[kept.feature_points["8.3"]]
    assert corner[0] > 1.0
    assert corner[2] > 4.0
    swapped = character_from_morphs(rig, "me.glb", replace(OPTIONS, sides="exchanged"), Progress())
    left = swapped.shapes[swapped.shape_names.index("mouthSmileLeft")]
    assert swapped.vertices[np.argmax(np.abs(left).max(axis=1)), 0] < -1.0


def test_single_shapes_of_the_other_side_are_mentioned() -> None:
    rig = morph_mesh()
    targets = {**rig.targets, "mouthSmileLeft": rig.targets["mouthSmileRight"]}
    assert notes_of(replace(rig, targets=targets))[0].startswith("The shape mouthSmileLeft moves the other side")


def changed(rig: MorphMesh, change: object, *names: str) -> MorphMesh:
    targets = {
        name: change(offsets).astype(np.float32) if not names or name in names else offsets  # type: ignore[operator]
        for name, offsets in rig.targets.items()
    }
    return replace(rig, targets=targets)


@pytest.mark.parametrize(
    ("factor", "names", "said"),
    [
        (10.0, (), "about 10 times those of a face; they were divided by 10"),
        (0.1, (), "about 0.1 times those of a face; they were multiplied by 10"),
        (1000.0, (), "about 1000 times those of a face; they were divided by 1000"),
        (4.0, (), r"move the face about (3\.9|4) times as far as usual"),
        (0.3, (), r"move the face only about 0\.\d+ times as far as usual"),
        (-1.0, (), "in the opposite directions; their displacements were negated"),
        (
            5.0,
            ("jawOpen",),
            r"The shape jawOpen moves vertices much farther than the others \(5 times as far as usual\)",
        ),
        (0.01, ("jawOpen",), r"The shape jawOpen hardly moves any vertex \(0.01 times as far as usual\)"),
        (-1.0, ("jawOpen",), "The shape jawOpen moves vertices against the usual direction"),
    ],
)
def test_implausible_sizes_and_directions_are_mentioned(factor: float, names: tuple[str, ...], said: str) -> None:
    character = imported(changed(morph_mesh(), lambda offsets: factor * offsets, *names))
    assert len(character.summary["warnings"]) == 1
    assert re.search(said, character.summary["warnings"][0])
    if not names and factor not in (4.0, 0.3):
        assert_looks_forward(character)


def test_shapes_of_another_part_are_mentioned() -> None:
    rig = morph_mesh()
    targets = {**rig.targets, "eyeBlinkLeft": rig.targets["jawOpen"]}
    notes = notes_of(replace(rig, targets=targets))
    assert any(note.startswith("The shape eyeBlinkLeft moves another part of the face") for note in notes)
    names = list(rig.targets)
    shuffled = dict(zip(names, [rig.targets[name] for name in names[17:] + names[:17]], strict=True))
    with pytest.raises(FacePoserError, match="move another part of the face, or in another direction"):
        imported(replace(rig, targets=shuffled))


def test_displacements_in_another_vertex_order_are_refused(tmp_path: Path) -> None:
    rig = morph_mesh()
    order = np.random.default_rng(0).permutation(len(rig.mesh.vertices))
    with pytest.raises(FacePoserError, match="another vertex order"):
        imported(changed(rig, lambda offsets: offsets[order]))
    with pytest.raises(FacePoserError, match="another vertex order"):
        imported(changed(rig, lambda offsets: np.roll(offsets, 37, axis=0)))
    # A single target of a file, which is read, but not used.
    face = base()
    names = [name for name, shape in zip(face.shape_names, face.shapes, strict=True) if shape.any()][:8]
    points = face.vertices.astype("<f4")
    offsets = [face.shapes[face.shape_names.index(name)].astype("<f4") for name in names]
    names.append("mouthSmileLeft")
    offsets.append(face.shapes[face.shape_names.index(names[-1])].astype("<f4")[order])
    builder = Builder()
    primitive = builder.primitive(points, face.triangles.astype("<u4").reshape(-1, 1).ravel(), tuple(offsets))
    builder.node(mesh=builder.mesh(primitive, names=names))
    unusable = read_rig(builder.write(tmp_path / "a.glb")).unusable
    assert list(unusable) == ["mouthSmileLeft"]
    assert "neighbouring vertices move in unrelated directions" in unusable["mouthSmileLeft"]


def test_a_rig_in_another_unit_is_read_from_its_file(tmp_path: Path) -> None:
    face = base()
    names = ["jawOpen", "mouthSmileLeft", "mouthSmileRight", "eyeBlinkLeft", "eyeBlinkRight", "mouthPucker"]
    points = face.vertices.astype("<f4")
    offsets = [100.0 * face.shapes[face.shape_names.index(name)].astype("<f4") for name in names]
    builder = Builder()
    primitive = builder.primitive(points, face.triangles.astype("<u4").reshape(-1, 1).ravel(), tuple(offsets))
    builder.node(mesh=builder.mesh(primitive, names=names))
    path = builder.write(tmp_path / "a.glb")
    assert read_rig(path).unusable == {}
    assert len(read_rig(path, align=False).unusable) == len(names)
    assert "divided by 100" in imported(read_rig(path)).summary["warnings"][0]


def test_empty_shapes_are_not_a_matter_of_names() -> None:
    rig = morph_mesh()
    with pytest.raises(FacePoserError, match="has 52 of ARKit's 52 shapes, but none of them moves a vertex"):
        imported(changed(rig, lambda offsets: 0.0 * offsets))
    with pytest.raises(FacePoserError, match="those of VRoid Studio, which are not ARKit's"):
        imported(replace(rig, targets={f"Fcl_MTH_{i}": offsets for i, offsets in enumerate(rig.targets.values())}))


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
    assert re.match(r"1 mesh has 100 times the size of the neutral mesh", scaled.summary["warnings"][0])
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
