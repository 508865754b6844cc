"""Where fibres lie: random, regular, matched and tabulated arrangements, their outlines, windows cut from images.

May use `case`, `microstructure` and `errors`.  Main entry: `arrangement.arrange`.
"""
