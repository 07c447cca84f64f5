"""Files: atomic writes, folders of the user, file names and JSON documents."""
