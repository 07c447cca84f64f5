"""OBJ files come with a library of materials and textures that other programs read, and that overwrite no picture."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy.spatial import cKDTree

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.mesh_sequence import open_sequence
from faceposer.geometry.polygon_mesh import Group, MorphMesh
from faceposer.interchange.meshes import foreign_library, write_posed_obj, write_sequence
from faceposer.interchange.obj_materials import materials_of
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.performance import Performance
from faceposer.progress import Progress
from faceposer.training.rigs import RigOptions, character_from_morphs
from tests.training.faces import morph_mesh

LONG = "x" * 300


def picture(colour: tuple[int, int, int], form: str = "PNG") -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (4, 4), colour).save(file, form)
    return file.getvalue()


def by_material(path: Path) -> dict[str, trimesh.Trimesh]:
    """Return the pieces that trimesh reads from ``path``, by the name of their material."""
    if int(trimesh.__version__.split(".")[0]) < 5:
        pytest.skip("this version of trimesh may not keep the names of materials")
    read = trimesh.load(path, process=False)
    pieces = read.geometry.values() if isinstance(read, trimesh.Scene) else [read]
    return {piece.visual.material.name: piece for piece in pieces}


def mean_colour(image: Image.Image) -> np.ndarray:
    return np.asarray(image.convert("RGB"), dtype=float).mean(axis=(0, 1))


@pytest.mark.parametrize("stem", ["smile", "v1.2 smile", "Lächeln"])
def test_another_program_finds_every_texture(stem: str, model: FaceModel, tmp_path: Path) -> None:
    path, character = tmp_path / f"{stem}.obj", model.character
    pose = model.coefficients_of({"jawOpen": 0.5})
    write_posed_obj(path, model, pose)
    pieces = by_material(path)
    assert pieces.keys() == {"skin", "eye", "teeth", "gums", "gums_throat", "tongue", "lashes"}
    for name, piece in pieces.items():
        key = name.removeprefix("gums_")
        with Image.open(io.BytesIO(character.textures[key])) as expected:
            np.testing.assert_allclose(mean_colour(piece.visual.material.image), mean_colour(expected), atol=0.5)
        assert len(piece.visual.uv) == len(piece.vertices)
    skin = character.part("skin")
    count = np.diff(character.part_triangles(skin))[0]
    assert len(pieces["skin"].faces) == count
    theirs = pieces["skin"].vertices[pieces["skin"].faces]
    ours = model.surface(pose)[character.triangles[:count]]
    np.testing.assert_allclose(np.sort(theirs.reshape(-1, 3), axis=0), np.sort(ours.reshape(-1, 3), axis=0), atol=1e-4)


def test_texture_coordinates_lie_where_the_vertices_do(low: FaceModel, tmp_path: Path) -> None:
    write_posed_obj(tmp_path / "a.obj", low, low.neutral(), contact=False)
    character, piece = low.character, by_material(tmp_path / "a.obj")["skin"]
    first, last = character.part_triangles(character.part("skin"))
    corners, uvs = character.triangles[first:last].ravel(), character.triangle_uvs[first:last].ravel()
    near = cKDTree(character.vertices[corners]).query_ball_point(piece.vertices, 1e-4)
    for here, uv in zip(near, piece.visual.uv, strict=True):
        assert np.abs(character.uv[uvs[here]] - uv).max(axis=1).min() < 1e-5


def test_our_own_reader_finds_the_mesh_unchanged(model: FaceModel, tmp_path: Path) -> None:
    pose = model.coefficients_of({"mouthSmileLeft": 1.0})
    write_posed_obj(tmp_path / "with.obj", model, pose)
    write_posed_obj(tmp_path / "without.obj", model, pose, materials=False)
    first, second = read_mesh(tmp_path / "with.obj"), read_mesh(tmp_path / "without.obj")
    for name in ("vertices", "polygons", "uv", "polygon_uvs", "normals"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert first.groups == second.groups
    assert [(group.name, group.polygons) for group in first.groups] == [
        (part.name, part.polygons) for part in model.character.parts
    ]
    assert not list(tmp_path.glob("without*.*[!j]"))
    assert "mtllib" not in (tmp_path / "without.obj").read_text()


def test_lashes_are_transparent_and_plain_materials_have_colours(low: FaceModel, model: FaceModel) -> None:
    lashes = next(m for m in materials_of(model.character).materials if m.name == "lashes")
    assert lashes.transparent
    bare = replace(low.character, textures={})
    plain = {material.name: material for material in materials_of(bare).materials}
    assert plain["tongue"].diffuse[0] > plain["tongue"].diffuse[1]
    assert plain["eye"].exponent > plain["skin"].exponent
    assert plain.keys() == {part.material for part in bare.parts}


def imported(textures: dict[str, bytes], groups: tuple[Group, ...] | None = None) -> Character:
    rig = morph_mesh()
    mesh = rig.mesh if groups is None else replace(rig.mesh, groups=groups)
    return character_from_morphs(MorphMesh(mesh, rig.targets, textures), "me.glb", RigOptions("me", "Me"), Progress())


def test_an_imported_character_keeps_the_materials_of_its_file(tmp_path: Path) -> None:
    groups = tuple(replace(group, material=f"M {group.name}") for group in morph_mesh().mesh.groups)
    pictures = {f"M {name}": picture(colour, form) for name, colour, form in TEXTURED}
    character = imported(pictures, groups)
    model = build_face_model(character)
    write_posed_obj(tmp_path / "a.obj", model, model.neutral())
    assert read_mesh(tmp_path / "a.obj").groups == groups
    pieces = by_material(tmp_path / "a.obj")
    assert pieces.keys() == {group.material for group in groups}
    for name, colour, form in TEXTURED:
        material = pieces[f"M {name}"].visual.material
        np.testing.assert_allclose(mean_colour(material.image), colour, atol=3)
        assert (tmp_path / f"a_M_{name}.{'png' if form == 'PNG' else 'jpg'}").read_bytes() == pictures[f"M {name}"]
    # Eyes without a picture are drawn with the program's own, for which the file has no coordinates.
    assert "eye" in character.textures
    assert pieces["M eye_left"].visual.material.image is None
    assert len([*tmp_path.iterdir()]) == 4


TEXTURED = (("skin", (200, 100, 50), "JPEG"), ("tongue", (180, 40, 60), "PNG"))


def test_a_file_without_materials_gets_none(tmp_path: Path) -> None:
    groups = tuple(replace(group, material="") for group in morph_mesh().mesh.groups)
    model = build_face_model(imported({}, groups))
    write_posed_obj(tmp_path / "a.obj", model, model.neutral())
    assert [*tmp_path.iterdir()] == [tmp_path / "a.obj"]
    assert read_mesh(tmp_path / "a.obj").groups == groups


def test_pictures_of_other_content_are_never_overwritten(low: FaceModel, tmp_path: Path) -> None:
    path, painted = tmp_path / "a.obj", tmp_path / "a_skin.jpg"
    write_posed_obj(path, low, low.neutral())
    names = sorted(file.name for file in tmp_path.iterdir())
    written = painted.stat().st_mtime_ns
    write_posed_obj(path, low, low.coefficients_of({"jawOpen": 1.0}))
    assert sorted(file.name for file in tmp_path.iterdir()) == names
    assert painted.stat().st_mtime_ns == written, "what is there already is not written again"
    painted.write_bytes(b"painted over")
    (tmp_path / "a_eye.jpg").unlink()
    (tmp_path / "a_eye.jpg").mkdir()
    for _ in range(2):
        write_posed_obj(path, low, low.neutral())
        assert painted.read_bytes() == b"painted over"
        assert sorted(file.name for file in tmp_path.iterdir()) == sorted([*names, "a_eye_2.jpg", "a_skin_2.jpg"])
    assert (tmp_path / "a_skin_2.jpg").read_bytes() == low.character.textures["skin"]
    assert "map_Kd a_skin_2.jpg\n" in (tmp_path / "a.mtl").read_text()


def test_the_library_is_replaced_and_known_if_it_is_foreign(low: FaceModel, tmp_path: Path) -> None:
    path, library = tmp_path / "a.obj", tmp_path / "a.mtl"
    assert foreign_library(path) == ()
    library.write_text("newmtl theirs\n")
    assert foreign_library(path) == (library,)
    write_posed_obj(path, low, low.neutral())
    assert library.read_text().startswith("# Face Poser: Low-poly head.")
    assert foreign_library(path) == ()


def test_all_files_are_written_or_none(low: FaceModel, tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("before")
    (tmp_path / "a.obj").mkdir()
    with pytest.raises(FacePoserError, match=r"The mesh '.*a\.obj' cannot be written"):
        write_posed_obj(tmp_path / "a.obj", low, low.neutral())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mtl", "a.obj"]
    assert (tmp_path / "a.mtl").read_text() == "before"
    with pytest.raises(FacePoserError, match="cannot be written"):
        write_posed_obj(tmp_path / "none" / "a.obj", low, low.neutral())


def test_a_sequence_shares_one_library(low: FaceModel, performance: Performance, tmp_path: Path) -> None:
    meshes = write_sequence(tmp_path / "v1.2 take", low, performance)
    names = {path.name for path in (tmp_path / "v1.2 take").iterdir()} - {mesh.name for mesh in meshes}
    assert len(meshes) == len(performance)
    assert names == {
        "v1.2 take.mtl",
        *(f"v1.2 take_{key}.jpg" for key in ("skin", "eye", "tongue", "gums_throat", "teeth")),
    }
    for mesh in (meshes[0], meshes[-1]):
        assert "\nmtllib v1.2 take.mtl\n" in mesh.read_text()
        assert by_material(mesh)["skin"].visual.material.image.size[0] > 100
    read = open_sequence(tmp_path / "v1.2 take")
    assert len(read) == len(performance), "a folder of examples is still one"
    bare = write_sequence(tmp_path / "bare", low, Performance(performance.coefficients[:2], 24.0), materials=False)
    assert sorted((tmp_path / "bare").iterdir()) == bare


def test_names_that_no_line_can_hold_are_replaced(low: FaceModel, tmp_path: Path) -> None:
    path = tmp_path / "a\nnewmtl b.obj"
    write_posed_obj(path, low, low.neutral())
    assert "\nmtllib a_newmtl b.mtl\n" in path.read_text()
    assert (tmp_path / "a_newmtl b.mtl").is_file()
    assert by_material(path)["skin"].visual.material.image is not None
    groups = tuple(replace(group, material=f"{group.name}\nv 0 0 0\ud800{LONG}") for group in morph_mesh().mesh.groups)
    character = imported({groups[0].material: picture((9, 99, 199))}, groups)
    rig = build_face_model(replace(character, title="a\ud800"))
    write_posed_obj(tmp_path / "b.obj", rig, rig.neutral())
    assert len(read_mesh(tmp_path / "b.obj").vertices) == len(morph_mesh().mesh.vertices)
    assert by_material(tmp_path / "b.obj")[f"skin_v 0 0 0_{LONG}"].visual.material.image is not None
