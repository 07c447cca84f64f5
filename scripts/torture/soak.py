#!/usr/bin/env python3
"""Play random events in the window for a long time: its memory stays flat, and its document stays sound.

    python scripts/torture/soak.py                          # 100,000 events
    python scripts/torture/soak.py --short                  # as in the tests
    python scripts/torture/soak.py --out soak --resume      # goes on where that was stopped
    python scripts/torture/soak.py --cycles photos --events 100     # the same thing, a hundred times

Every thousand events one line of JSON is printed, and with --out added to figures.jsonl in that folder, next to the
session as it then was. The events of a block depend on the seed and its number alone, so that one of them can be
played again. After each event no dialog may have come up and all coefficients must be finite; after each block the
document must be the same when written and read again, and nothing may have gone to the error output; at the end all
steps are undone and done again. The exit status is 1 where anything of this fails, or where more memory is used at the
end than --growth allows, compared with the end of the first tenth, or with --short of the first four fifths: until then
some kind of constraint is made for the first time, and its caches are filled.

What costs most of the time without a graphics card is left out of most frames: the face is drawn as it is in one of
--draw-every, and small and without its material in the others, whose panels are laid out but not drawn.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    # Before NumPy is imported: threads cost more than they bring where matrices are small.
    os.environ.setdefault(variable, "1")

import argparse
import contextlib
import ctypes
import io
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from faceposer.files.atomic import write_text
from faceposer.gui.app import App
from faceposer.gui.settings import Settings
from faceposer.gui.testing.random_user import RandomUser
from faceposer.session.document import Document, write_document
from scripts.torture import cycles

EVENTS, BLOCK, DRAW_EVERY, SEED = 100_000, 1000, 50, 7
SHORT_EVENTS, SHORT_BLOCK = 400, 40
#: Largest growth of the memory, as a share, from the end of the first blocks to the end; the share of these blocks.
GROWTH, FIRST_BLOCKS, SHORT_FIRST_BLOCKS = 0.15, 0.1, 0.8
#: Growth of a cycle, in megabytes, that counts as a leak.
LEAK = 0.05
_MB = 1e6


class MallInfo(ctypes.Structure):
    """What glibc's mallinfo2 returns."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in ("arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "used", "free", "keepcost")
    ]


def memory_figures() -> dict[str, float]:
    """Return the resident memory of the process, its greatest so far, and where it is known what malloc has given out.

    In megabytes.
    """
    figures: dict[str, float] = {}
    with contextlib.suppress(OSError):
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        figures["resident_mb"] = pages * os.sysconf("SC_PAGE_SIZE") / _MB
    with contextlib.suppress(ImportError):
        import resource

        unit = 1.0 if sys.platform == "darwin" else 1024.0
        figures["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / _MB
    with contextlib.suppress(OSError, AttributeError):
        mallinfo = ctypes.CDLL(None).mallinfo2
        mallinfo.restype = MallInfo
        found = mallinfo()
        figures["used_mb"] = (found.used + found.hblkhd) / _MB
        figures["free_mb"] = found.free / _MB
    return {name: round(value, 1) for name, value in figures.items()}


class Soak:
    """A random user at a hidden window, and what is checked of it."""

    def __init__(self, what: str, seed: int, draw_every: int) -> None:
        """Open ``what`` and draw one of ``draw_every`` frames in full."""
        settings = Settings(window_size=(700, 520), welcome_done=True)
        self.app = App(what, hidden=True, threaded=False, settings=settings)
        self.seed, self.draw_every = seed, draw_every
        self.errors = io.StringIO()
        self.problems: list[str] = []
        self._draw_face, self._draw_panels = self.app.face_image, self.app.gui.draw
        self.app.face_image = self._picture  # type: ignore[method-assign]
        self.app.gui.draw = self._draw  # type: ignore[method-assign]
        self.user = RandomUser(self.app, seed)
        for _ in range(4):
            self.user.step()

    @property
    def _in_full(self) -> bool:
        return self.app.frames_drawn % self.draw_every == 0

    def _picture(self, size: tuple[int, int]) -> Any:
        if self._in_full:
            return self._draw_face(size)
        return self.app.scene.draw(self.app.viewport.view.camera((64, 64)), "clay", False, 0)

    def _draw(self) -> None:
        if self._in_full:
            self._draw_panels()

    def play(self, block: int, count: int) -> dict[str, Any]:
        """Play ``count`` events, the ones of ``block``, and return the figures of the block."""
        begun, user, app = time.perf_counter(), self.user, self.app
        user.rng = np.random.default_rng([self.seed, block])
        steepest, before = (0.0, 0), memory_figures().get("used_mb", 0.0)
        with contextlib.redirect_stderr(self.errors):
            for i in range(count):
                user.next()
                used = memory_figures().get("used_mb", 0.0)
                steepest, before = max(steepest, (used - before, i)), used
                self._check_event(block, i)
        self._check_block(block)
        app.screenshot()
        return {
            "block": block,
            "events": user.done,
            "seconds": round(time.perf_counter() - begun, 1),
            **memory_figures(),
            "steepest_mb": round(steepest[0], 1),
            "steepest_at": steepest[1],
            "steps": app.session.depth,
            "constraints": len(app.session.document.constraints),
            "kinds": sorted(user.seen),
            "problems": len(self.problems),
        }

    def _expect(self, holds: bool, text: str) -> None:
        if not holds:
            self.problems.append(text)
            print(text, file=sys.__stderr__, flush=True)

    def _check_event(self, block: int, event: int) -> None:
        app = self.app
        for question in app.dialogs.waiting:
            self._expect(False, f"block {block}, event {event}: a dialog says: {question.text}")
        app.dialogs.waiting.clear()
        if not np.isfinite(app.session.coefficients).all():
            self._expect(False, f"block {block}, event {event}: the pose is not finite")

    def _check_block(self, block: int) -> None:
        session = self.app.session
        document = session.document
        document.resolved(session.model)
        again = Document.from_json(json.loads(json.dumps(document.to_json()))).resolved(session.model)
        self._expect(again.constraints == document.constraints, f"block {block}: the document is not read as written")
        self._expect(not self.errors.getvalue(), f"block {block}: error output: {self.errors.getvalue()[-2000:]}")
        self.errors.truncate(0)

    def finish(self) -> None:
        """Take back all steps, do them again, and check that the document comes back."""
        self.user.rest()
        app, session = self.app, self.app.session
        app.toolbox.cancel()
        session.wait()
        self._expect(not app.busy and not app.closing, "the window still holds the document at the end")
        session.mode = "apply"
        end, steps = session.document, 0
        while session.can_undo:
            session.undo()
            steps += 1
            if not np.isfinite(session.coefficients).all():
                self._expect(False, f"undo {steps} leads to a pose that is not finite")
        for _ in range(steps):
            session.redo()
        self._expect(session.document.same_input(end), f"{steps} steps undone and done again lead elsewhere")


def soak(
    soaked: Soak, events: int, every: int, tell: Callable[[dict[str, Any]], None], first: int = 0
) -> list[dict[str, Any]]:
    """Play ``events`` in blocks of ``every`` from block ``first``, ``tell`` the figures of each, and return them."""
    rows = []
    for block in range(first, events // every):
        rows.append(soaked.play(block, every))
        tell(rows[-1])
    soaked.finish()
    return rows


def summary(rows: list[dict[str, Any]], problems: list[str], first_blocks: float) -> dict[str, Any]:
    """Return the memory at the end and after a share ``first_blocks`` of ``rows``, its growth, and what failed."""
    result: dict[str, Any] = {"events": rows[-1]["events"], "problems": problems}
    begin = rows[max(round(len(rows) * first_blocks) - 1, 0)]
    for name in ("used_mb", "resident_mb", "peak_mb"):
        if name in begin:
            result[name] = [begin[name], rows[-1][name]]
            result[f"growth_{name[:-3]}"] = round(rows[-1][name] / begin[name] - 1.0, 3)
    return result


def _play_cycles(name: str, count: int) -> int:
    """Play the cycle ``name`` so many times, print its figures, and return the exit status."""
    grown = cycles.play(name, count, memory_figures, lambda row: print(json.dumps(row), flush=True))
    print(json.dumps(grown))
    return int(grown["gpu_objects_per_cycle"] > 0.0 or grown.get("used_mb_per_cycle", 0.0) > LEAK)


def main(arguments: list[str] | None = None) -> int:
    """Run the program and return its exit status."""
    assert __doc__ is not None
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--character", default="man", metavar="WHAT", help="character or session (default: man)")
    parser.add_argument("--events", type=int, default=EVENTS, help=f"how many (default: {EVENTS})")
    parser.add_argument("--every", type=int, default=BLOCK, help=f"events of a block (default: {BLOCK})")
    parser.add_argument("--seed", type=int, default=SEED, help=f"of the events (default: {SEED})")
    parser.add_argument(
        "--draw-every",
        type=int,
        default=DRAW_EVERY,
        help=f"draw one frame of so many in full (default: {DRAW_EVERY})",
    )
    parser.add_argument(
        "--cycles",
        choices=list(cycles.CYCLES),
        help="instead of random events, repeat one thing --events times and print its growth",
    )
    parser.add_argument("--growth", type=float, default=GROWTH, help=f"allowed growth (default: {GROWTH})")
    parser.add_argument("--short", action="store_true", help=f"{SHORT_EVENTS} events on a small head")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="where figures.jsonl and session.json go")
    parser.add_argument("--resume", action="store_true", help="go on after the last block of --out, in a new process")
    options = parser.parse_args(arguments)
    if options.cycles is not None:
        return _play_cycles(options.cycles, options.events)
    if options.short:
        options.character, options.events, options.every = "low", SHORT_EVENTS, SHORT_BLOCK
    if options.resume and options.out is None:
        parser.error("--resume needs --out")
    if min(options.every, options.draw_every) < 1 or options.events < options.every:
        parser.error("--every and --draw-every must be at least 1, and --events at least --every")

    figures: list[str] = []
    first = 0
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        log, session = options.out / "figures.jsonl", options.out / "session.json"
        if options.resume and log.exists():
            figures = log.read_text(encoding="utf-8").splitlines()
            first = json.loads(figures[-1])["block"] + 1
            options.character = str(session)
    soaked = Soak(options.character, options.seed, options.draw_every)
    soaked.user.done = first * options.every

    def tell(row: dict[str, Any]) -> None:
        line = json.dumps(row)
        print(line, flush=True)
        figures.append(line)
        if options.out is not None:
            write_text(log, "\n".join(figures) + "\n", "figures")
            current = soaked.app.session
            write_document(session, current.document.with_version_data(current.model))

    try:
        rows = soak(soaked, options.events, options.every, tell, first)
    finally:
        soaked.app.close()
    if not rows:
        print("All blocks have been played; give a larger --events to go on.")
        return 0
    result = summary(rows, soaked.problems, SHORT_FIRST_BLOCKS if options.short else FIRST_BLOCKS)
    print(json.dumps(result))
    grown = max(result.get("growth_used", 0.0), result.get("growth_resident", 0.0))
    return int(bool(soaked.problems) or grown > options.growth)


if __name__ == "__main__":
    sys.exit(main())
