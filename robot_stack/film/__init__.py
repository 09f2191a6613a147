"""Films of recorded rides: what the recording holds as solids in a drawn site, frame by frame. Needs no GPU."""
