"""Limit the entries of case files and their tables, so that each is checked in less than ten seconds."""

BYTES = 1 << 22  # of a case file: tomllib reads 1 to 3 MB a second
KEYS, ENTRIES = 10_000, 100_000  # of a table, of a list
FIBRES, ROWS = 100_000, 200_000  # in a cell, with as many voids; in a table, which has both
INTERFACES, ARCS, WAYPOINTS = 1000, 10_000, 10_000  # pairs among 45 phases; 50 us each
CASES, TESTS, NUMBERS, POINTS = 10_000, 1000, 1000, 10_000  # of sweeps, 0.5 ms each; of fits; uncertain; of a curve
