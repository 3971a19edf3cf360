"""XML of E57 files that would make the library read files, ask the network or never end."""

import struct
import time

import numpy as np
import pye57
import pytest

from cylx.errors import InputError
from cylx.io import read_cloud
from cylx.io.e57_xml import check_xml
from cylx.io.inputs import open_input
from tests.support.e57 import with_xml, xml_of

POINTS = np.random.default_rng(0).uniform(0, 1, (50, 3))
DTD = b'<!DOCTYPE e57Root [<!ENTITY a SYSTEM "file:///etc/hostname">]>'
XSI = b'xmlns:q="http://www.w3.org/2001/XMLSchema-instance"'
LAUGHS = b"<!DOCTYPE e57Root [<!ENTITY l0 'lol'>%s]>" % b"".join(
    b"<!ENTITY l%d '%s'>" % (level, b"&l%d;" % (level - 1) * 10) for level in range(1, 12)
)
MISTRUST = "do not trust the file; export it again with other software"
DOCTYPE = f"its XML has a DOCTYPE or an entity, which E57 does not use; {MISTRUST}"
SCHEMA = f"its XML names the place of a schema, which E57 does not use; {MISTRUST}"
NO_TEXT = "broken E57: its XML is no text in UTF-8; get a complete copy of the file"


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    path = tmp_path_factory.mktemp("plain") / "scan.e57"
    with pye57.E57(str(path), mode="w") as file:
        file.write_scan_raw({f"cartesian{axis}": POINTS[:, place] for place, axis in enumerate("XYZ")})
    return path.read_bytes()


def fault_of(tmp_path, data):
    (tmp_path / "scan.e57").write_bytes(data)
    with pytest.raises(InputError) as refused:
        read_cloud(tmp_path / "scan.e57")
    return str(refused.value).removeprefix(f"{tmp_path / 'scan.e57'}: ")


def parts(data):
    declaration, end, rest = xml_of(data).partition(b"?>")
    return declaration + end, rest


@pytest.mark.parametrize(
    ("before", "message"),
    {
        "a DOCTYPE": (DTD, DOCTYPE),
        "in small letters": (DTD.lower(), DOCTYPE),
        "after a comment": (b"<!-- <!-- -->\n" + DTD, DOCTYPE),
        "after an instruction that looks like a comment": (b"<?p <!-- ?>" + DTD + b"<!-- -->", DOCTYPE),
        "after a comment that looks like an instruction": (b"<!-- <? -->" + DTD + b"<?p ?>", DOCTYPE),
        "across pages": (b" " * 700 + DTD * 9, DOCTYPE),
        "entities of entities": (LAUGHS, DOCTYPE),
        "an entity alone": (b"<!ENTITY a 'b'>", DOCTYPE),
    }.values(),
)
def test_a_doctype_is_refused(tmp_path, plain, before, message):
    declaration, rest = parts(plain)
    assert fault_of(tmp_path, with_xml(plain, declaration + before + rest)) == message
    assert fault_of(tmp_path, with_xml(plain, before + rest)) == message
    assert fault_of(tmp_path, with_xml(plain, b"\xef\xbb\xbf" + declaration + before + rest)) == message


@pytest.mark.parametrize(
    "encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-le", "utf-32-be", "cp037", "utf-7"]
)
def test_an_encoding_that_hides_a_doctype_is_refused(tmp_path, plain, encoding):
    _, rest = parts(plain)
    text = (f'<?xml version="1.0" encoding="{encoding}"?>'.encode() + DTD + rest).decode()
    assert fault_of(tmp_path, with_xml(plain, text.encode(encoding))) == NO_TEXT
    # hidden from a reader that believes the bytes rather than their declaration
    hidden = f'<?xml version="1.0" encoding="{encoding}"?>+ADwAIQ-DOCTYPE a []+AD4-'.encode()
    assert fault_of(tmp_path, with_xml(plain, hidden + rest)) == NO_TEXT


@pytest.mark.parametrize(
    "declared",
    [
        b'<?xml version="1.0" a="?" encoding="utf-7"?>',
        b'<?xml version="1.0" encoding="utf-8" encoding="utf-7"?>',
        b'<?xml version="1.0" encoding=utf-7?>',
        b'<?xml version="1.0" ENCODING="utf-7"?>',
        b"<?xml\n version=\"1.0\"\n encoding\n=\n'utf-7'?>",
    ],
)
def test_a_declaration_that_hides_its_encoding_is_refused(tmp_path, plain, declared):
    assert fault_of(tmp_path, with_xml(plain, declared + b"+ADwAIQ-DOCTYPE a []+AD4-" + parts(plain)[1])) == NO_TEXT


def test_what_only_looks_like_a_declaration_declares_nothing(tmp_path, plain):
    xml = b'<?xmll version="1.0" encoding="iso-8859-1"?><e57Root>\xdf</e57Root>'
    assert fault_of(tmp_path, with_xml(plain, xml)) == NO_TEXT


@pytest.mark.parametrize("declared", [b"", b'<?xml version="1.0"?>', b"<?xml version='1.0' encoding='utf-8' ?>"])
def test_honest_declarations(tmp_path, plain, declared):
    (tmp_path / "scan.e57").write_bytes(with_xml(plain, declared + parts(plain)[1]))
    assert len(read_cloud(tmp_path / "scan.e57").points) == len(POINTS)


@pytest.mark.parametrize("name", [b"schemaLocation", b"noNamespaceSchemaLocation"])
def test_the_place_of_a_schema_is_refused(tmp_path, plain, name):
    declaration, rest = parts(plain)
    root = b'<e57Root %s q:%s \n = "http://www.astm.org/COMMIT http://localhost:1/x.xsd" ' % (XSI, name)
    assert fault_of(tmp_path, with_xml(plain, declaration + rest.replace(b"<e57Root ", root, 1))) == SCHEMA


def test_an_honest_file_may_speak_of_it(tmp_path, plain):
    xml = xml_of(plain).replace(b"<![CDATA[Scan 0]]>", b"<![CDATA[<!DOCTYPE a> <!ENTITY b 'c'> schemaLocation=]]>")
    declaration, end, rest = xml.partition(b"?>")
    (tmp_path / "scan.e57").write_bytes(with_xml(plain, declaration + end + b"<!-- no <!DOCTYPE a> -->" + rest))
    assert np.abs(read_cloud(tmp_path / "scan.e57").points - POINTS).max() < 1e-6


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (24, 1 << 60, "broken E57: its XML is not within the file"),
        (24, 1022, "broken E57: "),  # within a checksum
        (32, 1 << 60, "broken E57: its XML is not within the file"),
        (32, 0, "broken E57: its XML is not within the file"),
        (40, 512, "broken E57: its pages have 512 bytes, not 1024"),
    ],
)
def test_a_header_that_leads_nowhere(tmp_path, plain, place, value, message):
    data = bytearray(plain)
    struct.pack_into("<Q", data, place, value)
    assert fault_of(tmp_path, bytes(data)).startswith(message)
    assert fault_of(tmp_path, plain[:40]).startswith("broken E57: the file ends within its header; ")


MANY = 300_000


@pytest.mark.parametrize(
    ("parts", "message"),
    {
        "deep": (
            b'<a type="Structure">' * MANY + b"</a>" * MANY,
            f"its XML has more than 100 elements within one another, which E57 does not use; {MISTRUST}",
        ),
        "deep without an end": (
            b'<a b="/>">' * MANY,
            f"its XML has more than 100 elements within one another, which E57 does not use; {MISTRUST}",
        ),
        "wide": (
            b'<a type="Integer"/>' * MANY,
            f"its XML has an element of more than 4096 parts, which E57 does not use; {MISTRUST}",
        ),
        "not well-formed": (b"<a></b>", "broken E57: its XML is not well-formed, mismatched tag: "),
    }.values(),
    ids=["deep", "deep without an end", "wide", "not well-formed"],
)
def test_absurd_shapes_are_refused_at_once(tmp_path, plain, parts, message):
    head, end, tail = xml_of(plain).rpartition(b"</e57Root>")
    (tmp_path / "scan.e57").write_bytes(with_xml(plain, head + parts + end + tail))
    started = time.process_time()
    with pytest.raises(InputError) as refused, open_input(tmp_path / "scan.e57") as source:
        check_xml(source)
    assert time.process_time() - started < 10  # libE57 takes a minute or more
    assert str(refused.value).startswith(f"{tmp_path / 'scan.e57'}: {message}")


def test_a_list_may_have_as_many_parts_as_it_likes(tmp_path, plain):
    head, end, tail = xml_of(plain).rpartition(b"</e57Root>")
    parts = b'<v type="Vector" allowHeterogeneousChildren="1">' + b'<a type="Integer"/>' * 5000 + b"</v>"
    (tmp_path / "scan.e57").write_bytes(with_xml(plain, head + parts + end + tail))
    assert len(read_cloud(tmp_path / "scan.e57").points) == len(POINTS)
