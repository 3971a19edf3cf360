"""The version of cylx, as written to results, tables and files."""

__version__ = "0.1.0"
