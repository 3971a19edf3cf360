"""Libraries that may be missing, asked for in one way."""
