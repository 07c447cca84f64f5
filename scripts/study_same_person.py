"""Study whether fits of single photos tell that two photos show different people (docs/photo-heads.md).

Each photo is fitted alone, quickly, with a strong density of heads; the measure is the cosine between the coefficients
of two heads. Run from the root of a checkout::

    python -m scripts.study_same_person --n 40
    python -m scripts.study_same_person --n 0 --scan perry_smith.obj --photos astronaut.png grace_hopper.jpg
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.identity.photos.dense_fit import DenseFitter, DenseSettings
from faceposer.identity.photos.face_crop import FaceCrop
from faceposer.identity.photos.landmark_fit import PhotoFace, fit_landmarks
from faceposer.landmarks.points import find_landmarks
from faceposer.photo.reading import read_photo
from scripts.photo_study.scan_photos import ScanStudy
from scripts.photo_study.study import Study
from scripts.photo_study.synthetic import photo_of, picture_of, random_person, random_weights

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

# Side of synthetic photos and height of the face in the fit, in pixels; weight of the density of heads; settings.
_SIDE, _HEIGHT, _STRENGTH = 256, 140.0, 10.0
_QUICK = DenseSettings(n_samples=1500, levels=((2.0, 5), (1.0, 6)), segment_steps=0)
# Turns of the face in the two photos of a person, in radians, and of the photos of a scan.
_YAWS, _SCAN_YAW = ((-0.3, 0.3), (-0.6, 0.6)), 0.9
_FIRST_PERSON, _FIRST_SCAN = 5000, 95_000


def head_of(study: Study, pixels: Pixels) -> Array | None:
    """Return the coefficients, of length 1 in all, of the head in a photo, or None if no face is found."""
    found = find_landmarks(pixels)
    if found is None:
        return None
    height, width = pixels.shape[:2]
    crop = FaceCrop.of(PhotoFace(found, (width, height), 2.0 * max(width, height), 0.3), pixels, _HEIGHT)
    start = fit_landmarks([crop.face], study.basis, study.places, _STRENGTH)
    state = DenseFitter([crop], start, study.basis, study.samples, _QUICK).fit().state
    result: Array = state.shape / max(float(np.linalg.norm(state.shape)), 1e-9)
    return result


def synthetic_heads(study: Study, number: int) -> list[Array | None]:
    """Return the heads in two photos of the synthetic person ``number``."""
    rng = np.random.default_rng(1000 + number)
    person = random_person(study.basis.editor, study.basis.character, _FIRST_PERSON + number)
    heads = []
    for low, high in _YAWS:
        weights, yaw = random_weights(study.basis.model, rng), float(rng.uniform(low, high))
        many = np.random.default_rng(number) if study.other_lights else None
        photo = photo_of(person, study.basis.character, weights, rng, yaw, _SIDE, many=many)
        heads.append(head_of(study, photo.pixels))
    return heads


def scan_heads(study: Study, path: str, count: int) -> list[Array]:
    """Return the heads in ``count`` photos of a scan, every second one under several lamps and the sky."""
    mesh, heads = ScanStudy(study, path).mesh, []
    for number in range(count):
        rng = np.random.default_rng(_FIRST_SCAN + number)
        many = np.random.default_rng(number) if number % 2 else None
        head = head_of(study, picture_of(mesh, rng, float(rng.uniform(-_SCAN_YAW, _SCAN_YAW)), many=many)[0])
        heads += [] if head is None else [head]
    return heads


def described(same: Sequence[float], different: Sequence[float]) -> str:
    """Return the ranges of cosines of pairs of one person and of two, and the area under the curve."""
    ours, theirs = np.array(same), np.array(different)
    area = float(np.mean([(value < ours).mean() + 0.5 * (value == ours).mean() for value in theirs]))
    ranges = (f"{values.min():.2f} to {values.max():.2f}, median {np.median(values):.2f}" for values in (ours, theirs))
    return "one person {}; two people {}; AUC {:.3f} ({} and {} pairs)".format(*ranges, area, len(ours), len(theirs))


def main() -> None:
    """Print the cosines of pairs of photos of one person and of two."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=40, help="number of synthetic people")
    parser.add_argument("--first", type=int, default=5400, help="number of the first")
    parser.add_argument("--lights", choices=("phong", "other"), default="phong", help="light as of the fit, or other")
    parser.add_argument("--scan", help="photos of this scan as well, OBJ with texture")
    parser.add_argument("--scan-photos", type=int, default=6, help="number of random photos of the scan")
    parser.add_argument("--photos", type=Path, nargs="+", default=[], help="photos, each of another person")
    options = parser.parse_args()
    study = Study(options.lights == "other")
    people = [synthetic_heads(study, number) for number in range(options.first, options.first + options.n)]
    pairs = [(first, second) for first, second in people if first is not None and second is not None]
    if len(pairs) > 1:
        others = zip(pairs, [*pairs[1:], pairs[0]], strict=True)
        same = [float(first @ second) for first, second in pairs]
        print("synthetic:", described(same, [float(here[0] @ there[1]) for here, there in others]), flush=True)
    found = [(path, head_of(study, read_photo(path))) for path in options.photos]
    photos = [(path, head) for path, head in found if head is not None]
    scanned = scan_heads(study, options.scan, options.scan_photos) if options.scan else []
    for number, (path, head) in enumerate(photos):
        for other, theirs in photos[:number]:
            print(f"{other.name} and {path.name}: {float(head @ theirs):.2f}")
    if len(scanned) > 1 and photos:
        same = [float(scanned[i] @ scanned[j]) for i in range(len(scanned)) for j in range(i)]
        print("scan:", described(same, [float(head @ other) for _, head in photos for other in scanned]))


if __name__ == "__main__":
    main()
