"""Rendering with OpenGL, without a window system: the face, offscreen images and videos."""
