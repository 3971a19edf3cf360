"""Which columns are the coordinates, by their names alone."""

import pytest

from cylx.io.columns import is_other, named_axes, named_coordinates

PLACES = {
    "x y z": (0, 1, 2),
    "Z Y X": (2, 1, 0),
    "X x y z": (1, 2, 3),
    "i X_m Y_m Z_m": (1, 2, 3),
    "x1 x2 x3": None,
    "nx ny nz": None,
    "vx vy vz x_pos y_pos z_pos": (3, 4, 5),
    "normal_x normal_y normal_z": None,
    "u v w": None,
    "E N": None,
    "N E Z": (1, 0, 2),
    "northing easting elev": (1, 0, 2),
    "Rechtswert Hochwert H": (0, 1, 2),
    "Ost Nord H\\xf6he": (0, 1, 2),
    "Est Nord Quota": (0, 1, 2),
    "x y height": (0, 1, 2),
    "height width depth": None,
    "Points:0 Points:1 Points:2": (0, 1, 2),
    "Points:2 Points:1 Points:0": (2, 1, 0),
    "Points:0 Points:1": None,
    "Velocity:0 Velocity:1 Velocity:2": None,
    "position.x position.y position.z": (0, 1, 2),
    "Lon Lat Alt": (0, 1, 2),
    "lat lon h": (1, 0, 2),
    "0 1 2": None,
    "x_min y_min z_min": None,
    "intensity x y z": (1, 2, 3),
}


@pytest.mark.parametrize(("names", "places"), PLACES.items())
def test_names_tell_the_places_or_nothing(names, places):
    found = named_coordinates(names.split())
    assert (None if found is None else found.places) == places


def test_degrees_and_several_candidates_leave_a_doubt():
    assert not named_coordinates(["E", "N", "H"]).doubt
    assert "degrees" in named_coordinates(["lon", "lat", "h"]).doubt[0]
    assert "several columns" in named_coordinates(["x_local", "y_local", "z_local", "x_utm", "y_utm", "z_utm"]).doubt[0]


def test_an_axis_that_is_named_once_is_known():
    assert named_axes(["a", "Y (m)", "x_local", "x_utm"]) == {"y": 1}


def test_what_is_no_coordinate_is_known_by_its_words():
    assert [name for name in ("Time", "gps_time", "GpsTime", "Nx", "depth", "a") if is_other(name)] == [
        "Time", "gps_time", "GpsTime", "Nx",
    ]  # fmt: skip
