"""Motion of markers moves a mesh: the head's motion out, other proportions in, gaps and odd maps seen to."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from faceposer.errors import FacePoserError
from faceposer.geometry.marker_io import MarkerMotion
from faceposer.geometry.marker_map import FORMAT, MarkerMap, read_marker_map
from faceposer.geometry.marker_meshes import meshes_from_markers
from faceposer.geometry.mesh import TriangleMesh
from faceposer.geometry.picking import SurfacePoints


def dome(n: int = 17) -> TriangleMesh:
    """A bowl of a face: 12 wide, 7 deep."""
    u = np.linspace(-6.0, 6.0, n)
    x, y = np.meshgrid(u, u)
    vertices = np.stack([x.ravel(), 1.3 * y.ravel(), (6.0 - 0.1 * (x**2 + y**2)).ravel()], axis=1)
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    return TriangleMesh(
        vertices, np.concatenate([np.stack([a, a + 1, a + n + 1], 1), np.stack([a, a + n + 1, a + n], 1)])
    )


MESH = dome()
# Four on bone at the top, eight that move.
PLACES = np.array(
    [17 * 16 + 2, 17 * 16 + 8, 17 * 16 + 14, 17 * 13 + 8, *(17 * r + c for r in (3, 7) for c in (2, 6, 10, 14))]
)
NAMES = tuple(f"M{i}" for i in range(len(PLACES)))
MAP = MarkerMap({name: int(v) for name, v in zip(NAMES, PLACES, strict=True)}, NAMES[:4])


def performance(n_frames: int = 30, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return displacements on the mesh, (F, M, 3), and where the markers are, ten times larger and turned."""
    rng = np.random.default_rng(seed)
    moves = np.zeros((n_frames, len(PLACES), 3))
    moves[1:, 4:] = rng.normal(scale=0.4, size=(n_frames - 1, len(PLACES) - 4, 3))
    turns = Rotation.random(n_frames, random_state=rng).as_matrix()
    shifts = rng.normal(scale=300.0, size=(n_frames, 1, 3))
    return moves, 10.0 * (MESH.vertices[PLACES] + moves) @ np.swapaxes(turns, 1, 2) + shifts


@pytest.mark.parametrize("fixed", [NAMES[:4], ()])
def test_the_heads_motion_is_taken_out_and_markers_are_followed(fixed: tuple[str, ...]) -> None:
    moves, positions = performance()
    result = meshes_from_markers(MarkerMotion(NAMES, positions), MarkerMap(MAP.places, fixed), *meshed())
    assert result.report.held == NAMES[:4]
    assert result.report.used == tuple(range(30))
    assert result.report.left_out == 0
    assert result.report.scale == pytest.approx(0.1)
    assert result.report.misfit == pytest.approx(0.0, abs=1e-9)
    meshes = np.array(list(result))
    np.testing.assert_allclose(meshes[0], MESH.vertices, atol=1e-9)
    np.testing.assert_allclose(meshes[:, PLACES] - MESH.vertices[PLACES], moves, atol=1e-8)
    assert len(result) == 30
    np.testing.assert_array_equal(next(iter(result)), meshes[0])


def meshed() -> tuple[np.ndarray, np.ndarray]:
    return np.asarray(MESH.vertices), np.asarray(MESH.triangles)


def test_a_face_of_other_proportions_keeps_its_own() -> None:
    moves, positions = performance()
    narrow = MESH.vertices * [0.8, 1.1, 1.0]
    result = meshes_from_markers(MarkerMotion(NAMES, positions), MAP, narrow, MESH.triangles)
    assert result.report.misfit > 0.1
    meshes = np.array(list(result))
    np.testing.assert_allclose(meshes[0], narrow, atol=1e-9)
    scale = 10.0 * result.report.scale
    np.testing.assert_allclose(meshes[:, PLACES] - narrow[PLACES], scale * moves, atol=0.05)


def test_gaps_are_filled_completed_or_left_out_and_reported() -> None:
    _, positions = performance(60)
    positions = np.repeat(positions[:1], 60, axis=0)
    positions[2:5, 6] = np.nan
    positions[20:40, 7] = np.nan
    positions[45:, 5:10] = np.nan
    positions[50:, 0:2] = np.nan
    extra = np.concatenate([positions, positions[:, :1] + 1.0], axis=1)
    result = meshes_from_markers(MarkerMotion((*NAMES, "Ear"), extra), MAP, *meshed())
    report = result.report
    assert report.n_frames == 60
    assert report.gaps_filled == 3
    assert report.completed == 20
    assert report.used == tuple(range(45))
    assert report.left_out == 15
    assert report.unused == ("Ear",)
    for mesh in result:
        np.testing.assert_allclose(mesh, MESH.vertices, atol=1e-7)


def test_the_neutral_frame_is_the_first_complete_one_or_the_maps() -> None:
    _, positions = performance()
    positions[0, 5] = np.nan
    result = meshes_from_markers(MarkerMotion(NAMES, positions), MAP, *meshed())
    assert result.report.neutral_frame == 1
    chosen = MarkerMap(MAP.places, MAP.fixed, neutral_frame=7)
    result = meshes_from_markers(MarkerMotion(NAMES, positions), chosen, *meshed())
    assert result.report.neutral_frame == 7
    np.testing.assert_allclose(np.array(list(result))[7], MESH.vertices, atol=1e-9)


def test_places_are_vertices_features_or_positions(tmp_path: Path) -> None:
    path = tmp_path / "map.json"
    inside = MESH.vertices[MESH.triangles[40]].mean(axis=0)
    data = {
        "format": FORMAT,
        "version": 1,
        "markers": {"A": {"vertex": 3}, "B": {"feature": "8.3"}, "C": {"position": [*inside[:2], inside[2] + 0.2]}},
        "fixed": ["A", "B", "X"],
        "neutral_frame": 4,
    }
    path.write_text(json.dumps(data))
    found = read_marker_map(path)
    assert found.fixed == ("A", "B", "X")
    assert found.neutral_frame == 4
    points = found.surface_points(MESH.vertices, MESH.triangles, {"8.3": 50})
    assert isinstance(points, SurfacePoints)
    places = points.positions(MESH.vertices, MESH.triangles)
    np.testing.assert_allclose(places[:2], MESH.vertices[[3, 50]])
    np.testing.assert_allclose(places[2], inside, atol=0.1)


def test_bad_maps_are_refused_by_place(tmp_path: Path) -> None:
    good = {"format": FORMAT, "version": 1, "markers": {"A": {"vertex": 3}}}
    texts = {
        'no "format"': json.dumps({**good, "format": "other"}),
        'no "format": ': "[]",
        "version is 2": json.dumps({**good, "version": 2}),
        "markers must be an object with a place": json.dumps({**good, "markers": []}),
        "markers must be an object with a place for each marker, not {}": json.dumps({**good, "markers": {}}),
        "markers.A.vertex must be a whole number, not 1.5": json.dumps({**good, "markers": {"A": {"vertex": 1.5}}}),
        "markers.B.vertex must be a whole number, not true": json.dumps({**good, "markers": {"B": {"vertex": True}}}),
        "markers.C.position must be a list of 3 numbers, not 2": json.dumps(
            {**good, "markers": {"C": {"position": [1, 2]}}}
        ),
        'markers.D must be {"vertex": 12}': json.dumps({**good, "markers": {"D": 7}}),
        r"markers.E.position\[0\] must be a number .*, not NaN": json.dumps(good).replace(
            '"A": {"vertex": 3}', '"E": {"position": [NaN, 0, 0]}'
        ),
        r"markers.F.position\[0\] must be a number": json.dumps(
            {**good, "markers": {"F": {"position": [10**400, 0, 0]}}}
        ),
        "fixed must be a list of texts": json.dumps({**good, "fixed": "A"}),
        "fixed has fewer": json.dumps({**good, "fixed": ["A", "B", "A"]}),
        "neutral_frame must be the number of a frame": json.dumps({**good, "neutral_frame": -1}),
        'the key "A" occurs twice': json.dumps(good).replace(
            '"A": {"vertex": 3}', '"A": {"vertex": 3}, "A": {"vertex": 4}'
        ),
        "not valid JSON at line 2": '{\n"format" 3}',
        "nested too deeply": "[" * 100_000,
    }
    for i, (what, text) in enumerate(texts.items()):
        path = tmp_path / f"{i}.json"
        path.write_text(text)
        with pytest.raises(FacePoserError, match=what) as caught:
            read_marker_map(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe")
    for name in ("binary.json", "gone.json"):
        with pytest.raises(FacePoserError, match="cannot be read"):
            read_marker_map(tmp_path / name)


def test_maps_that_do_not_fit_are_refused() -> None:
    _, positions = performance()
    motion = MarkerMotion(NAMES, positions)
    lacking = positions.copy()
    lacking[:, 5] = np.nan
    mirrored = [
        *range(17 * 16 + 14, 17 * 16 + 1, -6),
        17 * 13 + 8,
        *(17 * r + c for r in (3, 7) for c in (14, 10, 6, 2)),
    ]
    cases = [
        ("Nose, which is not in the motion", motion, MarkerMap({"Nose": 1})),
        ("Chin, which is not in the motion", motion, MarkerMap(MAP.places, ("M0", "M1", "Chin"))),
        ("marker M0 is at vertex 289, but the mesh has 289", motion, MarkerMap({"M0": 289})),
        ("feature point 8.3, which the mesh does not have", motion, MarkerMap({"M0": "8.3"})),
        (r"marker M0 at \(0, 0, 90\) is far", motion, MarkerMap({"M0": (0.0, 0.0, 90.0)})),
        ("two handles are at the same place", motion, MarkerMap({"M0": 3, "M1": 3})),
        ("neutral frame of .* is 30", motion, MarkerMap(MAP.places, neutral_frame=30)),
        ("neutral frame 3 of .* lacks M5", MarkerMotion(NAMES, lacking), MarkerMap(MAP.places, neutral_frame=3)),
        ("No frame has all markers of .*; remove M5, which is missing most often", MarkerMotion(NAMES, lacking), MAP),
        ("fewer than three", motion, MarkerMap({"M0": 3, "M8": 40})),
        ("do not match", motion, MarkerMap(dict(zip(NAMES, PLACES[::-1].tolist(), strict=True)))),
        ("do not match .*root mean square", motion, MarkerMap(dict(zip(NAMES, mirrored, strict=True)))),
    ]
    for what, moving, marker_map in cases:
        with pytest.raises(FacePoserError, match=what) as caught:
            meshes_from_markers(moving, marker_map, *meshed())
        assert "\n" not in str(caught.value)
