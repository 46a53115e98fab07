"""The simulated ends of wires: inside the process, and behind the operating system's own ports."""
