"""What is true of simulated laboratories, for tests and campaigns: physics written without a formula of the fitter."""
