"""Animations and trajectories read from files, and key reduction."""
