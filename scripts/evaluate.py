#!/usr/bin/env python3
"""Compare the prior with other techniques on unseen expressions: ``faceposer evaluate``.

FACEPOSER_CAPTURES=FOLDER python scripts/evaluate.py --output evaluation
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.cli import main

if __name__ == "__main__":
    main(["evaluate", *sys.argv[1:]])
