"""Fits of a cylinder to points, with their uncertainty."""
