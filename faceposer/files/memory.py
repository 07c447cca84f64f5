"""Memory that is free, for checks before large pieces are taken."""

import sys
from contextlib import suppress
from pathlib import Path

from faceposer.errors import FacePoserError

# Share of the free memory that one piece of work may take.
_SHARE = 0.8
_CGROUPS = (
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
    ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
)


def check_memory(needed: int, what: str, remedy: str) -> None:
    """Check that ``needed`` bytes can be taken.

    Args:
        needed: Number of bytes.
        what: Subject of the sentence, such as "An image of 8192 x 8192 pixels".
        remedy: Imperative, such as "choose a smaller size".

    Raises:
        FacePoserError: If less memory is free.
    """
    free = free_memory()
    if free is not None and needed > _SHARE * free:
        raise FacePoserError(
            f"{what} takes about {needed / 2**30:.1f} GB of memory, but {max(free, 0) / 2**30:.1f} GB are free; "
            f"{remedy}."
        )


def free_memory() -> int | None:
    """Return the bytes that this process can still take, or None if that cannot be found out."""
    bounds = [bound for bound in (_of_system(), _of_container(), _of_process()) if bound is not None]
    return min(bounds, default=None)


def _of_system() -> int | None:
    with suppress(OSError, ValueError, LookupError, StopIteration):
        return _kilobytes("/proc/meminfo", "MemAvailable:")
    return None


def _of_container() -> int | None:
    for limit, used in _CGROUPS:
        with suppress(OSError, ValueError):
            # The limit is "max" where there is none.
            return int(Path(limit).read_text()) - int(Path(used).read_text())
    return None


def _of_process() -> int | None:
    """Return what the limit of ``ulimit -v`` leaves."""
    if sys.platform == "win32":
        return None
    import resource

    with suppress(OSError, ValueError, LookupError, StopIteration):
        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY:
            return limit - _kilobytes("/proc/self/status", "VmSize:")
    return None


def _kilobytes(path: str, key: str) -> int:
    line = next(line for line in Path(path).read_text().splitlines() if line.startswith(key))
    return int(line.split()[1]) << 10
