"""Entry point of ``python -m faceposer``."""

from faceposer.cli import main

if __name__ == "__main__":
    main()
