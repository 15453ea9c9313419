"""What a recording holds before a profile gives it meaning, and the profiles that do."""
