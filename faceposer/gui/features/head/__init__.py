"""The head in the window: who the character is (docs/identity.md)."""
