"""Random certificates: their digital form by PTB's schema and rules, and read back."""
