"""PLY, OBJ, GLB and STL: triangle meshes of the finite cylinders with their caps, by trimesh.

A cylinder is a prism of `SIDES` sides whose edges lie on its surface: its distance from the surface is at most 0.9 % of
the radius.
"""

from __future__ import annotations

from math import ceil, floor, log10
from typing import TYPE_CHECKING

import numpy as np

from cylx.export.drawing import Drawing, Exported
from cylx.export.formats import METRES
from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import Cylinder, axis_basis

if TYPE_CHECKING:
    from trimesh import Trimesh

    from cylx.export.drawing import Piece

SIDES = 24
"""1 - cos(pi / 24) is 0.0086 of the radius."""
COARSEST = 1e-3
"""An offset is subtracted if single precision would move a corner by more than this share of the smallest radius."""
Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""Rotates the z axis of a scan to the y axis, which is up in glTF."""


def write(drawing: Drawing, suffix: str) -> Exported:
    """Write the meshes of the cylinders.

    PLY and OBJ colour the corners, GLB gives each cylinder a material. PLY has the cylinder of a corner in
    `cylinder_id`, OBJ and GLB name each cylinder. GLB is in metres, and rotated so that the z axis of the scan is up.
    PLY and STL have coordinates in single precision: far from the origin, integers are subtracted from them and written
    to the header.

    Parameters
    ----------
    drawing : Drawing
        With one cylinder or more.
    suffix : str
        `.ply`, `.obj`, `.glb` or `.stl`.
    """
    if suffix == ".glb":
        return Exported(_glb(drawing))
    if suffix == ".obj":
        return Exported(_obj(drawing))
    offset = offset_for_singles([piece.shape for piece in drawing.pieces])
    mesh = _one_mesh(drawing, offset)
    said = "cylx" if offset is None else f"cylx; add {' '.join(f'{x:.0f}' for x in offset)} to all coordinates"
    if suffix == ".stl":
        return Exported(said.encode().ljust(80)[:80] + mesh.export(file_type="stl")[80:], offset)
    first, second, rest = mesh.export(file_type="ply", vertex_normal=False).split(b"\n", 2)
    return Exported(b"\n".join([first, second, f"comment {said}".encode(), rest]), offset)


def mesh_of(cylinder: Cylinder) -> tuple[FloatArray, IndexArray]:
    """Return the corners and triangles of a closed prism about the middle of a cylinder, seen from outside.

    Returns
    -------
    corners : ndarray of shape (2 SIDES + 2, 3)
        Relative to the middle of the cylinder; the last two are the middles of the caps.
    triangles : ndarray of shape (4 SIDES, 3)
        Indices of corners, counterclockwise.
    """
    first, second = axis_basis(cylinder.direction)
    turn = 2.0 * np.pi * np.arange(SIDES) / SIDES
    ring = cylinder.radius * (np.outer(np.cos(turn), first) + np.outer(np.sin(turn), second))
    half = 0.5 * cylinder.height * cylinder.direction
    here = np.arange(SIDES)
    after = (here + 1) % SIDES
    bottom, top = np.full(SIDES, 2 * SIDES), np.full(SIDES, 2 * SIDES + 1)
    triangles = [
        np.column_stack(corners)
        for corners in (
            (here, after, after + SIDES),
            (here, after + SIDES, here + SIDES),
            (bottom, after, here),
            (top, here + SIDES, after + SIDES),
        )
    ]
    return np.vstack([ring - half, ring + half, [-half, half]]), np.vstack(triangles)


def offset_for_singles(shapes: list[Cylinder]) -> tuple[float, float, float] | None:
    """Return the offset to subtract from the coordinates so that they fit into single precision; None if they fit.

    Returns
    -------
    tuple of float or None
        Integers.
    """
    points = np.array([shape.point for shape in shapes])
    if np.abs(points).max() * 2.0**-24 <= COARSEST * min(shape.radius for shape in shapes):
        return None
    x, y, z = (float(floor(low)) for low in points.min(axis=0))
    return x, y, z


def _one_mesh(drawing: Drawing, offset: tuple[float, float, float] | None) -> Trimesh:
    """Join all cylinders, with an offset subtracted."""
    from trimesh import Trimesh  # noqa: PLC0415  an extra

    away = np.zeros(3) if offset is None else np.array(offset)
    corners, triangles, colors, ids = [], [], [], []
    for i, piece in enumerate(drawing.pieces):
        own, faces = mesh_of(piece.shape)
        corners.append(own + (piece.shape.point - away))
        triangles.append(faces + i * len(own))
        colors.append(np.tile(np.array([*piece.color, 255], np.uint8), (len(own), 1)))
        ids.append(np.full(len(own), piece.id, np.int32))
    return Trimesh(
        np.vstack(corners),
        np.vstack(triangles),
        vertex_colors=np.vstack(colors),
        vertex_attributes={"cylinder_id": np.concatenate(ids)},
        process=False,
    )


def _obj(drawing: Drawing) -> bytes:
    """Write a text with one object per cylinder, in the unit of the scan, to a millionth of the smallest radius."""
    from trimesh import Scene, Trimesh  # noqa: PLC0415  an extra

    scene = Scene()
    for piece in drawing.pieces:
        corners, faces = mesh_of(piece.shape)
        color = np.tile(np.array([*piece.color, 255], np.uint8), (len(corners), 1))
        mesh = Trimesh(corners + piece.shape.point, faces, vertex_colors=color, process=False)
        scene.add_geometry(mesh, geom_name=piece.name, node_name=piece.name)
    digits = max(6, 6 - floor(log10(min(piece.shape.radius for piece in drawing.pieces))))
    text = scene.export(
        file_type="obj", include_normals=False, digits=digits, header=f"{len(drawing.pieces)} cylinders"
    )
    return f"{text.rstrip()}\n".encode()


def _glb(drawing: Drawing) -> bytes:
    """Write a binary glTF with one node per cylinder; the node has its position, which avoids rounding far away."""
    from trimesh import Scene  # noqa: PLC0415  an extra

    scene, scale = Scene(), METRES[drawing.unit or "m"]
    scene.graph.update(frame_from=scene.graph.base_frame, frame_to="z up", matrix=Z_UP)
    for piece in drawing.pieces:
        place = np.eye(4)
        place[:3, 3] = scale * piece.shape.point
        mesh = _colored(piece, scale)
        scene.add_geometry(mesh, geom_name=piece.name, node_name=piece.name, parent_node_name="z up", transform=place)
    return bytes(scene.export(file_type="glb", include_normals=False))


def _colored(piece: Piece, scale: float) -> Trimesh:
    """Return the mesh of one cylinder about its middle, with a material of its colour."""
    from trimesh import Trimesh  # noqa: PLC0415  an extra
    from trimesh.visual import TextureVisuals  # noqa: PLC0415  an extra
    from trimesh.visual.material import PBRMaterial  # noqa: PLC0415  an extra

    corners, faces = mesh_of(piece.shape)
    color = [*(ceil(255 * _linear(part / 255) - 0.5) for part in piece.color), 255]
    material = PBRMaterial(name=piece.name, baseColorFactor=color, metallicFactor=0.0, roughnessFactor=0.8)
    return Trimesh(scale * corners, faces, visual=TextureVisuals(material=material), process=False)


def _linear(part: float) -> float:
    """Convert a component of an sRGB colour to linear light, as glTF requires."""
    return float(part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4)
