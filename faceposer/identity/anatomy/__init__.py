"""Parts of a head: lids and eyeballs, lashes, jaw and mouth, and the maps that carry expressions between heads."""
