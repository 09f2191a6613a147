"""One class for each thing that docking does: ``tick(view) -> Step`` until the step carries a trigger."""
