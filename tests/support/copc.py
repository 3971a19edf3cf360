"""A COPC file, made by hand: a LAZ file whose chunks are the nodes of an octree, and the index of the nodes."""

import io
import struct

import laspy
import lazrs
import numpy as np

INFO = struct.Struct("<5d2Q2d")
ENTRY = struct.Struct("<4iQ2i")
FIRST_RECORD, EVLRS = 375, 235


def write_copc(path, points, level=2, *, legacy=True, scale=1e-3):
    """Write points as the nodes of one level of an octree; give them in their order, and how many each node has."""
    low, half = points.min(axis=0), 0.5 * float(np.ptp(points, axis=0).max()) + scale
    keys = np.floor((points - low) / (2.0 * half / 2**level)).astype(int)
    nodes = np.unique(keys, axis=0)
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = np.full(3, scale), np.floor(low)
    header.are_points_compressed = True
    record = lazrs.LazVlr.new_for_compression(6, 0, True)
    header.vlrs.append(laspy.VLR("copc", 1, "copc info", bytes(160)))
    header.vlrs.append(laspy.VLR("laszip encoded", 22204, "", bytes(record.record_data())))
    parts = [points[(keys == node).all(axis=1)] for node in nodes]
    together = np.concatenate(parts)
    header.maxs, header.mins, header.point_count = together.max(axis=0), together.min(axis=0), len(together)
    file = io.BytesIO()
    header.write_to(file)
    start = file.tell()
    compressor = lazrs.LasZipCompressor(file, record)
    places = []
    for part in parts:
        chunk = laspy.ScaleAwarePointRecord.zeros(len(part), header=header)
        chunk.x, chunk.y, chunk.z = part.T
        places.append(file.tell())
        compressor.compress_many(np.frombuffer(chunk.array.tobytes(), np.uint8))
        compressor.finish_current_chunk()
    compressor.done()
    data = bytearray(file.getvalue())
    places[0] = start + 8  # behind the place of the table of chunks
    ends = [*places[1:], len(data)]
    index = b"".join(
        ENTRY.pack(level, *map(int, node), place, end - place, len(part))
        for node, place, end, part in zip(nodes, places, ends, parts, strict=True)
    )
    at = len(data) + 60
    struct.pack_into("<QI", data, EVLRS, len(data), 1)
    INFO.pack_into(data, FIRST_RECORD + 54, *(low + half), half, 1.0, at, len(index), 0.0, 0.0)
    data += struct.pack("<H16sHQ32s", 0, b"copc", 1000, len(index), b"hierarchy") + index
    struct.pack_into("<I", data, 107, len(together) if legacy else 0)
    path.write_bytes(data)
    return together, [len(part) for part in parts]
