"""The library of poses."""
