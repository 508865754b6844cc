"""Commands of the command line that bring their own options, a module each.

May use `api` and all floors below it.  Main entry: `add` of each module, which `cli` calls.
"""
