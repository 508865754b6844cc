"""What is asked of a torn cell: its stiffness, its response to debonding angles, or a path of strain.

May use every floor but `sweep`, `cli` and `api`.  Main entry: `runner.run` (with files) and `runner.compute` (without).
"""
