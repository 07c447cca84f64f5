"""Things done over and over in the window are played, and growth is noticed."""

from typing import Any

import pytest

from scripts.torture import soak
from scripts.torture.cycles import CYCLES, Window, growth, play


@pytest.mark.gl
@pytest.mark.slow
@pytest.mark.parametrize("name", list(CYCLES))
def test_nothing_is_left_on_the_gpu(name: str) -> None:
    told: list[dict[str, Any]] = []
    grown = play(name, 4, soak.memory_figures, told.append)
    assert grown["gpu_objects_per_cycle"] == 0.0
    assert grown["gpu_objects"] > 0
    assert [row["number"] for row in told] == [1, 2, 3, 4]


@pytest.mark.gl
def test_a_leak_is_noticed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    kept = []

    def leaking(window: Window) -> Any:
        return lambda i: kept.append(window.app.gl.buffer(reserve=16 * (i + 1)))

    monkeypatch.setitem(CYCLES, "leaking", leaking)
    assert soak.main(["--cycles", "leaking", "--events", "6"]) == 1
    assert '"gpu_objects_per_cycle": 1.0' in capsys.readouterr().out


def test_growth_is_that_of_medians_after_the_first_cycles() -> None:
    rows = [{"blocks": 100.0 + 2.0 * i, "gpu_objects": 7.0 + (i == 5), "peak_mb": 1.0 * i} for i in range(20)]
    grown = growth("solves", rows)
    assert (grown["cycles"], grown["blocks_per_cycle"], grown["gpu_objects_per_cycle"]) == (20, 2.0, 0.0)
    assert "peak_mb_per_cycle" not in grown
