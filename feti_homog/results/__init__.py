"""Files of results, each written whole or not at all: `result.json`, `result.h5`, `result.xdmf`, tables, checkpoints.

Imports `case`, `homogenization`, `materials`, `parallel` and `runtime`.  Main entries: `field_file.FieldFile`,
`result_json.write`.
"""
