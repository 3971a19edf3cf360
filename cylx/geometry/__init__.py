"""Shapes and their laws: arrays in, shapes out."""
