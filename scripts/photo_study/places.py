"""Places of the landmarks on the skin, learned from drawings of heads."""

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.geometry.picking import SurfacePoints
from faceposer.identity.editing import HeadEditor, textures_of
from faceposer.identity.photos.face_places import INNER_LIPS
from faceposer.landmarks.on_meshes import find_mesh_landmarks
from faceposer.landmarks.painting import painted_parts
from faceposer.landmarks.reference import reference
from faceposer.model.character_file import load_character

Array = NDArray[np.float64]

#: Opening of the jaw that separates the points of the upper lip from those of the lower one.
_OPEN = 0.35


def learn_places(n_heads: int) -> SurfacePoints:
    """Return the places of the 468 landmarks on the triangles of the built-in heads, from ``n_heads`` random heads."""
    editor = HeadEditor(load_character("man"))
    base = editor.with_head(editor.average)
    n = editor.template.n_skin
    skin = np.flatnonzero((base.triangles < n).all(axis=1))
    opening = base.shapes[base.shape_names.index("jawOpen")].astype(np.float64) * _OPEN
    mirror = reference().mirror
    lips = np.zeros(len(mirror), dtype=bool)
    lips[list(INNER_LIPS)] = True
    places = np.zeros((2, len(mirror), 3))
    for is_open in (False, True):
        shift = opening if is_open else 0.0
        target = base.vertices.astype(np.float64) + shift
        found_places = []
        for seed in range(n_heads):
            identity = editor.random(seed, spread=0.7)
            vertices = editor.maker.head(editor.skin(identity)).vertices + shift
            textures = {**base.textures, **textures_of(editor.random_texture(seed, identity))}
            mesh = painted_parts(vertices, base.polygons, base.uv, base.polygon_uvs, base.parts, textures)
            found = find_mesh_landmarks(mesh, Similarity(np.eye(3), np.zeros(3), np.array(1.0)))
            if found is None or np.isnan(found.points).any():
                continue
            on_skin, _ = NearestSurface(vertices, base.triangles, skin).points(found.points)
            found_places.append(on_skin.positions(target, base.triangles))
        mean = np.median(found_places, axis=0)
        print(
            f"{'open' if is_open else 'closed'}: {len(found_places)} heads, scatter "
            f"{10 * np.linalg.norm(np.array(found_places) - mean, axis=2).mean():.2f} mm"
        )
        mean = (mean + mean[mirror] * np.array([-1.0, 1.0, 1.0])) / 2
        places[int(is_open)] = mean
    closed, _ = NearestSurface(base.vertices.astype(np.float64), base.triangles, skin).points(places[0])
    parted, _ = NearestSurface(base.vertices + opening, base.triangles, skin).points(places[1])
    faces = np.where(lips, parted.faces, closed.faces)
    return SurfacePoints(faces, np.where(lips[:, None], parted.barycentric, closed.barycentric))
