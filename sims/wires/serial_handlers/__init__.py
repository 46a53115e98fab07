"""URL handlers for pyserial; it looks for `protocol_SCHEME` in every package it has been told of."""
