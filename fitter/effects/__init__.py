"""What an entry of a catalogue of effects is, whatever the kind of calibration. The catalogues are with the kinds."""
