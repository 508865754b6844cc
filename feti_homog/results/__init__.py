"""Write, check and read result files: `result.json`, `result.h5`, `result.xdmf`, tables, checkpoints; find landmarks.

Imports `case`, `fem`, `homogenization`, `materials`, `schema`, `system` and `verify`.  Main entries:
`field_file.FieldFile`, `result_json.write`, `viewed_states.read_state`.
"""

__all__ = [
    "atomic", "checkpoints", "field_file", "field_guard", "field_layout", "field_parts", "landmarks", "output_folder",
    "path_curves", "result_json", "viewed_states", "xdmf",
]  # fmt: skip
