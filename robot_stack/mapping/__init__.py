"""From a recorded ride to a site's map."""
