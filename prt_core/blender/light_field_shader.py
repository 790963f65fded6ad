"""The camera shader of light fields: each pixel looks at a point from a direction of its own.

The picture is a grid of tiles, one a point, `across` of them in a row; a tile has `rows` x
`columns` pixels, the hemisphere about the point's normal as a square (`sphere.hemisphere`). Where
in its pixel a sample falls is where in its cell of directions it looks from.

Tables are images of floats, a texel a point. Blender 5.2 reads their rows from the bottom, older
ones from the top: so a table has its rows twice, once in either order, and its first half is read.
What is looked from is no nearer to the plane of the facets than `GRAZING`: below it nothing of the
surface is seen, and there the field goes on as it is at the horizon.
"""

# The cosine to the normal of the facets, at least.
GRAZING = 0.05

TABLES = ("positions", "normals", "tangents", "above")

SHADER = """
color entry(string table, float s, float t)
{
    return texture(table, s, t, 0.0, 0.0, 0.0, 0.0, "interp", "closest", "wrap", "clamp");
}

vector as_vector(color c)
{
    return vector(c[0], c[1], c[2]);
}

shader prt_light_field(
    string positions = "", string normals = "", string tangents = "", string above = "",
    int across = 1, int down = 1, int count = 1, int rows = 1, int columns = 1,
    float grazing = 0.05,
    output point position = point(0.0), output vector direction = vector(0.0, 0.0, 1.0),
    output color throughput = color(0.0))
{
    point raster = camera_shader_raster_position();
    float x = raster[0] * across;
    float y = (1.0 - raster[1]) * down;
    int tile_x = min(int(floor(x)), across - 1);
    int tile_y = min(int(floor(y)), down - 1);
    if (tile_y * across + tile_x < count) {
        float a = 2.0 * (x - tile_x) - 1.0;
        float b = 2.0 * (y - tile_y) - 1.0;
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
        float s = (tile_x + 0.5) / across;
        float t = 0.5 * (tile_y + 0.5) / down;
        vector n = as_vector(entry(normals, s, t));
        vector u = as_vector(entry(tangents, s, t));
        vector w = flat * cos(angle) * u + flat * sin(angle) * cross(n, u)
            + max(1.0 - radius * radius, 0.0) * n;
        vector lift = as_vector(entry(above, s, t));
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
        vector from = as_vector(entry(positions, s, t)) + height / slope * w;
        position = point(from[0], from[1], -from[2]);
        direction = vector(-w[0], -w[1], w[2]);
        throughput = color(1.0);
    }
}
"""
