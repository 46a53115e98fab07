"""Planning by a procedure of any kind: run list, conduct, steps by hand, policies for faults, further runs."""
