"""Parts of the studies: generated data and measurements of memory."""
