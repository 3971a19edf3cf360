"""Options shared by several commands, one file per kind of option."""
