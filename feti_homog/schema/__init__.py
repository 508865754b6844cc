"""Tables of keys: types of values, tables read with all of their faults, relations between keys, words of faults.

Imports nothing.  Main entries: `values`, types each with words and a test; `keys.key`, `keys.TableReader`, `keys.Rule`.
"""
