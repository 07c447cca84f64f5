"""Rendering with OpenGL: the face, offscreen images, films. No window system."""
