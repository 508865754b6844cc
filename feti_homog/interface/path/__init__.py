"""Paths of load: from event to event, onsets, later legs.

May use `interface.laws`.  Main entry: `path_following`.
"""
