"""Text for display: names made safe, and text limited to a width, shortened in the middle or wrapped."""

import re
from collections.abc import Callable

from imgui_bundle import imgui

from faceposer.errors import printable

_ELLIPSIS = "..."
# Control characters, lone surrogates, which stand for bytes that are not UTF-8, and marks that change the direction.
_HIDDEN = re.compile(r"[\x00-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]+")
_LONGEST = 4000

Measure = Callable[[str], float]


def displayed(text: str, label: bool = True) -> str:
    """Return ``text``, which may hold names of files, as every widget can show it.

    Line breaks are kept, other control characters and bytes that are not UTF-8 are escaped, and very long text is cut.

    Args:
        text: Any text. Its part that stands for a file is not to be opened by the result.
        label: True for labels, in which Dear ImGui hides what follows "##".
    """
    # As most texts are; some hundred are shown in every frame.
    if len(text) <= _LONGEST and text.isprintable() and "##" not in text:
        return text
    if len(text) > _LONGEST:
        text = _cut(text, _LONGEST)
    lines = (_HIDDEN.sub(lambda match: printable(match[0], _LONGEST), line) for line in text.split("\n"))
    text = "\n".join(lines)
    return re.sub("#(?=#)", "# ", text) if label else text


def widget_id(name: str) -> str:
    """Return an identifier for Dear ImGui that is different for every ``name``."""
    return ascii(name).replace("#", "\\x23")


def text_width(text: str) -> float:
    """Return the width of ``text`` in the current font, in window units."""
    return float(imgui.calc_text_size(displayed(text)).x)


def shortened(text: str, width: float, measure: Measure = text_width) -> str:
    """Return ``text`` as ``displayed``, with an ellipsis in the middle if it is wider than ``width``.

    Args:
        text: One line.
        width: Maximum width, in the unit of ``measure``.
        measure: Returns the width of a text.
    """
    text = displayed(text)
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
    """Return ``text`` as ``displayed``, with an ellipsis at the end if it is wider than ``width``."""
    text = displayed(text)
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
