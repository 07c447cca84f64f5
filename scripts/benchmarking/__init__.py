"""Parts of ``scripts/benchmark.py`` and ``scripts/compare_strokes.py``."""
