"""Multi-bound tree search over action sequences (Toussaint & Lopes 2017); it sees bounds alone, no kinematics."""
