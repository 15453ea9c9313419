"""Exact REBA scores (Hignett & McAtamney 2000) from recordings of posture."""
