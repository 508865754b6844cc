"""Tables of keys: what each key accepts and means, tables read with all of their faults, and the words of faults.

May use `errors` and `typing`.  Main entries: `keys.key`, `keys.TableReader`; `values` has the types of values.
"""
