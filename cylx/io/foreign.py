"""Files that cylx does not read, told by their first bytes or their suffix, and what to do with each."""

from __future__ import annotations

import re
from typing import NamedTuple

_EXPORT = "export the points as E57, PLY or LAS from the program that wrote it"
_SAMPLE = "sample points on its surface, for example in CloudCompare, and save them as PLY"
_PACKED = "unpack it, and give the file in it"
_PICTURE = "give the scan it was made from"


class Foreign(NamedTuple):
    """What a file is, and what to do with it."""

    name: str
    remedy: str


_OBJ = Foreign("OBJ, a mesh", _SAMPLE)
_STL = Foreign("STL, a mesh", _SAMPLE)
_OFF = Foreign("OFF, a mesh", _SAMPLE)
_GLTF = Foreign("glTF, a mesh", _SAMPLE)
_FBX = Foreign("FBX, a mesh", _SAMPLE)
_VTK = Foreign("VTK", "save the points as PLY or CSV in ParaView")
_FARO = Foreign("a scan of FARO", _EXPORT)
_RECAP = Foreign("a scan or project of Autodesk ReCap", "export it as E57 or PTS from ReCap")
_ZF = Foreign("a scan of Zoller + Froehlich", _EXPORT)
_RIEGL = Foreign("a scan of RIEGL", "export it as LAS from RiSCAN PRO")
_CC = Foreign("a CloudCompare project", "save the cloud as PLY in CloudCompare")
_DXF = Foreign("DXF, a drawing", "export the points as PLY or text")
_DWG = Foreign("DWG, a drawing", "export the points as PLY or text")
_IFC = Foreign("IFC, a building model", _SAMPLE)
_STEP = Foreign("STEP, a CAD model", _SAMPLE)
_SHP = Foreign("a shapefile", "export its points as CSV or LAS")
_TIFF = Foreign("TIFF, a picture or a raster", "convert a raster of heights to text of x y z")
_PDF = Foreign("PDF, a document", _PICTURE)
_ZIP = Foreign("a ZIP archive", _PACKED)
_SEVEN = Foreign("a 7-Zip archive", _PACKED)
_RAR = Foreign("a RAR archive", _PACKED)
_BZIP = Foreign("packed by bzip2", _PACKED)
_XZ = Foreign("packed by xz", _PACKED)
_ZSTD = Foreign("packed by Zstandard", _PACKED)
_TAR = Foreign("a tar archive", _PACKED)
_OFFICE = Foreign("a document of an office program", "save the sheet as CSV")
_PICTURES = Foreign("a picture", _PICTURE)
_VIDEO = Foreign("a film", _PICTURE)
_BAG = Foreign("a ROS bag", "write a message of it as PCD, for example with 'ros2 bag' and pcl_ros")
_PCAP = Foreign("packets of a network, as rotating scanners send them", "export frames as PCD, PLY or CSV")
_HDF = Foreign("HDF5", "save the points as NPY")
_MATLAB = Foreign("a file of MATLAB", "save the points as text or PLY")
_SQLITE = Foreign("a database of SQLite", "export the points as CSV")
_HTML = Foreign("a web page", "download the scan itself")
_XML = Foreign("XML", "export the points as PLY")
_JSON = Foreign("JSON", "give the scan, not a result of cylx or other data")
_ARROW = Foreign("a table of Arrow", "save it as CSV")
_GRID = Foreign("a raster of heights", "convert it to text of x y z")
_NETCDF = Foreign("NetCDF", "save the points as NPY")
_DRACO = Foreign("a cloud or mesh packed by Draco", "decode it to PLY with 'draco_decoder'")
_LFS = Foreign("a pointer of Git LFS, not the file itself", "fetch it by 'git lfs pull'")
_PROGRAM = Foreign("a program", "give a scan")

BY_SUFFIX = {
    **dict.fromkeys((".obj",), _OBJ),
    **dict.fromkeys((".stl",), _STL),
    **dict.fromkeys((".off",), _OFF),
    **dict.fromkeys((".gltf", ".glb"), _GLTF),
    **dict.fromkeys((".fbx",), _FBX),
    **dict.fromkeys((".3ds", ".dae", ".3mf", ".wrl", ".x3d", ".usd", ".usdz", ".blend"), Foreign("a mesh", _SAMPLE)),
    **dict.fromkeys((".vtk", ".vtp", ".vtu", ".vti", ".vts", ".vtr", ".pvd", ".vtkhdf"), _VTK),
    **dict.fromkeys((".fls", ".fws", ".lsproj", ".xyb"), _FARO),
    **dict.fromkeys((".rcp", ".rcs"), _RECAP),
    **dict.fromkeys((".zfs", ".zfprj", ".zfc"), _ZF),
    **dict.fromkeys((".rxp", ".rdb", ".rdbx", ".3dd", ".sdw", ".rsp"), _RIEGL),
    **dict.fromkeys((".bin",), Foreign("a binary file of CloudCompare or of a driver", "save the points as PLY")),
    **dict.fromkeys((".dxf",), _DXF),
    **dict.fromkeys((".dwg",), _DWG),
    **dict.fromkeys((".ifc", ".ifczip", ".ifcxml"), _IFC),
    **dict.fromkeys((".step", ".stp"), _STEP),
    **dict.fromkeys((".iges", ".igs"), Foreign("IGES, a CAD model", _SAMPLE)),
    **dict.fromkeys((".rvt", ".skp", ".3dm", ".nwd", ".dgn", ".sat"), Foreign("a CAD model", _SAMPLE)),
    **dict.fromkeys((".shp", ".shx", ".dbf"), _SHP),
    **dict.fromkeys((".gpkg", ".geojson", ".kml", ".kmz"), Foreign("a map", "export its points as CSV or LAS")),
    **dict.fromkeys((".tif", ".tiff"), _TIFF),
    **dict.fromkeys((".exr", ".hdr", ".jpg", ".jpeg", ".png", ".bmp", ".gif", ".webp", ".heic", ".svg"), _PICTURES),
    **dict.fromkeys((".mp4", ".avi", ".mov", ".mkv"), _VIDEO),
    **dict.fromkeys((".pdf",), _PDF),
    **dict.fromkeys((".zip",), _ZIP),
    **dict.fromkeys((".7z",), _SEVEN),
    **dict.fromkeys((".rar",), _RAR),
    **dict.fromkeys((".bz2",), _BZIP),
    **dict.fromkeys((".xz", ".lzma"), _XZ),
    **dict.fromkeys((".zst",), _ZSTD),
    **dict.fromkeys((".tar", ".tgz"), _TAR),
    **dict.fromkeys((".xls", ".xlsx", ".ods", ".doc", ".docx", ".odt"), _OFFICE),
    **dict.fromkeys((".bag", ".mcap", ".db3"), _BAG),
    **dict.fromkeys((".pcap", ".pcapng"), _PCAP),
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), _HDF),
    **dict.fromkeys((".mat",), _MATLAB),
    **dict.fromkeys((".html", ".htm"), _HTML),
    **dict.fromkeys((".json",), _JSON),
    **dict.fromkeys((".pod", ".cl3", ".clr", ".imp", ".pcg", ".dp"), Foreign("a scan of another program", _EXPORT)),
    **dict.fromkeys((".bpf", ".sbet", ".pts.bin"), Foreign("a scan of another program", _EXPORT)),
    **dict.fromkeys((".pkl", ".pickle", ".pt", ".pth"), Foreign("Python objects", "save the points by numpy.save")),
    **dict.fromkeys((".parquet", ".feather", ".arrow"), _ARROW),
    **dict.fromkeys((".grd", ".dem"), _GRID),
    **dict.fromkeys((".nc",), _NETCDF),
    **dict.fromkeys((".drc",), _DRACO),
}
"""Suffixes in lower case."""
_MAGIC = (
    (b"# vtk DataFile", _VTK),
    (b"%PDF", _PDF),
    (b"7z\xbc\xaf\x27\x1c", _SEVEN),
    (b"Rar!", _RAR),
    (b"BZh", _BZIP),
    (b"\xfd7zXZ\0", _XZ),
    (b"\x28\xb5\x2f\xfd", _ZSTD),
    (b"\xff\xd8\xff", Foreign("JPEG, a picture", _PICTURE)),
    (b"\x89PNG", Foreign("PNG, a picture", _PICTURE)),
    (b"GIF8", _PICTURES),
    (b"II*\0", _TIFF),
    (b"MM\0*", _TIFF),
    (b"glTF", _GLTF),
    (b"Kaydara FBX", _FBX),
    (b"ISO-10303-21", _STEP),
    (b"AC10", _DWG),
    (b"CCB2", _CC),
    (b"#ROSBAG", _BAG),
    (b"\x89MCAP", _BAG),
    (b"\xd4\xc3\xb2\xa1", _PCAP),
    (b"\xa1\xb2\xc3\xd4", _PCAP),
    (b"\x0a\x0d\x0d\x0a", _PCAP),
    (b"\x89HDF", _HDF),
    (b"MATLAB 5", _MATLAB),
    (b"SQLite format 3", _SQLITE),
    (b"\xd0\xcf\x11\xe0", _OFFICE),
    (b"\x00\x00\x27\x0a", _SHP),
    (b"PAR1", _ARROW),
    (b"ARROW1", _ARROW),
    (b"FEA1", _ARROW),
    (b"CDF\x01", _NETCDF),
    (b"CDF\x02", _NETCDF),
    (b"CDF\x05", _NETCDF),
    (b"DRACO", _DRACO),
    (b"DSAA", _GRID),
    (b"DSBB", _GRID),
    (b"DSRB", _GRID),
    (b"version https://git-lfs", _LFS),
    (b"\x7fELF", _PROGRAM),
    (b"COFF\n", _OFF),
    (b"OFF\n", _OFF),
    (b"OFF\r", _OFF),
)
_HTML_START = re.compile(rb"\s*<(!doctype html|html)", re.IGNORECASE)
_GRID_START = re.compile(rb"n(cols|rows)[ \t]+\d+\s+n(cols|rows)[ \t]+\d", re.IGNORECASE)
_VERTEX = re.compile(rb"^v([ \t]+[-+.\d][-+.\deE]*){3}", re.MULTILINE)
_FACE = re.compile(rb"^(f[ \t]+\d|vn[ \t]|vt[ \t]|mtllib[ \t]|o[ \t]|g[ \t])", re.MULTILINE)
_DXF_START = re.compile(rb"\s*(0|999[\r\n].*?)\s*[\r\n]+\s*(0\s*[\r\n]+\s*)?SECTION", re.DOTALL)


def foreign_suffix(suffix: str) -> Foreign | None:
    """Return what a file with this suffix is, if it is none that cylx reads.

    Examples
    --------
    >>> foreign_suffix(".stl").name
    'STL, a mesh'
    """
    return BY_SUFFIX.get(suffix)


def foreign_content(head: bytes) -> Foreign | None:
    """Return what a file that begins with these bytes is, if it is none that cylx reads.

    Parameters
    ----------
    head : bytes
        The first bytes of the file, a thousand or so.

    Examples
    --------
    >>> foreign_content(b"%PDF-1.7").name
    'PDF, a document'
    """
    for beginning, foreign in _MAGIC:
        if head.startswith(beginning):
            return foreign
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if text.startswith(b"ISO-10303-21"):
        return _STEP
    if text.startswith(b"solid") and b"facet" in text:
        return _STL
    if _HTML_START.match(text):
        return _HTML
    if _GRID_START.match(text):
        return _GRID
    if text.startswith((b"<?xml", b"<VTKFile")):
        return _VTK if b"<VTKFile" in text else _XML
    if text.startswith((b'{"', b"{\n", b"{\r", b"[{", b"{ ")):
        return _GLTF if b'"asset"' in text else _JSON
    if text.startswith(b"#VRML"):
        return Foreign("VRML, a mesh", _SAMPLE)
    if head[257:262] == b"ustar":
        return _TAR
    vertices = len(_VERTEX.findall(text))
    if vertices > 1 or (vertices == 1 and _FACE.search(text)):
        return _OBJ
    return _DXF if _DXF_START.match(text[:200]) else None
