"""One class for each phase of docking: ``tick(view) -> Step`` until the step carries a trigger."""
