"""Paths of load: from event to event, onsets, later legs.

Imports `feti`, `interface.contact`, `interface.friction`, `interface.laws`, `interface.loads` and `system`.  Main
entry: `path_following`.
"""
