"""URL handlers for pyserial; it looks for `protocol_SCHEME` in every registered package."""
