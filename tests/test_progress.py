"""Progress of parts of the work."""

import pytest

from faceposer.progress import CancelledError, Progress


def test_shares_of_parts_are_shares_of_the_whole() -> None:
    shown: list[tuple[str, float]] = []
    progress = Progress(lambda stage, share: shown.append((stage, share)))
    part = progress.part(0.2, 0.6)
    part.at("one")
    part.at("two", 0.5)
    part.part(0.5, 1.0).at("three", 1.5)
    assert [stage for stage, _ in shown] == ["one", "two", "three"]
    assert [share for _, share in shown] == pytest.approx([0.2, 0.4, 0.6])


def test_parts_are_cancelled_with_the_whole() -> None:
    part = Progress(cancelled=lambda: True).part(0.0, 0.5)
    with pytest.raises(CancelledError):
        part.at("one")
