"""Hostile inputs: `python -m hostile` tries about 240 of them, by kind, and as many more at random as it is asked."""
