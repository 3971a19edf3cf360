"""Runs of pipes in a room, with elbows, tees, reducers, flanges, valves and caps, as scanners see them."""

from cylx.synthetic.plant.piping import piping

__all__ = ["piping"]
