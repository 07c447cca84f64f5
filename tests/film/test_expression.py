"""Expressions of films: those of a face that is known, of one that does not move, and films that need a choice."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

import faceposer
from faceposer.errors import FacePoserError
from faceposer.film import person
from faceposer.film.expression import FilmExpression, expression_of_film
from faceposer.film.film import Span
from faceposer.identity.photos.dense_fit import DenseSettings
from faceposer.model.face_model import FaceModel
from faceposer.progress import CancelledError, Progress
from tests.film.conftest import JAW
from tests.film.films import Pixels, encode, nobody, other_face, still_face


@pytest.fixture
def quick_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    """The head is refined by few steps."""
    few = DenseSettings(levels=((2.0, 3),), n_samples=800, segment_steps=0)
    monkeypatch.setattr(person, "DenseSettings", lambda **_: few)


def weights_of(found: FilmExpression, model: FaceModel, name: str) -> NDArray[np.float64]:
    weights = found.performance.weights(model)
    return weights[:, model.character.shape_names.index(name)]


landmarks_of_film = partial(expression_of_film, colours=False)


@pytest.fixture(scope="module")
def followed(frames_folder: Path, man: FaceModel) -> FilmExpression:
    """The man with the expressions of the woman who opens her mouth, by landmarks."""
    return landmarks_of_film(frames_folder, man, rate=25.0)


def test_a_mouth_that_opens_is_followed(followed: FilmExpression, man: FaceModel) -> None:
    found = followed
    assert (len(found.performance), found.performance.rate, found.first) == (len(JAW), 25.0, 0)
    jaw = weights_of(found, man, "jawOpen")
    assert np.corrcoef(jaw, JAW)[0, 1] > 0.97
    assert jaw[4] - jaw[0] > 0.15
    yaw = [frame["yaw"] for frame in found.report["frames"]]
    # The head turns by 0.3 radians, 17 degrees.
    assert 12.0 < abs(yaw[-1] - yaw[0]) < 22.0
    assert found.notes == ()


@pytest.mark.usefixtures("quick_colours")
def test_colours_follow_the_mouth_too(frames_folder: Path, man: FaceModel) -> None:
    found = expression_of_film(frames_folder, man, rate=25.0)
    assert found.report["colours"]
    jaw = weights_of(found, man, "jawOpen")
    assert np.corrcoef(jaw, JAW)[0, 1] > 0.97
    assert jaw[4] - jaw[0] > 0.25


def test_a_face_that_does_not_move_is_steady(woman: FaceModel, tmp_path: Path) -> None:
    """The camera pans and zooms over the photo of a person who smiles."""
    path = encode(tmp_path / "still.mp4", still_face(8), 30)
    found = landmarks_of_film(path, woman)
    weights = found.performance.weights(woman)
    names = woman.character.shape_names
    # As strong as from a photo, 0.59, and as few keys as a still face needs.
    assert weights[:, names.index("mouthSmileLeft")].min() > 0.5
    assert len(found.keys(woman).keys) <= 2
    assert weights[:, names.index("eyeBlinkLeft")].max() < 0.5
    assert weights.std(axis=0).max() < 0.05


def test_the_longest_shot_of_a_film_with_cuts_is_used(man: FaceModel, tmp_path: Path) -> None:
    frames = [*other_face(3), *still_face(6), *nobody(8)]
    path = encode(tmp_path / "cuts.mp4", frames, 10)
    found = landmarks_of_film(path, man)
    assert (found.first, len(found.performance)) == (3, 6)
    assert found.notes[0].startswith(
        "The film cuts at frame 3 (0.30 s), frame 9 (0.90 s); the shot that shows a face longest, from 0.30 to 0.90 s,"
    )
    other = landmarks_of_film(path, man, span=Span(0.0, 0.3))
    assert (other.first, len(other.performance), other.notes) == (0, 3, ())


def test_the_largest_of_several_faces_is_followed(man: FaceModel, tmp_path: Path) -> None:
    small = [np.asarray(Image.fromarray(frame).resize((130, 130))) for frame in other_face(4)]
    frames = []
    for large, other in zip(still_face(4), small, strict=True):
        frame = np.full((200, 340, 3), 100, dtype=np.uint8)
        frame[:, :200], frame[60:190, 205:335] = large, other
        frames.append(frame)
    found = landmarks_of_film(encode(tmp_path / "two.mp4", frames, 30), man)
    assert "The film shows 1 other face; the largest is followed." in found.notes
    assert all(face is not None and face.box[2] < 205 for face in found.track.faces)


def test_frames_that_the_film_lacks_are_not_said_to_lack_the_face(man: FaceModel, tmp_path: Path) -> None:
    frames = still_face(4)
    path = encode(tmp_path / "gap.mkv", frames, 10, times=[0.0, 0.1, 0.2, 0.6])
    found = landmarks_of_film(path, man, rate=10.0)
    assert len(found.performance) == 7
    assert any(note.startswith("The film lacks 3 of 7 frames, first at 0.30 s;") for note in found.notes)
    assert not any("the face is not seen" in note for note in found.notes)


def test_frames_without_the_face_are_bridged(
    followed: FilmExpression, speaking: list[Pixels], man: FaceModel, tmp_path: Path
) -> None:
    for k, pixels in enumerate(speaking):
        if k != 5:
            Image.fromarray(pixels).save(tmp_path / f"{k}.png")
    hidden = speaking[5].copy()
    hidden[90:180, 85:160] = (150, 120, 105)
    Image.fromarray(hidden).save(tmp_path / "5.png")
    found = landmarks_of_film(tmp_path, man, rate=25.0)
    assert any("In 1 of 9 frames the face is not seen" in note for note in found.notes)
    jaw, expected = weights_of(found, man, "jawOpen"), weights_of(followed, man, "jawOpen")
    assert abs(jaw[5] - expected[5]) < 0.15


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        (nobody(3), r"No face was found in '.*a\.mp4'; use a film in which a face is larger and seen from the front"),
        (
            [np.asarray(Image.fromarray(frame).resize((48, 48))) for frame in other_face(3)],
            r"The face in '.*a\.mp4' is \d+ pixels high in most frames, and at least 60 are needed|No face was found",
        ),
    ],
)
def test_films_without_a_face_are_refused(frames: list[Pixels], message: str, man: FaceModel, tmp_path: Path) -> None:
    path = encode(tmp_path / "a.mp4", frames, 10)
    with pytest.raises(FacePoserError, match=message):
        landmarks_of_film(path, man)


def test_characters_without_shapes_are_refused_before_the_film_is_read(creature: FaceModel) -> None:
    with pytest.raises(FacePoserError, match=r"has none of ARKit's shapes, to which expressions of films are given"):
        landmarks_of_film(Path("none.mp4"), creature)


def test_the_work_can_be_cancelled(frames_folder: Path, man: FaceModel) -> None:
    seen: list[str] = []

    def cancelled() -> bool:
        return "Following the expression" in seen

    with pytest.raises(CancelledError):
        landmarks_of_film(frames_folder, man, progress=Progress(lambda stage, _: seen.append(stage), cancelled))
    assert seen[0] == "Finding the face"


def test_one_bar_is_shown_over_all_steps(frames_folder: Path, man: FaceModel) -> None:
    shown: list[tuple[str, float]] = []
    progress = Progress(lambda stage, share: shown.append((stage, share)))
    landmarks_of_film(frames_folder, man, span=Span(0.0, 0.1), rate=25.0, progress=progress)
    shares = [share for _, share in shown]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len({stage for stage, _ in shown}) >= 4


def test_python_follows_films_and_warns_of_what_was_assumed(frames_folder: Path) -> None:
    face = faceposer.load("man")
    with pytest.warns(faceposer.FacePoserWarning, match=r"speaking.*30 frames per second were assumed"):
        performance = face.follow_film(frames_folder, end=0.15, colours=False)
    assert (len(performance), performance.rate) == (4, 30.0)
    face.play(performance)
    assert face.performance is not None
    with pytest.raises(FacePoserError, match=r"The end of the part, 1 s, is not after its start, 2 s"):
        face.follow_film(frames_folder, start=2.0, end=1.0)
