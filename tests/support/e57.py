"""E57 files taken apart: their XML is changed, and the checksums of all pages are written again."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

_PAGE, _PAYLOAD, _HEADER = 1024, 1020, 48
_POLYNOMIAL = 0x82F63B78  # CRC-32C, reflected


def unpaged(data: bytes) -> bytes:
    """Return the bytes of all pages without their checksums."""
    return b"".join(data[place : place + _PAYLOAD] for place in range(0, len(data), _PAGE))


def paged(logical: bytes) -> bytes:
    """Return pages with their checksums; the last is filled with zeros."""
    pages = np.frombuffer(logical.ljust(-(-len(logical) // _PAYLOAD) * _PAYLOAD, b"\0"), "u1").reshape(-1, _PAYLOAD)
    parts = np.bitwise_xor.reduce(_parts()[np.arange(_PAYLOAD), pages], axis=1) ^ _checksum_of_zeros()
    return np.hstack([pages, parts.astype(">u4").view("u1").reshape(-1, 4)]).tobytes()


def xml_of(data: bytes) -> bytes:
    """Return the XML of a file."""
    start, length = struct.unpack_from("<QQ", data, 24)
    place = start // _PAGE * _PAYLOAD + start % _PAGE
    return unpaged(data)[place : place + length]


def with_xml(data: bytes, xml: bytes) -> bytes:
    """Return a file with other XML, and with right lengths and checksums."""
    start = struct.unpack_from("<Q", data, 24)[0]
    place = start // _PAGE * _PAYLOAD + start % _PAGE
    logical = bytearray(unpaged(data)[:place] + xml)
    size = -(-len(logical) // _PAYLOAD) * _PAGE
    struct.pack_into("<QQQ", logical, 16, size, start, len(xml))
    return paged(bytes(logical))


def edited(path: Path, change: Callable[[bytes], bytes]) -> Path:
    """Change the XML of a file in place."""
    data = path.read_bytes()
    path.write_bytes(with_xml(data, change(xml_of(data))))
    return path


@cache
def _parts() -> np.ndarray:
    """Return what each byte at each place of a page adds to the checksum."""
    parts = np.empty((_PAYLOAD, 256), "u4")
    parts[-1] = _table()
    for place in range(_PAYLOAD - 2, -1, -1):
        parts[place] = (parts[place + 1] >> 8) ^ _table()[parts[place + 1] & 0xFF]
    return parts


@cache
def _checksum_of_zeros() -> int:
    crc = 0xFFFFFFFF
    for _ in range(_PAYLOAD):
        crc = int(_table()[crc & 0xFF]) ^ (crc >> 8)
    return crc ^ 0xFFFFFFFF


@cache
def _table() -> np.ndarray:
    table = np.arange(256, dtype="u4")
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ _POLYNOMIAL, table >> 1).astype("u4")
    return table
