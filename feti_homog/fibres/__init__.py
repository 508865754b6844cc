"""Where fibres lie: random, regular, matched and tabulated arrangements, windows cut from images.

May use `case`, `microstructure` and `errors`; `outlines`, below `case`, none of them.  Main entry: `arrange.arrange`.
"""
