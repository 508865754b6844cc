"""Paths of load: from event to event, onsets, later legs.

Imports `feti`, `interface.contact`, `interface.laws` and `interface.loads`.  Main entry: `path_following`.
"""
