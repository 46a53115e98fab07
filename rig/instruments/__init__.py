"""The instruments of an opened bench: drivers with their locks, the check of each command, the person."""
