"""The pose library: named poses in files of a folder."""
