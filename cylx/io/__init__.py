"""Files in, files out: the only room that knows paths, formats, and the libraries that read and write them."""

from cylx.io.annotated import cylinder_colors, write_annotated
from cylx.io.clouds import read_cloud, write_cloud
from cylx.io.inputs import read_json
from cylx.io.outputs import check_writable, write_bytes, write_text

__all__ = [
    "check_writable",
    "cylinder_colors",
    "read_cloud",
    "read_json",
    "write_annotated",
    "write_bytes",
    "write_cloud",
    "write_text",
]
