"""Drawings in SVG: lines as programs write them, what is left out, and hostile files."""

from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.sketch.outlines import centreline
from faceposer.sketch.svg_file import SvgDrawing, read_svg

HEAD = (
    '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
    'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
)
LINE = '<path fill="none" stroke="#000" d="M 0 0 L 10 0"/>'


def read(tmp_path: Path, body: str, head: str = HEAD + 'viewBox="0 0 100 100">') -> SvgDrawing:
    path = tmp_path / "a.svg"
    path.write_text(f"{head}{body}</svg>")
    return read_svg(path)


def refused(tmp_path: Path, text: str) -> str:
    path = tmp_path / "bad.svg"
    path.write_text(text)
    with pytest.raises(FacePoserError) as caught:
        read_svg(path)
    said = str(caught.value)
    assert "bad.svg" in said
    assert said.isprintable()
    assert said.endswith(".")
    return said


@pytest.mark.parametrize(
    ("shape", "points"),
    [
        ('<path d="m1,2 l3,0 v4 h-3 z"/>', [(1, 2), (4, 2), (4, 6), (1, 6), (1, 2)]),
        ('<polyline points="1,2 3,4.5,5 -6"/>', [(1, 2), (3, 4.5), (5, -6)]),
        ('<polygon points="0 0 2 0 2 2"/>', [(0, 0), (2, 0), (2, 2), (0, 0)]),
        ('<line x1="1" y1="2" x2="30%" y2="4"/>', [(1, 2), (30, 4)]),
        ('<path transform="translate(1 2) scale(2)" d="M1 1L2 1"/>', [(3, 4), (5, 4)]),
        ('<path transform="rotate(90, 1, 1)" d="M1 1L2 1"/>', [(1, 1), (1, 2)]),
        ('<path transform="matrix(1 0 0 -1 0 10) skewX(45)" d="M1 1L2 2"/>', [(2, 9), (4, 8)]),
    ],
)
def test_shapes_have_their_points(shape: str, points: list[tuple[float, float]], tmp_path: Path) -> None:
    (stroke,) = read(tmp_path, f'<g fill="none" stroke="red">{shape}</g>').strokes
    np.testing.assert_allclose(stroke.points, points, atol=1e-9)


def test_curves_are_flattened_closely(tmp_path: Path) -> None:
    # A quarter of a circle as a cubic, an arc, and a whole ellipse.
    body = (
        '<g fill="none" stroke="red"><path d="M10 0C10 5.5228 5.5228 10 0 10"/><path d="M10 0A10 10 0 0 1 0 10"/>'
        '<circle r="10"/><ellipse rx="10" ry="10"/></g>'
    )
    for stroke in read(tmp_path, body).strokes:
        np.testing.assert_allclose(np.hypot(*stroke.points.T), 10.0, atol=0.01)
        assert np.abs(np.diff(stroke.points, axis=0)).max() < 2.0


def test_units_and_view_box_scale_the_page(tmp_path: Path) -> None:
    (wide,) = read(tmp_path, LINE, HEAD + 'width="50mm" height="50mm" viewBox="0 0 100 100">').strokes
    assert float(np.ptp(wide.points[:, 0])) == pytest.approx(10.0 * 50.0 * 96.0 / 25.4 / 100.0)
    # In proportion and in the middle of a page that is too high.
    (middle,) = read(tmp_path, LINE, HEAD + 'width="100" height="300" viewBox="0 0 100 100">').strokes
    np.testing.assert_allclose(middle.points, [(0, 100), (10, 100)])
    (stretched,) = read(
        tmp_path,
        '<path fill="none" stroke="#000" d="M 0 0 L 10 10"/>',
        HEAD + 'width="100" height="300" viewBox="0 0 100 100" preserveAspectRatio="none">',
    ).strokes
    np.testing.assert_allclose(stretched.points[1], (10, 30))


def test_inkscape_layers_clones_and_labels(tmp_path: Path) -> None:
    body = (
        '<defs><path id="unused" d="M0 0L1 1"/></defs>'
        '<g inkscape:groupmode="layer" inkscape:label="sketch" style="display:none"><path d="M0 0L9 9"/></g>'
        '<g inkscape:groupmode="layer" inkscape:label="Neutral" style="fill:none;stroke:#000">'
        '<path id="b" inkscape:label="left brow" d="M 1 1 L 2 1"/></g>'
        '<use xlink:href="#b" transform="matrix(-1 0 0 1 50 0)"/>'
    )
    drawing = read(tmp_path, body)
    first, clone = drawing.strokes
    assert first.neutral
    assert first.feature == "left brow"
    assert drawing.remarks == ("1 hidden layer or object ignored",)
    np.testing.assert_allclose(clone.points, [(49, 1), (48, 1)])


def test_a_hidden_neutral_layer_is_read(tmp_path: Path) -> None:
    body = f'<g id="neutral" display="none" fill="none" stroke="#000">{LINE}</g>{LINE}'
    first, second = read(tmp_path, body).strokes
    assert (first.neutral, second.neutral) == (True, False)


def test_a_switch_shows_the_alternative_without_conditions(tmp_path: Path) -> None:
    body = (
        '<switch><foreignObject requiredExtensions="http://ns.adobe.com/AdobeIllustrator/10.0/"/>'
        '<g fill="none" stroke="#000"><path d="M0 0L1 0"/></g><g fill="none" stroke="#000"><path d="M0 0L2 0"/></g>'
        "</switch>"
    )
    (stroke,) = read(tmp_path, body).strokes
    np.testing.assert_allclose(stroke.points, [(0, 0), (1, 0)])


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    body = (
        f"{LINE}<text>a</text><text>b</text><image href='http://x/y.png'/><rect width='9' height='9'/>"
        '<path fill="none" d="M0 0L1 1"/><clipPath><path d="M0 0L1 1"/></clipPath>'
        '<path fill="none" stroke="#000" d="M0 0 C nonsense"/><use href="other.svg#a"/>'
    )
    drawing = read(tmp_path, body)
    assert len(drawing.strokes) == 1
    assert drawing.remarks == (
        "1 clone of what is not in the file ignored",
        "1 image ignored",
        "1 invisible object ignored",
        "1 object with invalid data ignored",
        "1 rectangle ignored",
        "2 texts ignored",
    )


def test_style_sheets_and_inheritance(tmp_path: Path) -> None:
    body = (
        "<style>.a, .b { fill: none; stroke: #000 } .c { display: none }</style>"
        '<path class="a" d="M0 0L1 1"/><path class="a c" d="M0 0L1 1"/>'
        '<g visibility="hidden"><path class="b" d="M0 0L1 1"/></g>'
    )
    drawing = read(tmp_path, body)
    assert len(drawing.strokes) == 1
    assert drawing.remarks == ("1 hidden layer or object ignored", "1 invisible object ignored")


def test_outlines_of_calligraphic_pens_become_their_centre_lines(tmp_path: Path) -> None:
    body = '<path d="M 0,0 C 20,-20 60,-20 80,0 C 60,-14 20,-14 0,0 Z"/><circle cx="50" cy="50" r="9"/>'
    drawing = read(tmp_path, body)
    pen, dot = drawing.strokes
    assert drawing.remarks == ("1 filled outline was replaced by centre lines",)
    ends = pen.points[[0, -1]]
    np.testing.assert_allclose(ends[np.argsort(ends[:, 0])], [(0, 0), (80, 0)], atol=3.0)
    np.testing.assert_allclose(pen.points[len(pen.points) // 2], (40, -12.75), atol=1.0)
    assert np.linalg.norm(dot.points[0] - dot.points[-1]) < 1e-9
    assert centreline(dot.points) is None


def test_hostile_files_are_refused_in_a_sentence(tmp_path: Path) -> None:
    bomb = '<!DOCTYPE svg [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]>' + HEAD + ">&b;</svg>"
    assert "entities" in refused(tmp_path, bomb)
    outside = '<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/passwd">]>' + HEAD + "><text>&x;</text></svg>"
    assert "entities" in refused(tmp_path, outside)
    assert "nested deeper" in refused(tmp_path, HEAD + ">" + "<g>" * 5000)
    assert "more than 50000 elements" in refused(tmp_path, HEAD + ">" + "<g/>" * 60000 + "</svg>")
    assert "more than 500 lines" in refused(tmp_path, HEAD + ">" + LINE * 501 + "</svg>")
    assert "not well-formed" in refused(tmp_path, HEAD + "><path></svg>")
    assert "outermost element" in refused(tmp_path, "<html/>")
    assert "no visible lines (1 text ignored)" in refused(tmp_path, HEAD + "><text>a</text></svg>")
    huge = '<polyline fill="none" stroke="#000" points="' + "1 2 " * 600_000 + '"/>'
    assert "no visible lines" in refused(tmp_path, HEAD + ">" + huge + "</svg>")


def test_clones_of_clones_end(tmp_path: Path) -> None:
    loop = f'<g id="a"><use href="#a"/></g>{LINE}'
    assert "1 clone within clones ignored" in read(tmp_path, loop).remarks
    # Ten uses of ten uses of ten...
    levels = [f'<g id="l0">{"".join("<g/>" for _ in range(10))}</g>']
    levels += [f'<g id="l{i}">{f"<use href=`#l{i - 1}`/>".replace("`", chr(34)) * 10}</g>' for i in range(1, 7)]
    assert "with its clones" in refused(tmp_path, HEAD + ">" + "".join(levels) + LINE + "</svg>")


def test_numbers_that_are_not_finite_are_left_out(tmp_path: Path) -> None:
    body = (
        f'{LINE}<g fill="none" stroke="#000"><path d="M0 0L1e308 1e308"/><path d="M0 0C1e308 0 -1e308 1e308 1 1"/>'
        '<path transform="scale(1e200)" d="M0 0L1e200 1"/><path d="M0 0A1e-320 1 0 0 1 5 5"/><path d="Z"/>'
        '<path d="M 0 0 A 1 1 0 2 3 5 5"/><path d="M"/><path d="M 1 -"/></g>'
    )
    drawing = read(tmp_path, body)
    assert all(np.isfinite(stroke.points).all() for stroke in drawing.strokes)
