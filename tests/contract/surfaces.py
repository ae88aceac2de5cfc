"""Small surfaces made by code."""

import gzip
import math

ROWS, COLUMNS = 48, 64
# tips of a triangle whose sides are all different
TIPS = ((80.0, 0.0, 0.0), (10.0, 78.0, 0.0), (-36.0, -12.0, 70.0))
STRAIGHT = ((75.0, 0.0, 0.0), (-75.0, 0.0, 0.0), (0.0, 0.0, 76.0))


def knobbed_ball(tips=TIPS, size=1.0, rows=range(ROWS + 1)):
    """A ball with three knobs as an OBJ file; only some of its rows, if they are given, as a scan from one side sees it."""
    tips = [[size * x for x in tip] for tip in tips]
    lengths = [math.dist(tip, (0, 0, 0)) for tip in tips]
    lines, numbers = [], {}
    for row in rows:
        polar = math.pi * row / ROWS
        for column in range(COLUMNS if 0 < row < ROWS else 1):
            azimuth = math.tau * column / COLUMNS
            direction = (math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar))
            radius = 50.0
            for tip, length in zip(tips, lengths):
                cosine = sum(a * b for a, b in zip(tip, direction)) / length
                radius += (length - 50.0) * math.exp((cosine - 1.0) / 0.1)
            lines.append("v " + " ".join(f"{radius * x:.6f}" for x in direction))
            numbers[row, column] = len(lines)

    def vertex(row, column):
        return numbers.get((row, column % COLUMNS if 0 < row < ROWS else 0))

    for row in rows:
        for column in range(COLUMNS):
            a, b = vertex(row, column), vertex(row, column + 1)
            c, d = vertex(row + 1, column + 1), vertex(row + 1, column)
            for corners in ((a, d, c), (a, c, b)):
                if None not in corners and len(set(corners)) == 3:
                    lines.append("f {} {} {}".format(*corners))
    return ("\n".join(lines) + "\n").encode()


def facets(ball):
    """The triangles of a ball as ASCII STL."""
    rows = [line.split() for line in ball.decode().splitlines()]
    points = [" ".join(row[1:]) for row in rows if row[0] == "v"]
    lines = ["solid ball"]
    for row in rows:
        if row[0] == "f":
            corners = [f"vertex {points[int(corner) - 1]}" for corner in row[1:]]
            lines += ["facet normal 0 0 0", "outer loop", *corners, "endloop", "endfacet"]
    return ("\n".join(lines + ["endsolid ball"]) + "\n").encode()


PLAIN = ("xyz", "asc", "csv", "txt")


def made(name):
    """The name with an ending that `content` can make: OBJ stands for the formats that it can't."""
    is_packed = name.lower().endswith(".gz")
    stem, packed = (name[:-3], name[-3:]) if is_packed else (name, "")
    ending = stem.rsplit(".", 1)[1]
    if ending.lower() in ("obj", "ply", "pcd", "stl", *PLAIN):
        return name
    return stem[: -len(ending)] + "obj" + packed


def content(name):
    """The vertices of the ball in the format that the ending of a file name asks for."""
    if name.lower().endswith(".gz"):
        return gzip.compress(content(name[:-3]))
    ball = knobbed_ball()
    ending = name.rsplit(".", 1)[1].lower()
    if ending == "stl":
        return facets(ball)
    points = [line[2:] for line in ball.decode().splitlines() if line.startswith("v ")]
    heads = {
        "obj": None,
        "ply": ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
        + [f"property float {axis}" for axis in "xyz"]
        + ["end_header"],
        "pcd": ["FIELDS x y z", "SIZE 4 4 4", "TYPE F F F", "COUNT 1 1 1", f"WIDTH {len(points)}", "HEIGHT 1"]
        + [f"POINTS {len(points)}", "DATA ascii"],
        **{plain: [] for plain in PLAIN},
    }
    head = heads[ending]
    return ball if head is None else ("\n".join(head + points) + "\n").encode()
