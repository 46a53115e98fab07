"""`rig budget`: uncertainty budgets of a run's results."""
