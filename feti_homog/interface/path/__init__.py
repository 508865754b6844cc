"""Paths of load: from event to event, onsets, later legs.

Imports `feti`, `interface`, `interface.contact`, `interface.friction`, `interface.laws` and `system`.  Main entry:
`path_following`.
"""
