"""A reader of piping component files, written from the description of the format, not from what cylx writes.

A line that begins in the first column is a keyword of the file or names a component. Lines with blanks before them
belong to the component above. A point is three coordinates, and an end also has a bore.
"""

from dataclasses import dataclass, field

import numpy as np

COMPONENTS = {
    "PIPE": 2, "ELBOW": 2, "TEE": 2, "CROSS": 2, "REDUCER-CONCENTRIC": 2, "REDUCER-ECCENTRIC": 2, "FLANGE": 2,
    "CAP": 2, "VALVE": 2,
}  # fmt: skip
"""Number of END-POINTs of each."""
POINTS = {"END-POINT": 4, "CENTRE-POINT": 3, "BRANCH1-POINT": 4, "BRANCH2-POINT": 4}
"""Numbers behind each point."""


@dataclass
class Component:
    kind: str
    ends: list = field(default_factory=list)
    bores: list = field(default_factory=list)
    points: dict = field(default_factory=dict)
    branches: list = field(default_factory=list)
    values: dict = field(default_factory=dict)

    @property
    def places(self):
        """All places where something may be joined."""
        return [*self.ends, *(place for place, _ in self.branches)]


def read_pcf(data):
    """Give the header, and the components of each pipeline."""
    text = data.decode("ascii")
    assert text.endswith("\r\n")
    header, pipelines, here = {}, {}, None
    for line in text.split("\r\n")[:-1]:
        assert line, "an empty line"
        assert line.isprintable(), line
        keyword, _, rest = line.strip().partition(" ")
        if line[0] != " ":
            if keyword == "PIPELINE-REFERENCE":
                assert rest, "a pipeline without a name"
                assert rest not in pipelines, rest
                here = pipelines[rest] = []
            elif here is None:
                header[keyword] = rest
            else:
                assert keyword in COMPONENTS, line
                assert not rest, line
                here.append(Component(keyword))
        elif keyword in POINTS:
            numbers = [float(number) for number in rest.split()]
            assert len(numbers) == POINTS[keyword], line
            own = here[-1]
            if keyword == "END-POINT":
                own.ends.append(np.array(numbers[:3]))
                own.bores.append(numbers[3])
            elif keyword.startswith("BRANCH"):
                own.branches.append((np.array(numbers[:3]), numbers[3]))
            else:
                own.points[keyword] = np.array(numbers)
        else:
            assert keyword not in here[-1].values, line
            here[-1].values[keyword] = rest
    for own in pipelines.values():
        assert all(len(one.ends) == COMPONENTS[one.kind] for one in own)
    return header, pipelines
