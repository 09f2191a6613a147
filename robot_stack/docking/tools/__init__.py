"""Tools of docking: printed marker boards, and the analysis of failed dockings."""
