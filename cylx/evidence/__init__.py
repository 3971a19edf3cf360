"""Whether a segment is a cylinder: what is measured of it, and what that is worth."""
