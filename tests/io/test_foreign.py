"""Files of other kinds: what they are, and what to do with them."""

import zipfile

import pytest

from cylx.errors import InputError
from cylx.io import read_cloud

CONTENTS = {
    "OBJ, a mesh": ["scan.obj", b"# a mesh\nmtllib a.mtl\nv 1 2 3\nv 4 5 6\nv 7 8 9\nf 1 2 3\n"],
    "STL, a mesh": ["scan.stl", b"solid thing\n facet normal 0 0 1\n  outer loop\n"],
    "OFF, a mesh": ["scan.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"],
    "glTF, a mesh": ["scan.glb", "scan.gltf", b"glTF\2\0\0\0", b'{"asset": {"version": "2.0"}}'],
    "VTK": [
        "scan.vtk",
        "scan.vtp",
        b"# vtk DataFile Version 3.0\n",
        b'<?xml version="1.0"?>\n<VTKFile type="PolyData">',
    ],
    "a scan of FARO": ["scan.fls"],
    "a scan or project of Autodesk ReCap": ["scan.rcp", "scan.rcs"],
    "a scan of Zoller + Froehlich": ["scan.zfs"],
    "a scan of RIEGL": ["scan.rxp", "scan.rdbx"],
    "a CloudCompare project": [b"CCB2\0\0\0\0"],
    "DXF, a drawing": ["scan.dxf", b"  0\r\nSECTION\r\n  2\r\nHEADER\r\n", b"999\nmade by\n0\nSECTION\n2\n"],
    "DWG, a drawing": ["scan.dwg", b"AC1032\0\0"],
    "IFC, a building model": ["scan.ifc"],
    "STEP, a CAD model": ["scan.stp", b"ISO-10303-21;\nHEADER;\n"],
    "a shapefile": ["scan.shp", b"\0\0\x27\x0a\0\0\0\0"],
    "TIFF, a picture or a raster": ["scan.tif", b"II*\0\x08\0\0\0"],
    "PDF, a document": ["scan.pdf", b"%PDF-1.7\n%\xe2\xe3"],
    "JPEG, a picture": [b"\xff\xd8\xff\xe0\0\x10JFIF"],
    "PNG, a picture": [b"\x89PNG\r\n\x1a\n"],
    "a ZIP archive": ["scan.zip"],
    "a 7-Zip archive": ["scan.7z", b"7z\xbc\xaf\x27\x1c"],
    "a tar archive": ["scan.tar", b"a" * 257 + b"ustar\x0000"],
    "packed by xz": ["scan.xz", b"\xfd7zXZ\0"],
    "a ROS bag": ["scan.bag", b"#ROSBAG V2.0\n"],
    "packets of a network, as rotating scanners send them": ["scan.pcap", b"\xd4\xc3\xb2\xa1\2\0\4\0"],
    "a table of Arrow": ["scan.parquet", b"PAR1\x15\4", b"ARROW1\0\0"],
    "a raster of heights": [
        "scan.grd",
        b"ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n1 2 3\n4 5 6\n",
        b"NROWS   2\r\nNCOLS   3\r\nXLLCENTER 0\r\n",
        b"DSAA\n3 2\n0 2\n0 1\n1 6\n1 2 3\n4 5 6\n",
    ],
    "NetCDF": ["scan.nc", b"CDF\x01\0\0\0\0"],
    "a cloud or mesh packed by Draco": ["scan.drc", b"DRACO\2\2\1"],
    "HDF5": ["scan.h5", b"\x89HDF\r\n\x1a\n"],
    "a web page": ["scan.html", b"<!DOCTYPE html>\n<html>"],
    "JSON": ["scan.json", b'{"schema": "cylx.cylinders/1"}'],
    "a pointer of Git LFS, not the file itself": [b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n"],
    "a document of an office program": ["scan.xlsx", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"],
}
CASES = [(kind, example) for kind, examples in CONTENTS.items() for example in examples]


@pytest.mark.parametrize(("kind", "example"), CASES, ids=range(len(CASES)))
def test_a_file_of_another_kind_is_called_by_its_name(tmp_path, kind, example):
    by_content = isinstance(example, bytes)
    for name in ("scan", "scan.ply", "scan.las", "scan.npz", "scan.xyz") if by_content else (example, example.upper()):
        path = tmp_path / name
        path.write_bytes(example + b" " * 20 if by_content else b"1 2 3\n\0\1\2")
        with pytest.raises(InputError) as refused:
            read_cloud(path)
        assert (refused.value.fault, refused.value.exit_code) == (f"is {kind}, which cylx does not read", 3)
        assert len(str(refused.value)) < 400


def test_an_archive_of_a_document_is_no_archive_of_arrays(tmp_path):
    with zipfile.ZipFile(tmp_path / "scan.kmz", "w") as archive:
        archive.writestr("doc.kml", "<kml/>")
    with pytest.raises(InputError, match="is a map, which cylx does not read"):
        read_cloud(tmp_path / "scan.kmz")


@pytest.mark.parametrize("name", ["scan.bin", "scan.dat", "scan"])
@pytest.mark.parametrize(
    "head",
    [b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n"],
)
def test_what_cylx_reads_is_read_under_any_other_name(tmp_path, name, head):
    (tmp_path / name).write_bytes(head + b"1 2 3\n")
    assert read_cloud(tmp_path / name).points.tolist() == [[1, 2, 3]]


@pytest.mark.parametrize("text", ["v 1 2\n1 2 3\n4 5 6\n", "# o of the house\n1 2 3\n4 5 6\n", "0 1 2\n3 4 5\n"])
def test_text_is_still_text(tmp_path, text):
    (tmp_path / "scan.txt").write_text(text)
    assert len(read_cloud(tmp_path / "scan.txt").points) == 2
