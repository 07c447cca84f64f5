"""Key poses for cloning by examples in the window (docs/transfer.md)."""
