"""Parts of the studies: made data, and measurements of memory."""
