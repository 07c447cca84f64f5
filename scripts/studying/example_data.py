"""Example meshes of the number and size of those in the paper, generated from a rig and real performances."""

import os
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from faceposer.geometry.mesh_sequence import write_frames
from faceposer.geometry.obj_io import write_obj
from faceposer.model.character_file import load_character
from faceposer.training.capture import read_capture

Array = NDArray[np.float64]
TAKES = ("alex_rom_3.csv", "alex_rom_4.csv")
# Approximate size in bytes of a vertex in an OBJ file, with its share of the faces.
_OBJ_BYTES = 70
NOISE_CM = 0.002
_TURN_DEGREES, _SHIFT_CM = 6.0, 2.0


@dataclass(frozen=True, eq=False)
class ExampleData:
    """A rig and its motion.

    Attributes:
        vertices: Neutral face, shape (N, 3).
        polygons: Shape (F, 4).
        shapes: Offsets, shape (S, N, 3).
        weights: Weights of the shapes in each frame, shape (F, S).
    """

    vertices: Array
    polygons: NDArray[np.int32]
    shapes: Array
    weights: Array

    def frames(self) -> Iterator[Array]:
        """Yield the vertices of each frame, (N, 3): posed, with noise and a random rigid motion of the head."""
        rng = np.random.default_rng(0)
        flat = self.shapes.reshape(len(self.shapes), -1)
        for weights in self.weights:
            face = self.vertices + (weights @ flat).reshape(-1, 3)
            face += NOISE_CM * rng.standard_normal(face.shape)
            turn = Rotation.from_rotvec(np.deg2rad(_TURN_DEGREES) * rng.standard_normal(3)).as_matrix()
            yield face @ turn.T + _SHIFT_CM * rng.standard_normal(3)

    def exact_basis(self, scale: Array, count: int, centred: bool) -> tuple[Array, Array, float]:
        """Return the exact principal directions, (3 N, k), energies, (k,), and total energy, from the rig's weights.

        Isotropic noise does not change the directions; the energies are without noise.

        Args:
            scale: Factor on the displacement of each vertex, shape (N,).
            count: Number of directions k.
            centred: True to centre at the mean instead of the neutral face.
        """
        weights = self.weights - self.weights.mean(axis=0) if centred else self.weights
        flat = (self.shapes * scale[:, None]).reshape(len(self.shapes), -1)
        gram = flat @ flat.T
        moments = weights.T @ weights / len(weights)
        values, axes = np.linalg.eigh(moments)
        root = axes * np.sqrt(values.clip(0.0))
        energies, turned = np.linalg.eigh(root.T @ gram @ root)
        energies, turned = energies[::-1][:count], turned[:, ::-1][:, :count]
        basis = np.linalg.qr(flat.T @ (root @ turned))[0]
        return basis, energies, float(np.trace(gram @ moments))


def example_data(n_frames: int, n_vertices: int) -> ExampleData:
    """Return the built-in man, cut to ``n_vertices``, moved by the frames of the real takes in a cycle."""
    folder = os.environ.get("FACEPOSER_CAPTURES")
    if not folder:
        sys.exit("Set FACEPOSER_CAPTURES to the folder with the capture files.")
    man = load_character("man")
    least = man.part("skin").vertices[1]
    if not least <= n_vertices <= len(man.vertices):
        sys.exit(f"The number of vertices must be {least} to {len(man.vertices)}, not {n_vertices}.")
    takes = [read_capture(Path(folder) / take).with_shapes(man.shape_names).relative_to_rest() for take in TAKES]
    weights = np.concatenate([take.weights for take in takes])
    weights = weights[np.arange(n_frames) % len(weights)]
    polygons = man.polygons[(man.polygons < n_vertices).all(axis=1)]
    return ExampleData(
        man.vertices[:n_vertices].astype(np.float64), polygons, man.shapes[:, :n_vertices].astype(np.float64), weights
    )


def write_examples(data: ExampleData, folder: Path, obj: bool) -> dict[str, Path]:
    """Write the frames as one ``.npz`` next to the neutral mesh and, if ``obj``, also as a folder of OBJ files.

    Existing files are kept. Exits if there is not enough space on the disk.
    """
    count, width = len(data.weights), len(data.vertices)
    paths = {"neutral": folder / "neutral.obj", "npz": folder / "frames.npz"} | ({"obj": folder / "obj"} if obj else {})
    # One copy as arrays, and one written by the training.
    needed = 2 * 12 * count * width + (count * width * _OBJ_BYTES if obj else 0)
    if not all(path.exists() for path in paths.values()) and shutil.disk_usage(folder).free < 1.1 * needed:
        sys.exit(f"'{folder}' needs {1.1 * needed / 1e9:.1f} GB of free space; choose another folder with --folder.")
    write_obj(paths["neutral"], data.vertices, data.polygons)
    if not paths["npz"].exists():
        part = folder / "frames.part"
        write_frames(part, data.frames(), count, width)
        part.replace(paths["npz"])
    if obj and not paths["obj"].exists():
        part = folder / "obj.part"
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir()
        faces = paths["neutral"].read_text().partition("\nf ")[2]
        (part / "neutral.obj").write_bytes(paths["neutral"].read_bytes())
        for i, frame in enumerate(data.frames()):
            rows = "\n".join(map("v {:.6f} {:.6f} {:.6f}".format, *frame.T.tolist()))
            (part / f"take_{i + 1}.obj").write_text(f"{rows}\nf {faces}")
        part.replace(paths["obj"])
    return paths
