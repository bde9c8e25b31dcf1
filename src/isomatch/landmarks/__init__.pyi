from isomatch.landmarks.landmarks import nearest_landmarks, read_landmarks

__all__ = [
    "nearest_landmarks",
    "read_landmarks",
]
