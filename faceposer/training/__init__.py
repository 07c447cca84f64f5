"""From files to characters: rigs, example meshes, markers and performances become characters that can be posed."""
