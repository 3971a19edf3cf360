"""The version of cylx: what results, tables and files say they were made by."""

__version__ = "0.1.0"
