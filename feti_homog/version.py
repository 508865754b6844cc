"""The program version."""

__version__ = "1.0.0"
