"""Build ``assets/identity-landmarks.npz``: where landmarks are on the heads' skin, and how the networks err.

Run from the root of a checkout::

    python -m scripts.build_face_places              # learn the places and the errors, and write the file
    python -m scripts.build_face_places --places     # the places only, with independent errors

Heads of the morphable model are drawn, and the networks find their landmarks.
"""

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.identity.photos.face_places import FacePlaces, LandmarkErrors, read_face_places
from scripts.photo_study.errors import learn_errors
from scripts.photo_study.places import learn_places

OUTPUT = ROOT / "assets" / "identity-landmarks.npz"
CREDITS = (
    "Places of MediaPipe's landmarks (Apache-2.0 networks) on heads of the morphable model in identity.npz, and the "
    "networks' errors on renderings of such heads."
)


def main() -> None:
    """Learn and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--places", action="store_true", help="learn the places only")
    parser.add_argument("--errors", action="store_true", help="learn the errors only, at the places of the file")
    parser.add_argument("--heads", type=int, default=8, help="heads for the places")
    parser.add_argument("--photos", type=int, default=400, help="photos for the errors")
    parser.add_argument("-o", "--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    points = read_face_places(OUTPUT).points if options.errors else learn_places(options.heads)
    errors = LandmarkErrors.plain() if options.places else learn_errors(points, options.photos)
    FacePlaces(points, errors, CREDITS).save(options.output)
    print(f"{options.output} written")


if __name__ == "__main__":
    main()
