"""Key tables: value types, tables read with all their faults, fault wording.

Imports nothing.  Main entries: `values`, types each with words and a test; `keys.key`, `keys.TableReader`.
"""
