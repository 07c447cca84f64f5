"""From files to characters: rigs, example meshes, markers and performances become subjects that can be posed."""
