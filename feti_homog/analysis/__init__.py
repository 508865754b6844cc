"""Analyses of a torn cell, a module each, found by `registry`; `context` has what they share.

May use every floor but `sweep`, `cli` and `api`.  Main entry: `runner.run` (with files) and `runner.compute` (without).
"""
