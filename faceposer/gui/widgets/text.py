"""Text limited to a width: shortened in the middle, where names differ least, or wrapped."""

from collections.abc import Callable

from imgui_bundle import imgui

_ELLIPSIS = "..."

Measure = Callable[[str], float]


def text_width(text: str) -> float:
    """Return the width of ``text`` in the current font, in window units."""
    return float(imgui.calc_text_size(text).x)


def shortened(text: str, width: float, measure: Measure = text_width) -> str:
    """Return ``text``, with an ellipsis in the middle if it is wider than ``width``.

    Args:
        text: One line.
        width: Maximum width, in the unit of ``measure``.
        measure: Returns the width of a text.
    """
    if measure(text) <= width:
        return text
    low, high = 0, len(text)
    # Bisection for the number of letters that fit with the ellipsis.
    while low < high:
        count = (low + high + 1) // 2
        if measure(_cut(text, count)) <= width:
            low = count
        else:
            high = count - 1
    return _cut(text, low)


def truncated(text: str, width: float, measure: Measure = text_width) -> str:
    """Return ``text``, with an ellipsis at the end if it is wider than ``width``."""
    if measure(text) <= width:
        return text
    while text and measure(f"{text.rstrip()}{_ELLIPSIS}") > width:
        text = text[:-1]
    return f"{text.rstrip()}{_ELLIPSIS}"


def _cut(text: str, count: int) -> str:
    """Return ``count`` letters of ``text``, from both ends, with an ellipsis between them."""
    head = (count + 1) // 2
    tail = text[len(text) - (count - head) :]
    return f"{text[:head].rstrip()}{_ELLIPSIS}{tail.lstrip()}"


def wrapped(text: str, width: float, max_lines: int = 2, measure: Measure = text_width) -> list[str]:
    """Return ``text`` in at most ``max_lines`` lines no wider than ``width``; the last line is shortened if necessary.

    Args:
        text: Words, separated by spaces.
        width: Maximum width, in the unit of ``measure``.
        max_lines: Maximum number of lines, at least 1.
        measure: Returns the width of a text.
    """
    lines: list[str] = []
    words = text.split()
    while words:
        if len(lines) == max_lines - 1:
            lines.append(shortened(" ".join(words), width, measure))
            break
        count = 1
        while count < len(words) and measure(" ".join(words[: count + 1])) <= width:
            count += 1
        lines.append(shortened(" ".join(words[:count]), width, measure))
        words = words[count:]
    return lines or [""]
