"""Files and folders of the disk: written completely or not at all, read only where regular; errors in plain words."""
