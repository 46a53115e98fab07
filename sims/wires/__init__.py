"""The simulated ends of wires: inside the process, and on ports of the operating system."""
