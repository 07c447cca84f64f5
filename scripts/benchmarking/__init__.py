"""What ``scripts/benchmark.py`` and ``scripts/compare_strokes.py`` are made of."""
