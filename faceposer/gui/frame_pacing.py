"""Frame pacing: when a frame is due, and the resolution that a moving face affords."""

import time

# Frames drawn after every event: Dear ImGui spreads fast clicks over several.
FRAMES_AFTER_EVENT = 3
# Seconds for which drawing continues after the pointer stops on a panel, because tooltips and highlights appear late.
_LINGER = 1.0
# Frame times in seconds above which the resolution of a moving face is halved, and below which it is restored.
_SLOW_FRAME, _FAST_FRAME = 0.040, 0.010


class FramePacing:
    """Counts the frames that are due and the time since the last event."""

    def __init__(self) -> None:
        self._due = FRAMES_AFTER_EVENT
        self._last_event = time.perf_counter()

    @property
    def due(self) -> bool:
        """True if a frame is due."""
        return self._due > 0

    @property
    def lingers(self) -> bool:
        """True if the last event was so recent that tooltips may still appear."""
        return time.perf_counter() - self._last_event < _LINGER

    def request(self, frames: int = FRAMES_AFTER_EVENT) -> None:
        """Make at least ``frames`` frames due."""
        self._due = max(self._due, frames)

    def record_event(self) -> None:
        """Make frames due after an event."""
        self.request()
        self._last_event = time.perf_counter()

    def take_frame(self) -> None:
        """Count one frame as drawn."""
        self._due = max(self._due - 1, 0)


class AdaptiveResolution:
    """Halves the resolution of a moving face while frames take too long, as they may without a graphics card."""

    def __init__(self, enabled: bool) -> None:
        self.enabled = enabled
        self._divisor = 1

    def reduced(self, size: tuple[int, int]) -> tuple[int, int]:
        """Return the ``size`` in pixels at which to draw a moving face."""
        return (max(size[0] // self._divisor, 1), max(size[1] // self._divisor, 1))

    def update(self, frame_seconds: float) -> None:
        """Adapt to the duration of the last frame."""
        if frame_seconds > _SLOW_FRAME:
            self._divisor = 2
        elif frame_seconds < _FAST_FRAME:
            self._divisor = 1
