"""What judging the prior is made of: its rivals, the tests, and the numbers (see ../evaluate.py)."""
