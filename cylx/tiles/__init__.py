"""Clouds larger than memory: cut into tiles, each searched by itself, and joined to one result."""
