"""Mutators: they change a few bytes, numbers, words or lines of an input, and know little of its format."""

import re
import struct

NUMBERS = re.compile(rb"-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
ODD_NUMBERS = (
    b"0", b"-0", b"-1", b"1", b"2", b"3", b"255", b"256", b"65535", b"65536", b"2147483647", b"2147483648",
    b"4294967295", b"4294967296", b"9223372036854775807", b"9223372036854775808", b"18446744073709551616", b"1e308",
    b"1e309", b"-1e309", b"1e999", b"1e-400", b"nan", b"inf", b"-inf", b"NaN", b"1.#QNAN", b"-nan(ind)", b"1,5",
    b"1.5.5", b"0x10", b"1_000", b"1e", b".", b"-", b"+", b"\xef\xbc\x91", b"True", b"None", b"", b"9" * 31,
    b"9" * 400, b"9" * 5000,
)  # fmt: skip
ODD_INTEGERS = (0, 1, 2, 3, 4, 7, 8, 127, 128, 255, 256, 32767, 65535, 65536, (1 << 31) - 1, 1 << 31, (1 << 32) - 1)
ODD_DOUBLES = (0.0, -0.0, 1e-320, 1e300, -1e300, float("inf"), float("nan"), 1.0, -1.0)
WORDS = (
    b"#", b"//", b"\"", b"'", b",", b";", b"\t", b"|", b":", b"\r", b"\r\n", b"\n\n", b"\0", b"\xff\xfe",
    b"\xef\xbb\xbf", b"x", b"y", b"z", b"X", b"Points:0", b"Easting", b"Northing", b"Elevation", b"id", b"_",
    b"nan", b"null", b"true", b"{", b"}", b"[", b"]", b"&a", b"*a", b"!!python/object", b"\\U", b"\\UFFFFFFFF",
    b"\\ud800", b"\\x00", b"%", b"---", b"list", b"property", b"element", b"end_header", b"COUNT", b"DATA ascii",
    b"DATA binary", b"FIELDS x y z", b"[m]", b"(m)", b"\xc3\xa4", b"\xe4", b"\xf0\x9f\x98\x80", b"\x1b[31m",
    b"=1+1", b"__class__", b"'|O'", b"'<f8'", b"(3,)",
)  # fmt: skip


def mutate(rng, data, others):
    """Return an input with one to four changes.

    Parameters
    ----------
    rng : random.Random
    data : bytes
    others : sequence of bytes
        Inputs to take pieces from.
    """
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 4))):
        data = rng.choice(MUTATORS)(rng, data, others)
    return data[:MOST]


MOST = 20_000
"""Bytes of an input."""


def _place(rng, data):
    # headers stand at the beginning and tables at the end: changes there tell most
    kind = rng.random()
    size = len(data)
    if kind < 0.3:
        return rng.randrange(min(size, 400) + 1)
    return size - rng.randrange(min(size, 64) + 1) if kind < 0.4 else rng.randrange(size + 1)


def flip(rng, data, _others):
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4, 8)) if out else 0):
        place = min(_place(rng, data), len(out) - 1)
        out[place] = rng.randrange(256) if rng.random() < 0.5 else out[place] ^ (1 << rng.randrange(8))
    return bytes(out)


def truncate(rng, data, _others):
    return data[: _place(rng, data)]


def delete(rng, data, _others):
    place = _place(rng, data)
    return data[:place] + data[place + rng.choice((1, 1, 2, 4, 8, 16, 54, 64)) :]


def repeat(rng, data, _others):
    place = _place(rng, data)
    part = data[place : place + rng.choice((1, 2, 4, 8, 16, 64, 192))]
    return data[:place] + part * rng.choice((2, 2, 3, 30)) + data[place + len(part) :]


def splice(rng, data, others):
    other = rng.choice(others)
    return data[: _place(rng, data)] + other[_place(rng, other) :]


def word(rng, data, _others):
    place = _place(rng, data)
    return data[:place] + rng.choice(WORDS) + data[place + rng.choice((0, 0, 1, 4)) :]


def number(rng, data, _others):
    found = list(NUMBERS.finditer(data[:MOST]))
    if not found:
        return data
    one = rng.choice(found[: rng.choice((8, len(found)))])
    return data[: one.start()] + rng.choice(ODD_NUMBERS) + data[one.end() :]


def integer(rng, data, _others):
    kind = rng.choice("BHIQ")
    value = rng.choice(ODD_INTEGERS) if rng.random() < 0.8 else rng.getrandbits(64)
    new = struct.pack(f"{rng.choice('<>')}{kind}", value % (1 << 8 * struct.calcsize(f"<{kind}")))
    place = _place(rng, data)
    return data[:place] + new + data[place + len(new) :]


def double(rng, data, _others):
    new = struct.pack(f"{rng.choice('<>')}{rng.choice('fd')}", rng.choice((0.0, 1.0, float("inf"), float("nan"))))
    if rng.random() < 0.5:
        new = struct.pack("<d", rng.choice(ODD_DOUBLES))
    place = _place(rng, data)
    return data[:place] + new + data[place + len(new) :]


def line(rng, data, others):
    lines = data.split(b"\n")
    place, kind = rng.randrange(min(len(lines), rng.choice((12, len(lines))))), rng.random()
    if kind < 0.3:
        lines.insert(place, lines[rng.randrange(len(lines))])
    elif kind < 0.6:
        del lines[place]
    elif kind < 0.8:
        other = rng.randrange(len(lines))
        lines[place], lines[other] = lines[other], lines[place]
    else:
        lines.insert(place, rng.choice(rng.choice(others).split(b"\n")))
    return b"\n".join(lines)


def token(rng, data, _others):
    parts = re.split(rb"([\s,;:]+)", data[:MOST])
    place, other = (rng.randrange(len(parts)) for _ in range(2))
    if rng.random() < 0.5:
        parts[place] = parts[other]
    else:
        parts[place] = rng.choice(WORDS)
    return b"".join(parts)


MUTATORS = (
    flip, flip, truncate, delete, repeat, splice, word, word, number, number, number, integer, integer, double, line,
    line, token, token,
)  # fmt: skip
