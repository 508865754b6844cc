"""Names of phases that mean something to the program."""

COATING = "coating"
"""The rings around fibres."""
