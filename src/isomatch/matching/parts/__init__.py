"""Matching of a part to a whole: intervals → starts → refinement → choice."""
