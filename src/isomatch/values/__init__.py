"""Types of arrays, checked settings, and values that are computed once."""
