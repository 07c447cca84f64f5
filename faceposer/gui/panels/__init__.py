"""The core panels of the window, one file each."""
