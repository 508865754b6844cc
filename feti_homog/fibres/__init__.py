"""Places of fibres: random, regular, matched and tabulated arrangements, windows cut from images.

Imports `case`, `fibres.outlines` and `microstructure`.  Main entry: `arrange.arrange`.
"""
