"""Map building: computes a site's map from a recorded ride."""
