"""Element sizes along interfaces, around tips and in passages, and estimates of element numbers.

Imports `case` and `microstructure`.  Main entry: `graded_size`.
"""

__all__ = ["element_estimate", "graded_size"]
