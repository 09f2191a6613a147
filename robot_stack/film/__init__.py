"""Films of recorded rides: the recorded objects as solids in a drawn site, frame by frame. Needs no GPU."""
