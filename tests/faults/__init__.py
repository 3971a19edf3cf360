"""Faults on purpose: failing disks, changed inputs, killed runs."""
