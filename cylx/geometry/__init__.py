"""Geometric shapes and the computations on them."""
