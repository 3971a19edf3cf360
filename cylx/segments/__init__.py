"""Fits of a segment to its points of the cloud, and how uncertain they are."""
