"""One bake under an environment that turns; a picture a step, relit from what is kept between them.

python examples/turntable.py BAKE.prt LIGHT.exr [STEPS]
"""

import sys
import time

import prt_core
from prt_core.evaluate import render_view, to_display, write_png

bake = prt_core.load(sys.argv[1])
light = prt_core.EnvironmentMap.read(sys.argv[2])
steps = int(sys.argv[3]) if len(sys.argv) > 3 else 12

# It takes the compressed form where `prt compress` has made one, else the bake itself.
relighter = prt_core.Relighter(bake)
caster = bake.make_caster(rays="camera")
for step in range(steps):
    start = time.perf_counter()
    radiance = relighter.radiance(light, rotation=360 * step / steps)
    spent = time.perf_counter() - start
    picture = render_view(bake, radiance, caster, width=480, height=300)
    write_png(f"turn_{step + 1:03d}.png", to_display(picture, bake.view_transform))
    print(f"{360 * step / steps:5.1f} degrees: {relighter.used}, {1e3 * spent:.1f} ms")
caster.close()
relighter.close()
