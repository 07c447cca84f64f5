"""Reading and writing files safely: atomic writes, user folders, JSON documents."""
