"""Fit a differentiable REBA of your own, on your joints and limits, and see its error per class."""

import dreba

poses = dreba.sample(5000, classes=range(1, 11), rng=1)  # evenly over the REBA classes
held_out = dreba.sample(2000, classes=range(1, 11), rng=2)

model = dreba.QuadraticModel().fit(poses.angles, poses.reba)
result = dreba.evaluate(model, held_out)
for score, error in result.classes.items():
    print(f"REBA {score}: RMSE {error.rmse:.2f}, bias {error.bias:+.2f} over {error.n} poses")

model.save("model.json")
again = dreba.load("model.json")
print("same values after reading back:", (again.value(held_out.angles) == model.value(held_out.angles)).all())
