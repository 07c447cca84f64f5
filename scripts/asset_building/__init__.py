"""Helpers of ``scripts/build_assets.py``: from MakeHuman's CC0 data to the characters in ``assets/characters``."""
