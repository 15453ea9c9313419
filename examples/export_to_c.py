"""A surrogate as a C function without dependencies, compiled and called."""

import ctypes
import shutil
import subprocess

import numpy as np

import dreba

model = dreba.load("quadratic")
dreba.export_model(model, "reba_model.c", to="c", name="reba_model")

compiler = shutil.which("cc")
if compiler is not None:
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-o", "reba_model.so", "reba_model.c", "-lm"], check=True)
    pose = dreba.sample(1, classes=[7], rng=3).angles[0]
    function = ctypes.CDLL("./reba_model.so").reba_model
    function.restype = ctypes.c_double
    numbers = np.ctypeslib.ndpointer(dtype=np.float64)
    function.argtypes = [numbers, ctypes.c_double, numbers, ctypes.c_double, numbers]
    gradient = np.zeros(len(pose))
    value = function(pose, 0.0, np.zeros(2), 0.0, gradient)  # angles, load, coupling left and right, activity
    print(f"C: {value:.9f}, Python: {model.value(pose):.9f}")
