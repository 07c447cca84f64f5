"""The table of export formats: what the dialog, the command and the Python interface know of each.

A new format is a module that writes it and a row here. What writes is imported when it is used: some of it needs
libraries that the window does not wait for at its start, and pictures need OpenGL, which meshes and weights do not.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import check_output
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.progress import Progress
from faceposer.render.ffmpeg import missing_ffmpeg
from faceposer.render.options import OutputOptions

if TYPE_CHECKING:
    from faceposer.render.offscreen import Context

#: Stage of the progress of an export.
WRITING = "Writing"

Motion = NDArray[np.float64] | Performance


@dataclass(frozen=True)
class Output:
    """One export.

    Attributes:
        path: The file, or the folder of a sequence.
        model: The face.
        motion: A pose, shape (r,), or a performance.
        options: How it is written.
        ctx: What pictures are drawn with; a context of their own if None.
        progress: Reported to where writing is one long step.
    """

    path: Path
    model: FaceModel
    motion: Motion
    options: OutputOptions
    ctx: "Context | None" = None
    progress: Progress = field(default_factory=Progress)


@dataclass(frozen=True)
class Format:
    """A file format of posed faces.

    Attributes:
        suffix: Of its files, with the dot, in small letters.
        name: What it is called.
        purpose: What a file holds and what it is for.
        holds: What one file holds: "pose" for a single pose; "either" for a pose or a performance; "film" for what
            moves in any case, a lone pose by turning round.
        write: Writes atomically, and yields the share that is done; closing the iterator ends it and leaves nothing.
        sequence: Likewise, writes a performance as a new folder with a file for each frame; None where there is no way.
        drawn: Whether files are pictures, to which size, view and shading apply.
        contact: Whether what is written can show the contact step.
        transparent: Whether pictures can leave the background out.
        materials: Whether materials and textures are written as files beside it.
        missing: Returns why the format cannot be written on this machine, or "".
    """

    suffix: str
    name: str
    purpose: str
    holds: Literal["pose", "either", "film"]
    write: Callable[[Output], Generator[float, None, None]]
    sequence: Callable[[Output], Generator[float, None, None]] | None = None
    drawn: bool = False
    contact: bool = True
    transparent: bool = False
    materials: bool = False
    missing: Callable[[], str] = lambda: ""

    @property
    def animated(self) -> bool:
        """Whether one file can hold a performance."""
        return self.holds in ("either", "film")


#: All formats by suffix, in the order in which they are offered.
FORMATS: dict[str, Format] = {}


def register(form: Format) -> None:
    """Offer ``form`` in the window, on the command line and in Python.

    Raises:
        ValueError: If its suffix is taken, or is none.
    """
    if form.suffix in FORMATS or not form.suffix.startswith(".") or form.suffix != form.suffix.lower():
        raise ValueError(f"'{form.suffix}' is no new suffix of a format")
    FORMATS[form.suffix] = form


def suffixes(kind: Callable[[Format], bool] = lambda _: True) -> tuple[str, ...]:
    """Return the suffixes of the formats for which ``kind`` holds."""
    return tuple(form.suffix for form in FORMATS.values() if kind(form))


def offered(kind: Callable[[Format], bool] = lambda _: True) -> tuple[str, ...]:
    """Return the suffixes of the formats for which ``kind`` holds and that can be written on this machine."""
    return suffixes(lambda form: kind(form) and not form.missing())


def format_of(path: Path) -> Format:
    """Return the format that the suffix of ``path`` names.

    Raises:
        FacePoserError: If it names none.
    """
    try:
        return FORMATS[path.suffix.lower()]
    except KeyError:
        raise FacePoserError(f"'{path}' must end in one of {', '.join(offered())}.") from None


def check_writable(path: Path, kind: Callable[[Format], bool] = lambda _: True) -> Format:
    """Return the format of the output ``path``, one for which ``kind`` holds, before any work is done for it.

    Raises:
        FacePoserError: If the suffix names none of these, the format cannot be written on this machine, or the file
            could not be written.
    """
    named = FORMATS.get(path.suffix.lower())
    if named is None or not kind(named):
        raise FacePoserError(f"The output '{path}' must end in one of {', '.join(offered(kind))}.")
    if reason := named.missing():
        raise FacePoserError(reason)
    check_output(path, named.suffix)
    return named


def write(
    path: Path,
    model: FaceModel,
    motion: Motion,
    options: OutputOptions | None = None,
    progress: Progress | None = None,
) -> None:
    """Write a face in the format that the suffix of ``path`` names, atomically.

    Args:
        path: Ends in one of ``FORMATS``.
        model: The face.
        motion: A pose, shape (r,), or a performance.
        options: How it is written.
        progress: Reported to; cancelling it leaves no file.

    Raises:
        FacePoserError: If the suffix is none of these or its files hold no performance, the file cannot be written, or
            pictures are wanted where there is no OpenGL or no ffmpeg.
    """
    progress = progress or Progress()
    for share in write_steps(Output(path, model, motion, options or OutputOptions(), progress=progress)):
        progress.at(WRITING, share)


def write_steps(output: Output) -> Generator[float, None, None]:
    """Write ``output`` as ``write`` does, step by step; yields the share that is done after each.

    Closing the iterator before its end leaves no file.

    Raises:
        FacePoserError: As for ``write``.
    """
    form = format_of(output.path)
    if form.holds == "pose" and isinstance(output.motion, Performance):
        instead = "choose a frame, or write a .gif" if form.drawn else "write a folder of them instead"
        verb = "shows" if form.drawn else "holds"
        raise FacePoserError(f"'{output.path}' {verb} one pose and not {len(output.motion)}; {instead}.")
    _check_options(form, output.options)
    yield from form.write(output)


def write_sequence_steps(output: Output, suffix: str) -> Generator[float, None, None]:
    """Write the performance of ``output`` as a folder of files that end in ``suffix``, step by step.

    Raises:
        FacePoserError: If the format has no sequences, or the folder cannot be written.
    """
    form = FORMATS[suffix]
    if form.sequence is None or not isinstance(output.motion, Performance):
        raise FacePoserError(f"{form.name} has no sequences of files; write an animation in another format.")
    _check_options(form, output.options)
    yield from form.sequence(output)


def _check_options(form: Format, options: OutputOptions) -> None:
    if reason := form.missing():
        raise FacePoserError(reason)
    if options.transparent and not form.transparent:
        kinds = " or ".join(suffixes(lambda other: other.transparent))
        raise FacePoserError(f"{form.name} cannot leave the background out; write {kinds} instead.")


def _glb(output: Output) -> Generator[float, None, None]:
    from faceposer.interchange.glb import write_glb

    write_glb(output.path, output.model, output.motion, output.progress)
    yield 1.0


def _posed_obj(output: Output) -> Generator[float, None, None]:
    from faceposer.interchange.meshes import write_posed_obj

    options = output.options
    write_posed_obj(output.path, output.model, _pose(output), options.contact, options.materials)
    yield 1.0


def _posed_ply(output: Output) -> Generator[float, None, None]:
    from faceposer.interchange.meshes import write_posed_ply

    write_posed_ply(output.path, output.model, _pose(output), output.options.contact)
    yield 1.0


def _obj_sequence(output: Output) -> Generator[float, None, None]:
    from faceposer.interchange.meshes import sequence_steps

    options = output.options
    return sequence_steps(output.path, output.model, _performance(output), "obj", options.contact, options.materials)


def _ply_sequence(output: Output) -> Generator[float, None, None]:
    from faceposer.interchange.meshes import sequence_steps

    return sequence_steps(output.path, output.model, _performance(output), "ply", output.options.contact)


def _live_link(output: Output) -> Generator[float, None, None]:
    from faceposer.interchange.live_link import write_live_link

    motion = output.motion
    whole = motion if isinstance(motion, Performance) else Performance(motion[None], _ONE_FRAME_RATE)
    write_live_link(output.path, output.model, whole)
    yield 1.0


def _weights(output: Output) -> Generator[float, None, None]:
    from faceposer.interchange.weights_json import write_weights

    write_weights(output.path, output.model, output.motion)
    yield 1.0


def _picture(output: Output) -> Generator[float, None, None]:
    from faceposer.render.shots import picture_steps

    yield from picture_steps(output.path, output.model, _pose(output), output.options, output.ctx)


def _picture_sequence(output: Output) -> Generator[float, None, None]:
    from faceposer.render.shots import picture_sequence_steps

    yield from picture_sequence_steps(output.path, output.model, _performance(output), output.options, output.ctx)


def _gif(output: Output) -> Generator[float, None, None]:
    from faceposer.render.shots import gif_steps

    yield from gif_steps(output.path, output.model, output.motion, output.options, output.ctx)


def _mp4(output: Output) -> Generator[float, None, None]:
    from faceposer.render.shots import mp4_steps

    yield from mp4_steps(output.path, output.model, output.motion, output.options, output.ctx)


def _pose(output: Output) -> NDArray[np.float64]:
    assert not isinstance(output.motion, Performance)
    return output.motion


def _performance(output: Output) -> Performance:
    assert isinstance(output.motion, Performance)
    return output.motion


_ONE_FRAME_RATE = 30.0

for _format in (
    Format(
        ".glb",
        "GLB",
        "the face with its shapes as morph targets, without contact: Blender, Unity, Unreal, web",
        "either",
        _glb,
        contact=False,
    ),
    Format(
        ".obj",
        "OBJ",
        "the posed mesh, with UVs, groups, materials and textures",
        "pose",
        _posed_obj,
        _obj_sequence,
        materials=True,
    ),
    Format(".ply", "PLY", "the posed mesh, binary", "pose", _posed_ply, _ply_sequence),
    Format(
        ".csv",
        "CSV",
        "ARKit weights, as Live Link Face writes them, without contact",
        "either",
        _live_link,
        contact=False,
    ),
    Format(".json", "JSON", "weights of the face's own shapes, without contact", "either", _weights, contact=False),
    Format(".png", "PNG", "a picture of the pose", "pose", _picture, _picture_sequence, drawn=True, transparent=True),
    Format(".gif", "GIF", "the face in motion or turning round, for web pages", "film", _gif, drawn=True),
    Format(
        ".mp4",
        "MP4",
        "the face in motion or turning round, as a film",
        "film",
        _mp4,
        drawn=True,
        missing=missing_ffmpeg,
    ),
):
    register(_format)
