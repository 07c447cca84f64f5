"""The constraints: what a user can say about a face, one file per kind."""
