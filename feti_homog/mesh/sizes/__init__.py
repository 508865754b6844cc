"""Sizes of elements: along interfaces, around tips, in passages, and how many elements they make.

Imports `case` and `microstructure`.  Main entry: `graded_size`.
"""

__all__ = ["element_estimate", "graded_size"]
