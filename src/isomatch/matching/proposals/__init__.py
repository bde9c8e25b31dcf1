"""First maps: from priors, extremities, anchors, pose, flips and symmetries."""
