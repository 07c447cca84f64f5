"""Training: characters from rigs, example meshes, marker motion and performances."""
