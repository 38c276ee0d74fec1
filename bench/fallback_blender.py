"""blender -b --python-exit-code 1 --python fallback_blender.py -- SCENE FOLDER: loads the contents that FOLDER/views.json
lists, renders its views with Cycles into FOLDER/VIEW-blender.png, which are transparent where there is no triangle, and
writes the number of triangles in each content to FOLDER/blender.json. For Blender 3.4. See mesh.sh."""
import json
import os
import sys

import bpy
import mathutils
import numpy

numpy.bool = bool  # which Blender 3.4's importer needs, and newer versions of numpy lack

scene_folder, folder = sys.argv[sys.argv.index("--") + 1:]
with open(os.path.join(folder, "views.json"), encoding="utf-8") as file:
    wanted = json.load(file)
bpy.ops.wm.read_homefile(use_empty=True)

counts = []
for content in wanted["contents"]:
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=os.path.join(scene_folder, content["uri"]))
    meshes = [loaded.data for loaded in set(bpy.data.objects) - before if loaded.type == "MESH"]
    counts.append(sum(len(polygon.vertices) - 2 for mesh in meshes for polygon in mesh.polygons))

# The importer leaves the cut at an opacity to Eevee, which needs a display: Cycles would blend.
for material in bpy.data.materials:
    if material.blend_method != "CLIP":
        continue
    tree = material.node_tree
    for link in list(tree.links):
        if link.from_node.type == "TEX_IMAGE" and link.from_socket.name == "Alpha":
            cut = tree.nodes.new("ShaderNodeMath")
            cut.operation = "GREATER_THAN"
            cut.inputs[1].default_value = material.alpha_threshold
            target = link.to_socket
            tree.links.new(link.from_socket, cut.inputs[0])
            tree.links.new(cut.outputs[0], target)

scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.render.film_transparent = True
scene.render.image_settings.color_mode = "RGBA"
scene.view_settings.view_transform = "Standard"
scene.cycles.samples = 1  # through the middle of the pixel
scene.cycles.use_denoising = False
scene.cycles.pixel_filter_type = "BOX"
scene.cycles.filter_width = 0.01
scene.cycles.transparent_max_bounces = 256
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
scene.collection.objects.link(camera)
scene.camera = camera
camera.data.clip_start, camera.data.clip_end = wanted["near"], wanted["far"]
camera.data.sensor_fit = "HORIZONTAL"
from_y_up = mathutils.Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))
for view in wanted["views"]:
    width, height, focal, centre = view["width"], view["height"], view["focal"], view["centre"]
    numbers = view["matrix"]  # column by column
    camera.matrix_world = from_y_up @ mathutils.Matrix([numbers[row::4] for row in range(4)])
    camera.data.lens = camera.data.sensor_width * focal[0] / width
    scene.render.pixel_aspect_y = focal[0] / focal[1]
    camera.data.shift_x = 0.5 - centre[0] / width
    camera.data.shift_y = (centre[1] - 0.5 * height) / width
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.filepath = os.path.join(folder, view["name"] + "-blender.png")
    bpy.ops.render.render(write_still=True)

missing = [image.name for image in bpy.data.images if image.source == "FILE" and not image.size[0]]
if missing:
    sys.exit("textures that were not loaded: " + ", ".join(missing))
with open(os.path.join(folder, "blender.json"), "w", encoding="utf-8") as file:
    json.dump(counts, file)
