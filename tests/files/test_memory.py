"""The memory that is free is known before large pieces are taken."""

import subprocess
import sys

import pytest

from faceposer.errors import FacePoserError
from faceposer.files import memory


def test_more_than_is_free_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "free_memory", lambda: 1 << 30)
    memory.check_memory(700 << 20, "An image", "choose a smaller size")
    with pytest.raises(FacePoserError, match=r"An image takes about 2\.0 GB of memory, but 1\.0 GB are free; choose"):
        memory.check_memory(2 << 30, "An image", "choose a smaller size")
    monkeypatch.setattr(memory, "free_memory", lambda: None)
    memory.check_memory(1 << 50, "An image", "choose a smaller size")


@pytest.mark.skipif(sys.platform != "linux", reason="the limits are those of Linux")
def test_limits_of_the_process_count() -> None:
    code = (
        "import resource; from faceposer.files.memory import free_memory;"
        "resource.setrlimit(resource.RLIMIT_AS, (4 << 30, resource.RLIM_INFINITY)); print(free_memory())"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert 0 < int(found) < 4 << 30
