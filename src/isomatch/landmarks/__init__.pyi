from isomatch.landmarks.curves import drawn_curve, equally_spaced, spread_on_surface
from isomatch.landmarks.landmark_writers import write_landmarks, write_specimens, writer_of
from isomatch.landmarks.landmarks import (
    Curve,
    Landmarks,
    median_landmarks,
    nearest_landmarks,
    read_landmarks,
    with_frame,
)

__all__ = [
    "Curve",
    "Landmarks",
    "drawn_curve",
    "equally_spaced",
    "median_landmarks",
    "nearest_landmarks",
    "read_landmarks",
    "spread_on_surface",
    "with_frame",
    "write_landmarks",
    "write_specimens",
    "writer_of",
]
