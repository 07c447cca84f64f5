"""Table of export formats, read by the export dialog, the command line and the Python interface.

A new format is a module that writes it and a row here. Writers are imported when they are used: some need libraries
that would delay the start of the window, and images need OpenGL, which meshes and weights do not.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import check_output
from faceposer.files.key_places import check_not_key
from faceposer.files.writing import check_finite
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.progress import Progress
from faceposer.render.ffmpeg import missing_ffmpeg
from faceposer.render.options import OutputOptions

if TYPE_CHECKING:
    from faceposer.render.offscreen import Context

#: Name of the progress stage of an export.
WRITING = "Writing"

Motion = NDArray[np.float64] | Performance


@dataclass(frozen=True)
class Output:
    """Arguments of an export.

    Attributes:
        path: The file, or the folder of a sequence.
        model: The face.
        motion: A pose, shape (r,), or a performance.
        options: Output options.
        ctx: OpenGL context for images; None to create one.
        progress: Progress of writers that work in one long step.
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
        suffix: File suffix, lower case with the dot.
        name: Name of the format.
        purpose: Content and purpose of a file, for help texts.
        holds: Content of one file: "pose" for a single pose; "either" for a pose or a performance; "film" for a video,
            in which the camera turns around a single pose.
        write: Writes a file atomically and yields the completed share; closing the iterator cancels without a file.
        sequence: Likewise, writes a performance as a new folder with one file per frame; None if unsupported.
        drawn: True if files are rendered, so that size, view and shading apply.
        contact: True if files can contain the contact step.
        transparent: True if images can have a transparent background.
        materials: True if materials and textures are written as additional files.
        missing: Returns the reason why this machine cannot write the format, or "".
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
        """True if one file can hold a performance."""
        return self.holds in ("either", "film")


#: All formats by suffix, in the order in which they are offered.
FORMATS: dict[str, Format] = {}


def register(form: Format) -> None:
    """Register ``form`` for the window, the command line and Python.

    Raises:
        ValueError: If its suffix is taken or not a lower-case suffix.
    """
    if form.suffix in FORMATS or not form.suffix.startswith(".") or form.suffix != form.suffix.lower():
        raise ValueError(f"'{form.suffix}' is not a new, lower-case suffix of a format")
    FORMATS[form.suffix] = form


def suffixes(kind: Callable[[Format], bool] = lambda _: True) -> tuple[str, ...]:
    """Return the suffixes of the formats for which ``kind`` holds."""
    return tuple(form.suffix for form in FORMATS.values() if kind(form))


def offered(kind: Callable[[Format], bool] = lambda _: True) -> tuple[str, ...]:
    """Return the suffixes of the formats for which ``kind`` holds and that can be written on this machine."""
    return suffixes(lambda form: kind(form) and not form.missing())


def format_of(path: Path) -> Format:
    """Return the format of ``path`` by its suffix.

    Raises:
        FacePoserError: If the suffix is unknown.
    """
    try:
        return FORMATS[path.suffix.lower()]
    except KeyError:
        raise FacePoserError(f"'{path}' must end in one of {', '.join(offered())}.") from None


def check_writable(path: Path, kind: Callable[[Format], bool] = lambda _: True) -> Format:
    """Return the format of the output ``path``, checking that it can be written before any work is done.

    Args:
        path: The file to write.
        kind: Predicate that the format must satisfy.

    Raises:
        FacePoserError: If the suffix is not that of such a format, or the file cannot be written on this machine.
    """
    form = FORMATS.get(path.suffix.lower())
    if form is None or not kind(form):
        raise FacePoserError(f"The output '{path}' must end in one of {', '.join(offered(kind))}.")
    if reason := form.missing():
        raise FacePoserError(reason)
    check_output(path, form.suffix)
    return form


def write(
    path: Path,
    model: FaceModel,
    motion: Motion,
    options: OutputOptions | None = None,
    progress: Progress | None = None,
) -> None:
    """Write a face atomically, in the format given by the suffix of ``path``.

    Args:
        path: File with one of the suffixes in ``FORMATS``.
        model: The face.
        motion: A pose, shape (r,), or a performance.
        options: Output options; defaults if None.
        progress: Receives the progress; cancelling leaves no file.

    Raises:
        FacePoserError: If the suffix is unknown, the format cannot hold a performance, the file cannot be written, or
            OpenGL or ffmpeg is needed and missing.
    """
    progress = progress or Progress()
    for share in write_steps(Output(path, model, motion, options or OutputOptions(), progress=progress)):
        progress.at(WRITING, share)


def write_steps(output: Output) -> Generator[float, None, None]:
    """Write ``output`` as ``write`` does, yielding the completed share after each step.

    Closing the iterator early leaves no file.

    Raises:
        FacePoserError: As ``write``.
    """
    form = format_of(output.path)
    if form.holds == "pose" and isinstance(output.motion, Performance):
        remedy = "choose a frame, or write a .gif" if form.drawn else "write a sequence of files instead"
        verb = "shows" if form.drawn else "holds"
        raise FacePoserError(f"'{output.path}' {verb} one pose, not {len(output.motion)}; {remedy}.")
    check_not_key(output.path)
    _check_options(form, output.options)
    _check_motion(output, "file")
    yield from form.write(output)


def write_sequence_steps(output: Output, suffix: str) -> Generator[float, None, None]:
    """Write the performance of ``output`` as a folder of files with ``suffix``, yielding the completed share.

    Raises:
        FacePoserError: If the format does not support sequences, or the folder cannot be written.
    """
    form = FORMATS[suffix]
    if form.sequence is None or not isinstance(output.motion, Performance):
        raise FacePoserError(f"{form.name} cannot be written as a sequence of files; choose another format.")
    _check_options(form, output.options)
    _check_motion(output, "folder")
    yield from form.sequence(output)


def _check_motion(output: Output, kind: str) -> None:
    motion = output.motion
    check_finite(output.path, kind, motion.coefficients if isinstance(motion, Performance) else motion)


def _check_options(form: Format, options: OutputOptions) -> None:
    if reason := form.missing():
        raise FacePoserError(reason)
    if options.transparent and not form.transparent:
        alternatives = " or ".join(suffixes(lambda other: other.transparent))
        raise FacePoserError(f"{form.name} cannot have a transparent background; write {alternatives} instead.")


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
    performance = motion if isinstance(motion, Performance) else Performance(motion[None], _SINGLE_FRAME_RATE)
    write_live_link(output.path, output.model, performance)
    yield 1.0


def _weights(output: Output) -> Generator[float, None, None]:
    from faceposer.interchange.weights_json import write_weights

    write_weights(output.path, output.model, output.motion)
    yield 1.0


def _image(output: Output) -> Generator[float, None, None]:
    from faceposer.render.shots import picture_steps

    yield from picture_steps(output.path, output.model, _pose(output), output.options, output.ctx)


def _image_sequence(output: Output) -> Generator[float, None, None]:
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


# Frame rate of a file with a single pose.
_SINGLE_FRAME_RATE = 30.0
for _format in (
    Format(
        ".glb",
        "GLB",
        "the face with its shapes as morph targets, for Blender, Unity, Unreal and the web; without contact",
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
        "ARKit weights in the format of Live Link Face; without contact",
        "either",
        _live_link,
        contact=False,
    ),
    Format(".json", "JSON", "weights of the character's shapes; without contact", "either", _weights, contact=False),
    Format(".png", "PNG", "an image of the pose", "pose", _image, _image_sequence, drawn=True, transparent=True),
    Format(".gif", "GIF", "the animation, or a turntable of the pose, for web pages", "film", _gif, drawn=True),
    Format(
        ".mp4",
        "MP4",
        "the animation, or a turntable of the pose, as a video",
        "film",
        _mp4,
        drawn=True,
        missing=missing_ffmpeg,
    ),
):
    register(_format)
