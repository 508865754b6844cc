"""Key tables: value types, tables read with all their faults, fault wording.

Imports nothing.  Main entries: `limits`; `types`, types each with words and a test; `keys.key`, `keys.TableReader`.
"""

from feti_homog.schema.keys import TableReader, key

__all__ = ["TableReader", "key", "keys", "limits", "types", "wording"]
