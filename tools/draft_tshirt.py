#!/usr/bin/env python3
"""Drafts data/garments/tshirt.json, a GarmentCode specification, from body measurements.

    python3 tools/draft_tshirt.py > data/garments/tshirt.json

Needs nothing but Python. All lengths are centimetres, y is up from the floor, +x is the wearer's
left, +z in front. The measurements below were taken from data/bodies/f_average.obj (horizontal
sections; upper arms 45 degrees below the horizontal). Each sleeve is two halves, one in front of
the arm and one behind it, so that every panel can wait flat beside the body.
"""

import json
import math
from dataclasses import dataclass


@dataclass
class Body:
    bust: float = 86.8  # girth
    hip: float = 93.0  # girth of the high hip, where the hem is
    biceps: float = 26.0  # girth of the upper arm
    hip_height: float = 90.0
    underarm: float = 36.0  # of the armpit, above the hip
    neck: float = 8.0  # from the middle to the side of the neck
    shoulder: float = 17.5  # from the middle to the end of the shoulder
    # From the hip over the trunk, as a taut cloth lies, to the shoulder seam's two ends. The seam
    # lies a little in front of the shoulders' ridge, which evens out front and back; two centimetres
    # more behind keep the shirt from sliding back until its collar meets the throat.
    front_lengths: tuple = (57.0, 52.4)
    back_lengths: tuple = (57.2, 53.0)
    front: float = 14.4  # z of the foremost point of the trunk
    back: float = -11.2  # z of the hindmost
    arm_front: float = 5.0
    arm_back: float = -3.8
    arm_angle: float = 45.0  # degrees below the horizontal


@dataclass
class Design:
    bust_ease: float = 9.0
    hip_ease: float = 14.0  # half of it is for the cloth that hangs clear of the belly
    biceps_ease: float = 5.0
    armhole_ease: float = 2.0  # the armhole's bottom below the armpit
    neck_front: float = 8.5  # depth of the neckline below its side
    neck_back: float = 2.0
    scoop_front: float = 5.5  # how far the armhole runs in at its bottom
    scoop_back: float = 4.5
    cap_ease: float = 0.2  # the sleeve's cap over the armhole, in each half
    lift: float = -1.4  # the flat panels wait this much lower, clear of the armpits
    underarm_seam: float = 12.0
    sleeve_taper: float = 1.0  # each half narrows by this to its hem
    clearance: float = 4.0  # between body and flat panels


def sub(a, b):
    return (a[0] - b[0], a[1] - b[1])


def add(a, b):
    return (a[0] + b[0], a[1] + b[1])


def turn(p, degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return (c * p[0] - s * p[1], s * p[0] + c * p[1])


def middle(a, b):
    return ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)


def cubic_length(a, c, d, b, pieces=2000):
    def point(t):
        s = 1 - t
        weights = (s**3, 3 * s * s * t, 3 * s * t * t, t**3)
        return tuple(sum(w * p[k] for w, p in zip(weights, (a, c, d, b))) for k in (0, 1))

    points = [point(i / pieces) for i in range(pieces + 1)]
    return sum(math.dist(p, q) for p, q in zip(points, points[1:]))


def solve(rising, low, high):
    """Where a rising function is zero."""
    for _ in range(80):
        x = (low + high) / 2
        low, high = (x, high) if rising(x) < 0 else (low, x)
    return (low + high) / 2


def relative(a, b, control):
    """A control point in the frame of its edge, as the file wants it."""
    e, c = sub(b, a), sub(control, a)
    squared = e[0] ** 2 + e[1] ** 2
    return [(c[0] * e[0] + c[1] * e[1]) / squared, (c[1] * e[0] - c[0] * e[1]) / squared]


LABELLED = ("armhole", "collar")


def panel(sides, translation, turned=0.0, label="body"):
    """From a closed loop of sides (start, control points, end, role)."""
    edges = []
    for i, (start, controls, end, role) in enumerate(sides):
        edge = {"endpoints": [i, (i + 1) % len(sides)]}
        if role.endswith(LABELLED):
            edge["label"] = role
        if controls:
            params = [relative(start, end, c) for c in controls]
            edge["curvature"] = {"type": "cubic", "params": params}
        edges.append(edge)
    return {
        "translation": list(translation),
        "rotation": [0.0, 0.0, turned],
        "vertices": [list(start) for start, _, _, _ in sides],
        "edges": edges,
        "label": label,
    }


def reversed_way(sides):
    """The same sides run the other way: the outside faces back."""
    return [(end, controls[::-1], start, role) for start, controls, end, role in sides[::-1]]


def mirrored(sides):
    """The same sides on the wearer's right; reversed, so that the outside stays out."""

    def flip(p):
        return (-p[0], p[1])

    return [
        (flip(start), [flip(c) for c in controls], flip(end), role.replace("left", "right"))
        for start, controls, end, role in reversed_way(sides)
    ]


def shoulder_reach(body, lengths):
    """How far the shoulder seam reaches sideways, so that front and back seams are as long."""
    long = math.hypot(body.shoulder - body.neck, body.back_lengths[0] - body.back_lengths[1])
    return math.sqrt(long**2 - (lengths[0] - lengths[1]) ** 2)


class Torso:
    """Left half of the front or the back, from the middle of the hem up; mirrored for the whole."""

    def __init__(self, body, design, lengths, neck_depth, scoop):
        underarm_y = body.underarm - design.armhole_ease
        self.hem = ((body.hip + design.hip_ease) / 4, 0.0)
        self.underarm = ((body.bust + design.bust_ease) / 4, underarm_y)
        self.neck = (body.neck, lengths[0])
        self.shoulder = (body.neck + shoulder_reach(body, lengths), lengths[1])
        self.centre = (0.0, self.neck[1] - neck_depth)
        slope = sub(self.neck, self.shoulder)
        length = math.hypot(*slope)
        down = (slope[1] / length, -slope[0] / length)  # square to the shoulder seam
        down = down if down[1] < 0 else (-down[0], -down[1])
        depth = self.shoulder[1] - self.underarm[1]
        # The side is a little waisted, and meets the armhole and the hem nearly square.
        self.side = [
            (self.hem[0] - 0.5, 0.4 * underarm_y),
            (self.underarm[0] - 1.5, 0.62 * underarm_y),
        ]
        self.armhole = [
            (self.underarm[0] - scoop, underarm_y + 0.3),
            (self.shoulder[0] + 0.35 * depth * down[0], self.shoulder[1] + 0.35 * depth * down[1]),
        ]
        self.neckline = [
            (self.neck[0] + 0.55 * neck_depth * down[0], self.neck[1] + 0.55 * neck_depth * down[1]),
            (0.55 * self.neck[0], self.centre[1]),
        ]

    def armhole_length(self):
        return cubic_length(self.underarm, *self.armhole, self.shoulder)

    def sides(self):
        """The whole, counter-clockwise."""
        left = [
            (self.hem, self.side, self.underarm, "left_side"),
            (self.underarm, self.armhole, self.shoulder, "left_armhole"),
            (self.shoulder, [], self.neck, "left_shoulder"),
            (self.neck, self.neckline, self.centre, "left_collar"),
        ]
        return left + mirrored(left) + [((-self.hem[0], 0.0), [], self.hem, "hem")]


class SleeveHalf:
    """Left half sleeve: x along the arm, 0 at the hem; y = 0 is the seam over the arm."""

    def __init__(self, width, cap_height, design):
        long = design.underarm_seam
        self.top = (-long - cap_height, 0.0)
        self.underarm = (-long, -width)
        self.hem = (0.0, -width + design.sleeve_taper)
        self.cap = [(self.top[0], -0.42 * width), (self.underarm[0], -0.55 * width)]

    def cap_length(self):
        return cubic_length(self.top, *self.cap, self.underarm)

    def sides(self):
        start = (0.0, 0.0)
        return [
            (start, [], self.top, "left_over_arm"),
            (self.top, self.cap, self.underarm, "left_armhole"),
            (self.underarm, [], self.hem, "left_under_arm"),
            (self.hem, [], start, "left_cuff"),
        ]


def sleeve_halves(body, design, front, back):
    """Halves whose caps fit the armholes and whose widths add up to the sleeve's."""
    wanted = body.biceps + design.biceps_ease

    def half(torso, cap_height):
        length = torso.armhole_length() + design.cap_ease
        gap = lambda width: SleeveHalf(width, cap_height, design).cap_length() - length
        return SleeveHalf(solve(gap, 1.0, 40.0), cap_height, design)

    def too_narrow(cap_height):
        return wanted + sum(half(torso, cap_height).underarm[1] for torso in (front, back))

    cap_height = solve(too_narrow, 5.0, 20.0)
    return half(front, cap_height), half(back, cap_height)


def placed_sleeve(half, torso, rise, angle):
    """Translation that brings the middle of the cap to the middle of the armhole."""
    cap = turn(middle(half.top, half.underarm), -angle)
    armhole = add(middle(torso.shoulder, torso.underarm), (0.0, rise))
    return sub(armhole, cap)


def stitches(loops):
    """Which side of which panel is sewn to which, by their roles."""
    pairs = []
    for side in ("left", "right"):
        front, back = f"{side}_sleeve_f", f"{side}_sleeve_b"
        pairs += [
            ("front", "back", f"{side}_shoulder"),
            ("front", "back", f"{side}_side"),
            ("front", front, f"{side}_armhole"),
            ("back", back, f"{side}_armhole"),
            (front, back, f"{side}_over_arm"),
            (front, back, f"{side}_under_arm"),
        ]

    def edge(name, role):
        return {"panel": name, "edge": [side[3] for side in loops[name]].index(role)}

    return [[edge(a, role), edge(b, role)] for a, b, role in pairs]


def draft(body, design):
    front = Torso(body, design, body.front_lengths, design.neck_front, design.scoop_front)
    back = Torso(body, design, body.back_lengths, design.neck_back, design.scoop_back)
    sleeve_front, sleeve_back = sleeve_halves(body, design, front, back)
    loops = {
        "front": front.sides(),
        "back": reversed_way(back.sides()),
        "left_sleeve_f": sleeve_front.sides(),
        "left_sleeve_b": reversed_way(sleeve_back.sides()),
    }
    for half in "fb":
        loops[f"right_sleeve_{half}"] = mirrored(loops[f"left_sleeve_{half}"])
    rise, gap, angle = body.hip_height + design.lift, design.clearance, body.arm_angle
    # Both halves hang from the same line over the arm.
    x, y = placed_sleeve(sleeve_front, front, rise, angle)
    places = {
        "front": ((0.0, rise, body.front + gap), 0.0, "body"),
        "back": ((0.0, rise, body.back - gap), 0.0, "body"),
        "left_sleeve_f": ((x, y, body.arm_front + gap), -angle, "arm"),
        "left_sleeve_b": ((x, y, body.arm_back - gap), -angle, "arm"),
        "right_sleeve_f": ((-x, y, body.arm_front + gap), angle, "arm"),
        "right_sleeve_b": ((-x, y, body.arm_back - gap), angle, "arm"),
    }
    panels = {name: panel(sides, *places[name]) for name, sides in loops.items()}
    return {
        "pattern": {
            "panels": panels,
            "stitches": stitches(loops),
            "panel_order": list(panels),
        },
        "parameters": {},
        "parameter_order": [],
        "properties": {
            "curvature_coords": "relative",
            "normalize_panel_translation": False,
            "normalized_edge_loops": True,
            "units_in_meter": 100,
        },
    }


def rounded(value):
    """To a thousandth of a millimetre; relative control points lose nothing that matters."""
    if isinstance(value, float):
        return round(value, 6) + 0.0
    if isinstance(value, list):
        return [rounded(v) for v in value]
    if isinstance(value, dict):
        return {key: rounded(v) for key, v in value.items()}
    return value


if __name__ == "__main__":
    print(json.dumps(rounded(draft(Body(), Design())), indent=1))
