"""Tests of the runs of pipe."""
