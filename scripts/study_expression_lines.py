"""Measure the cost of expression lines: preparation, time per pose, and frames with and without them.

    .venv/bin/python scripts/study_expression_lines.py

Frames of 1200 x 900 with 4 samples per pixel are drawn alternately with and without lines, until the image is complete.
The name of the OpenGL renderer is printed, since times of a software renderer do not apply to a graphics card. The
processor time of all threads is less affected by other load.
"""

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

from faceposer.api import load
from faceposer.geometry.mesh import VertexNormals
from faceposer.model.expression_line_map import line_heights
from faceposer.model.expression_lines import expression_lines, strength_map
from faceposer.poses.portrait import portrait_view
from faceposer.render.framebuffers import ColourTarget
from faceposer.render.offscreen import offscreen_context
from faceposer.render.renderer import Renderer

SIZE = (1200, 900)
SAMPLES = 4
POSES = ("Happiness", "Surprise", "Disgust")


def milliseconds(do: Callable[[], object]) -> float:
    """Return the time that ``do`` takes."""
    began = time.perf_counter()
    do()
    return (time.perf_counter() - began) * 1e3


def cost_per_pose(name: str, repeats: int) -> None:
    """Print the processor time of the lines of the character ``name`` per pose."""
    face = load(name)
    line_heights.cache_clear()
    map_ms = milliseconds(line_heights)
    prepare_ms = min(milliseconds(lambda: expression_lines(face.character)) for _ in range(5))
    lines = expression_lines(face.character)
    if lines is None:
        print(f"{name}: no lines, since feature points are missing")
        return
    face.apply_pose(POSES[0])
    vertices = face.vertices
    times = [milliseconds(lambda: strength_map(lines.strengths(vertices))) for _ in range(repeats)]
    print(
        f"{name}: once {map_ms:.1f} ms for the map and {prepare_ms:.1f} ms for the face; per pose median "
        f"{statistics.median(times):.3f} ms, 99 % {np.percentile(times, 99):.3f} ms"
    )


def cost_per_frame(name: str, repeats: int) -> None:
    """Print the time of the lines of the character ``name`` per frame."""
    face = load(name)
    normals = VertexNormals(face.triangles, len(face.vertices))
    camera = portrait_view(face.character).camera(SIZE)
    with offscreen_context() as ctx:
        renderer = Renderer(ctx)
        renderer.set_character(face.character)
        target = ColourTarget(ctx, SIZE, min(SAMPLES, ctx.max_samples))

        def draw(shown: bool) -> None:
            renderer.draw(target.framebuffer, camera, expression_lines=shown)
            ctx.finish()

        for pose in (None, *POSES):
            face.reset()
            if pose is not None:
                face.apply_pose(pose)
            renderer.update(face.vertices, normals(face.vertices))
            draw(True)
            times: dict[bool, list[tuple[float, float]]] = {True: [], False: []}
            for _ in range(repeats):
                for shown, spent in times.items():
                    processor = time.process_time()
                    wall = milliseconds(lambda shown=shown: draw(shown))  # type: ignore[misc]
                    spent.append((wall, (time.process_time() - processor) * 1e3))
            on, off = (np.median(times[shown], axis=0) for shown in (True, False))
            print(
                f"{name}, {pose or 'neutral'}: {off[0]:.1f} ms without, {on[0]:.1f} ms with lines; processor time "
                f"{off[1]:.1f} ms and {on[1]:.1f} ms ({on[1] - off[1]:+.1f} ms)"
            )
        print(ctx.info["GL_RENDERER"])
        target.release()
        renderer.release()


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=25, help="number of frames with and without lines (default: 25)")
    options = parser.parse_args()
    for name in ("man", "woman", "low", "creature"):
        cost_per_pose(name, 20 * options.repeats)
    cost_per_frame("man", options.repeats)


if __name__ == "__main__":
    main()
