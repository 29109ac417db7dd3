"""Renders a scene with Mitsuba 3 and tells about it in JSON: SCENE SIDE PASSES SAMPLES VARIANT EVEN.exr ODD.exr

Film, sampler and integrator of the scene are replaced: a square film with a box filter, independent samples, and the path
tracer without a limit of depth. Passes differ by their seeds. The means of the even ones and of the odd ones are written,
whose difference tells how far Mitsuba itself has converged; so do the means over the picture of each pass.
"""
import json
import os
import sys
import time
import xml.etree.ElementTree as tree

import drjit as dr
import mitsuba as mi

scene, side, passes, samples, variant, even, odd = sys.argv[1:]
side, passes, samples = int(side), int(passes), int(samples)
mi.set_variant(variant)

root = tree.parse(scene).getroot()
for element in [e for e in root if e.tag == "integrator"]:
    root.remove(element)
for sensor in root.iter("sensor"):
    for element in [e for e in sensor if e.tag in ("film", "sampler")]:
        sensor.remove(element)
    film = tree.SubElement(sensor, "film", type="hdrfilm")
    for name in ("width", "height"):
        tree.SubElement(film, "integer", name=name, value=str(side))
    tree.SubElement(film, "string", name="component_format", value="float32")
    tree.SubElement(film, "rfilter", type="box")
mi.file_resolver().append(os.path.dirname(os.path.abspath(scene)))
world = mi.load_string(tree.tostring(root, encoding="unicode"))
path = mi.load_dict({"type": "path", "max_depth": -1})

start = time.process_time()
sums, means = [0, 0], []
for i in range(passes):
    picture = mi.TensorXf(mi.render(world, integrator=path, spp=samples, seed=i))
    sums[i % 2] += picture * (2 / passes)
    dr.eval(sums[i % 2])
    means.append([float(c) for c in dr.mean(picture, axis=(0, 1)).array])
for name, picture in zip((even, odd), sums):
    mi.Bitmap(picture).write(name)
print(json.dumps({
    "version": mi.__version__,
    "variant": variant,
    "integrator": "path",
    "samples": passes * samples,
    "means": means,
    "cpu_seconds": time.process_time() - start,
}))
