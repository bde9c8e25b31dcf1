"""One shape is a part of the other, or both are parts of one body."""
