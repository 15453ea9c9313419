"""Postures of a person at a workplace whose surface moves: `lgp improve`.

posture table -> `body_fit` (the person in that posture) -> `held_hands` (postures whose hands are in given places)
             -> `improvement` (REBA as the surface moves) -> `page`, `console`
"""
