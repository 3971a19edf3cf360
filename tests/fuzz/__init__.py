"""Fuzzing: mutated inputs for everything that reads what others wrote.

`python -m tests.fuzz.run` runs it; what is neither a success nor a documented error is a defect.
"""
