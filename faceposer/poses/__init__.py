"""A library of named poses, kept as plain files in a folder."""
