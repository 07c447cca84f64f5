"""The core panels of the window, one module each."""
