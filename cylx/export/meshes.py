"""PLY, OBJ, GLB and STL: triangle meshes of the finite cylinders and their fittings, with their caps, by trimesh.

A cylinder is a prism of `SIDES` sides whose edges lie on its surface: its distance from the surface is at most 0.9 % of
the radius. Bends, cones and mitres are made of such rings. The solids of a tee are not cut where they overlap.
"""

from __future__ import annotations

from math import ceil, floor, log10
from typing import TYPE_CHECKING

import numpy as np

from cylx.export.drawing import Drawing, Exported
from cylx.export.solids import Solid, middle_of, radius_of, rings_of
from cylx.geometry.arrays import FloatArray, IndexArray
from cylx.geometry.cylinder import Cylinder, axis_basis
from cylx.units import METRES

if TYPE_CHECKING:
    from trimesh import Trimesh

    from cylx.export.drawing import Body

SIDES = 24
"""1 - cos(pi / 24) is 0.0086 of the radius."""
COARSEST = 1e-3
"""An offset is subtracted if single precision would move a corner by more than this share of the smallest radius."""
Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""Rotates the z axis of a scan to the y axis, which is up in glTF."""


def write(drawing: Drawing, suffix: str) -> Exported:
    """Write the meshes of the cylinders, and of the fittings if there are any.

    PLY and OBJ colour the corners, GLB gives each cylinder a material. PLY has the cylinder of a corner in
    `cylinder_id`, and with fittings also `fitting_id`; OBJ and GLB name each cylinder and fitting. GLB is in metres,
    and rotated so that the z axis of the scan is up. PLY and STL have coordinates in single precision: far from the
    origin, integers are subtracted from them and written to the header.

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
    offset = offset_for_singles([solid for body in drawing.bodies for solid in body.solids])
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


def mesh_of_solid(solid: Solid) -> tuple[FloatArray, IndexArray]:
    """Return the corners, relative to the middle, and the triangles of a closed solid, seen from outside.

    Returns
    -------
    corners : ndarray of shape (N, 3)
        The last two are the middles of the caps.
    triangles : ndarray of shape (M, 3)
        Indices of corners, counterclockwise.
    """
    if isinstance(solid, Cylinder):
        return mesh_of(solid)
    rings = rings_of(solid, SIDES)
    here = np.arange(SIDES)
    after = (here + 1) % SIDES
    triangles, last = [], (len(rings) - 1) * SIDES
    for k in range(0, last, SIDES):
        triangles += [(k + here, k + after, k + after + SIDES), (k + here, k + after + SIDES, k + here + SIDES)]
    bottom, top = np.full(SIDES, last + SIDES), np.full(SIDES, last + SIDES + 1)
    triangles += [(bottom, after, here), (top, last + here, last + after)]
    corners = np.vstack([rings.reshape(-1, 3), rings[0].mean(axis=0), rings[-1].mean(axis=0)])
    return corners, np.vstack([np.column_stack(one) for one in triangles])


def mesh_of_body(body: Body) -> tuple[FloatArray, FloatArray, IndexArray]:
    """Return the middle of a body, its corners relative to that, and its triangles."""
    middle = middle_of(body.solids[0])
    corners, triangles = mesh_of_solid(body.solids[0])
    for solid in body.solids[1:]:
        own, faces = mesh_of_solid(solid)
        triangles = np.vstack([triangles, faces + len(corners)])
        corners = np.vstack([corners, own + (middle_of(solid) - middle)])
    return middle, corners, triangles


def offset_for_singles(shapes: list[Solid]) -> tuple[float, float, float] | None:
    """Return the offset to subtract from the coordinates so that they fit into single precision; None if they fit.

    Returns
    -------
    tuple of float or None
        Integers.
    """
    points = np.array([middle_of(shape) for shape in shapes])
    if np.abs(points).max() * 2.0**-24 <= COARSEST * min(map(radius_of, shapes)):
        return None
    x, y, z = (float(floor(low)) for low in points.min(axis=0))
    return x, y, z


def _one_mesh(drawing: Drawing, offset: tuple[float, float, float] | None) -> Trimesh:
    """Join all bodies, with an offset subtracted."""
    from trimesh import Trimesh  # noqa: PLC0415  an extra

    away = np.zeros(3) if offset is None else np.array(offset)
    corners, triangles, colors, ids, fittings, count = [], [], [], [], [], 0
    for body in drawing.bodies:
        middle, own, faces = mesh_of_body(body)
        corners.append(own + (middle - away))
        triangles.append(faces + count)
        count += len(own)
        colors.append(np.tile(np.array([*body.color, 255], np.uint8), (len(own), 1)))
        ids.append(np.full(len(own), body.cylinder, np.int32))
        fittings.append(np.full(len(own), body.fitting, np.int32))
    attributes = {"cylinder_id": np.concatenate(ids)}
    if drawing.piping is not None:
        attributes["fitting_id"] = np.concatenate(fittings)
    return Trimesh(
        np.vstack(corners),
        np.vstack(triangles),
        vertex_colors=np.vstack(colors),
        vertex_attributes=attributes,
        process=False,
    )


def _obj(drawing: Drawing) -> bytes:
    """Write a text with one object per body, in the unit of the scan, to a millionth of the smallest radius."""
    from trimesh import Scene, Trimesh  # noqa: PLC0415  an extra

    scene = Scene()
    for body in drawing.bodies:
        middle, corners, faces = mesh_of_body(body)
        color = np.tile(np.array([*body.color, 255], np.uint8), (len(corners), 1))
        mesh = Trimesh(corners + middle, faces, vertex_colors=color, process=False)
        scene.add_geometry(mesh, geom_name=body.name, node_name=body.name)
    smallest = min(radius_of(solid) for body in drawing.bodies for solid in body.solids)
    digits = max(6, 6 - floor(log10(smallest)))
    fittings = sum(body.fitting >= 0 for body in drawing.bodies)
    said = f"{len(drawing.pieces)} cylinders" + (f", {fittings} fittings" if fittings else "")
    text = scene.export(file_type="obj", include_normals=False, digits=digits, header=said)
    return f"{text.rstrip()}\n".encode()


def _glb(drawing: Drawing) -> bytes:
    """Write a binary glTF with one node per body; the node has its position, which avoids rounding far away."""
    from trimesh import Scene  # noqa: PLC0415  an extra

    scene, scale = Scene(), METRES[drawing.unit or "m"]
    scene.graph.update(frame_from=scene.graph.base_frame, frame_to="z up", matrix=Z_UP)
    for body in drawing.bodies:
        place = np.eye(4)
        middle, corners, faces = mesh_of_body(body)
        place[:3, 3] = scale * middle
        mesh = _colored(body, scale * corners, faces)
        scene.add_geometry(mesh, geom_name=body.name, node_name=body.name, parent_node_name="z up", transform=place)
    return bytes(scene.export(file_type="glb", include_normals=False))


def _colored(body: Body, corners: FloatArray, faces: IndexArray) -> Trimesh:
    """Return the mesh of one body, with a material of its colour."""
    from trimesh import Trimesh  # noqa: PLC0415  an extra
    from trimesh.visual import TextureVisuals  # noqa: PLC0415  an extra
    from trimesh.visual.material import PBRMaterial  # noqa: PLC0415  an extra

    color = [*(ceil(255 * _linear(part / 255) - 0.5) for part in body.color), 255]
    material = PBRMaterial(name=body.name, baseColorFactor=color, metallicFactor=0.0, roughnessFactor=0.8)
    return Trimesh(corners, faces, visual=TextureVisuals(material=material), process=False)


def _linear(part: float) -> float:
    """Convert a component of an sRGB colour to linear light, as glTF requires."""
    return float(part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4)
