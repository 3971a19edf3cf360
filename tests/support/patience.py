"""How long a test waits for a process before it counts as hung: far longer than any takes on a machine that is busy."""

PATIENCE = 900.0
"""Seconds."""
