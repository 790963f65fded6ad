"""The camera shader of light fields: each pixel looks at a point from a direction of its own.

The picture is a grid of tiles, one a point, `across` of them in a row; a tile has `rows` x
`columns` pixels, the hemisphere about the point's normal as a square (`sphere.hemisphere`). Where
in its pixel a sample falls is where in its cell of directions it looks from. What it looks from is
no nearer to the plane of the facets than `GRAZING`: below it nothing of the surface is seen, and
there the field goes on as it is at the horizon.

The points are written into the shader: a compiler makes constants of them, while four textures
would take as long as the rest of a path.
"""

import numpy as np

# The cosine to the normal of the facets, at least.
GRAZING = 0.05
# Points of a shader, at most: its text takes some 150 bytes of each.
MOST_POINTS = 4096

_SOURCE = """
vector three(float data[], int first)
{
    return vector(data[first], data[first + 1], data[first + 2]);
}

shader prt_light_field(
    float data[%(size)d] = {%(data)s},
    int across = %(across)d, int down = %(down)d, int count = %(count)d,
    int rows = %(rows)d, int columns = %(columns)d,
    float grazing = %(grazing).9g, float spread = %(spread).9g,
    output point position = point(0.0), output vector direction = vector(0.0, 0.0, 1.0),
    output color throughput = color(0.0))
{
    point raster = camera_shader_raster_position();
    float x = raster[0] * across;
    float y = (1.0 - raster[1]) * down;
    int tile_x = min(int(floor(x)), across - 1);
    int tile_y = min(int(floor(y)), down - 1);
    int tile = tile_y * across + tile_x;
    if (tile < count) {
        float u_cell = (x - tile_x) * columns;
        float v_cell = (y - tile_y) * rows;
        u_cell += (spread - 1.0) * (u_cell - floor(u_cell) - 0.5);
        v_cell += (spread - 1.0) * (v_cell - floor(v_cell) - 0.5);
        float a = 2.0 * u_cell / columns - 1.0;
        float b = 2.0 * v_cell / rows - 1.0;
        float radius = 0.0;
        float angle = 0.0;
        if (fabs(a) > fabs(b)) {
            radius = a;
            angle = M_PI_4 * (b / a);
        } else if (b != 0.0) {
            radius = b;
            angle = M_PI_2 - M_PI_4 * (a / b);
        }
        float flat = radius * sqrt(max(0.0, 2.0 - radius * radius));
        vector u = three(data, 12 * tile + 3);
        vector n = three(data, 12 * tile + 6);
        vector w = flat * cos(angle) * u + flat * sin(angle) * cross(n, u)
            + max(1.0 - radius * radius, 0.0) * n;
        vector lift = three(data, 12 * tile + 9);
        float height = length(lift);
        lift /= height;
        float slope = dot(w, lift);
        if (slope < grazing) {
            /* As far around the lift, and as high above the facets as may be. */
            vector level = w - slope * lift;
            float size = length(level);
            vector side = size > 1e-6 ? level / size : u;
            w = normalize(sqrt(1.0 - grazing * grazing) * side + grazing * lift);
            slope = grazing;
        }
        vector from = three(data, 12 * tile) + height / slope * w;
        /* The camera stands at the origin, and looks along -z. */
        position = point(from[0], from[1], -from[2]);
        direction = vector(-w[0], -w[1], w[2]);
        throughput = color(1.0);
    }
}
"""


def shader_source(points, across, down, angles, spread):
    """The shader of a block of points.

    Parameters
    ----------
    points : FieldPoints
        At most `MOST_POINTS`.
    across, down : int
        Tiles of the picture.
    angles : (int, int)
        Rows and columns of a tile.
    spread : float
        Share of its cell that a direction is spread over.

    Returns
    -------
    str
        In the Open Shading Language.
    """
    parts = points.positions, points.frames[:, 0], points.frames[:, 2], points.above
    data = np.concatenate(parts, axis=1).astype(np.float32).ravel()
    return _SOURCE % {
        "data": ",".join(map(_number, data.tolist())), "size": data.size,
        "across": across, "down": down, "count": len(points),
        "rows": angles[0], "columns": angles[1], "grazing": GRAZING, "spread": spread,
    }  # fmt: skip


def _number(value):
    """A float32 in nine digits, which are it exactly, as a float of the language."""
    text = f"{value:.9g}"
    return text if "." in text or "e" in text else text + ".0"
