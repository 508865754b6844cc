"""Limit the entries of case files and their tables, so that each is checked in less than ten seconds."""

BYTES = 1 << 22  # of a case file: tomllib reads 1 to 3 MB a second
KEYS, ENTRIES = 10_000, 100_000  # of a table, of a list
FIBRES = 100_000  # in a cell, with as many voids: twice as many rows of a table
ROWS = 10_000  # arcs, waypoints, points of a curve, cases of a sweep: 50 to 500 us each
SECTIONS = 1000  # [[interface]], for pairs among 45 phases; [[test]]; uncertain numbers
PIXELS = 100 * FIBRES  # of an image: two triangles each
