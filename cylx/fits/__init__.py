"""Fits of a cylinder to points, and what they say of its uncertainty."""
