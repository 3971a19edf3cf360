"""Optional libraries, and the errors if they are missing."""
