"""Several people in two conditions: scores, tests and a report, here on a simulated study."""

import subprocess

import lgp

# Two plans of the same task, with and without the ergonomic cost, and six simulated people who follow each.
scene = lgp.load_scene("screwdriver").with_heights({"left": 0.8, "center": 1.1, "right": 1.4})
lgp.plan(scene).save("ergonomic")
lgp.plan(scene, cost=None).save("fast")
subprocess.run(
    ["lgp", "simulate-study", "ergonomic=ergonomic", "fast=fast", "-n", "6", "--seed", "1", "-o", "logs"], check=True
)
study = lgp.run_study(["logs"], conditions=["ergonomic", "fast"])  # your own recordings: names in a manifest
study.save("study")  # summary.json, scores.parquet, report.html
print(study.summary["verdict"])
