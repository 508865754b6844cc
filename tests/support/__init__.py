"""Common ground of tests: small cells and case files, and programs that run under mpirun.

`cases`, `circular_cells`, `random_cells`, `torn_cells`, `coarse_space_cells` and `sample_output` make objects of the
program; `base_case` and `sweep_files` make case files, `command_line` and `sweep_runs` run `feti-homog` on them; `jobs`
and `hooks` start programs; `ranks` holds assertions that fail on all ranks alike.
"""
