from isomatch.landmarks.curves import draw_curve, equally_spaced, spread_on_surface
from isomatch.landmarks.landmark_writers import write_landmarks, write_specimens, writer_of
from isomatch.landmarks.landmarks import (
    Curve,
    Landmarks,
    median_landmarks,
    nearest_landmarks,
    read_landmarks,
    with_frame,
)
from isomatch.landmarks.specimens import is_of_landmarks, join_places, read_landmark_pairs, read_specimens

__all__ = [
    "Curve",
    "Landmarks",
    "draw_curve",
    "equally_spaced",
    "is_of_landmarks",
    "join_places",
    "median_landmarks",
    "nearest_landmarks",
    "read_landmark_pairs",
    "read_landmarks",
    "read_specimens",
    "spread_on_surface",
    "with_frame",
    "write_landmarks",
    "write_specimens",
    "writer_of",
]
