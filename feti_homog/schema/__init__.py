"""Define value types, a reader that collects all faults of a table, and the wording of faults.

Imports nothing.  Main entries: `types` (value types and limits), `keys.key`, `keys.TableReader`.
"""

from feti_homog.schema.keys import TableReader, key

__all__ = ["TableReader", "key", "keys", "types", "wording"]
