"""Parts of the study of identities (scripts/study_identity.py)."""
