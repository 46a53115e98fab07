"""`rig instrument`: declared instruments, listed, shown, checked, begun, and looked for at named addresses."""
