"""Sizes of elements: along interfaces, around tips, in passages, and how many elements they make.

Imports `case` and `fibres`.  Main entry: `graded_size`.
"""
