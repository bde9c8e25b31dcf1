from isomatch.landmarks.curves import drawn_curve, equally_spaced
from isomatch.landmarks.geomorph import write_specimens
from isomatch.landmarks.landmark_writers import write_landmarks, writer_of
from isomatch.landmarks.landmarks import nearest_landmarks, read_landmarks
from isomatch.landmarks.median import median_landmarks, respaced_curve
from isomatch.landmarks.placing import nearest_on_surface
from isomatch.landmarks.shape_landmarks import Curve, Landmarks

__all__ = [
    "Curve",
    "Landmarks",
    "drawn_curve",
    "equally_spaced",
    "median_landmarks",
    "nearest_landmarks",
    "nearest_on_surface",
    "read_landmarks",
    "respaced_curve",
    "write_landmarks",
    "write_specimens",
    "writer_of",
]
