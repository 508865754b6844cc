"""Files of results, each written whole or not at all: `result.json`, `result.h5`, `result.xdmf`, tables, checkpoints.

May use `homogenization` and the floors below it.  Main entries: `field_file.FieldFile`, `result_json.write`.
"""
