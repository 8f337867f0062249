#!/usr/bin/env python3
"""Prints what a solve made of each object of a capture, lobes beside their truth: judge.py CAPTURE DIR"""
import json
import sys

capture, results = sys.argv[1:3]
truth = json.load(open(f"{capture}/truth.json"))["objects"]
report = json.load(open(f"{results}/report.json"))
print("| object | albedo off by | roughness | true | specular |")
print("| --- | --- | --- | --- | --- |")
for name, true in truth.items():
    found = report["objects"][name]
    if any(true["emission"]):
        continue
    size = sum(t * t for t in true["albedo"]) ** 0.5
    off = sum((f - t) ** 2 for f, t in zip(found["albedo"], true["albedo"])) ** 0.5 / size

    def number(value):
        return "none" if value is None else f"{value:.3f}"

    print(f"| {name} | {off:.1%} | {number(found['roughness'])} | {number(true['roughness'])} | {number(found['specular'])} |")
for stage in report["stages"]:
    print(f"{stage['name']}: {stage['seconds']:.2f} s, held out {stage['held_out_loss']}, kept {stage['kept']}: {stage['why']}")
print(f"{report['seconds_solve']:.1f} s, {report['rays'] / 1e6:.1f} million rays")
