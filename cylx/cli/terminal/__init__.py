"""What the user sees: tables, progress, help and failures."""
