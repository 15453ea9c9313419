"""dREBA: differentiable surrogates of the REBA posture score (Busch, Toussaint & Lopes 2018, section II).

The package is empty for now: it will sample balanced postures, fit surrogates and report their error per class.
"""
