"""What several commands ask for, one file a kind of option."""
