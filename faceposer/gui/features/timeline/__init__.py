"""The timeline: keys, playback and the strip below the view."""
