"""Units: of quantities that instruments set, in tables of others, of the Digital SI, and of differences."""
