"""What a person sees: tables, progress, help and failures."""
