"""Draws the pictures of the page: the panel beside a figure that an empty draws, and the motion as it was baked.

Usage: xvfb-run -a -s "-screen 0 1360x860x24" blender --factory-startup --window-geometry 0 0 1360 860 --python picture.py -- BUILD_FOLDER FOLDER
"""
import sys
import traceback
from pathlib import Path

import bpy
import numpy as np

HERE = Path(__file__).resolve().parent
BUILD, FOLDER = (Path(given).resolve() for given in sys.argv[sys.argv.index("--") + 1 :][:2])
sys.path[:0] = [str(BUILD / "python"), str(HERE)]
HAND = (0.74, -0.02, 1.22)  # where the empty begins, and where it goes [m]
AWAY = (0.55, -0.35, 1.65)
SHOWN = (1, 18, 36, 54)  # frames of the motion


def main():
    import addon_utils

    addon_utils.enable("exmat_blender", default_set=True)
    for obj in list(bpy.data.objects):
        if obj.type == "MESH":
            bpy.data.objects.remove(obj)
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "figure.blend"))
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 60
    bpy.ops.exmat.import_motion(filepath=str(HERE.parent / "09_figure_from_surface/figure.glb"))
    figure = next(obj for obj in bpy.data.objects if obj.type == "MESH")
    figure.name = "figure"
    bpy.context.view_layer.objects.active = figure
    for face in figure.data.polygons:
        face.use_smooth = True
    height = np.array([(figure.matrix_world @ vertex.co).z for vertex in figure.data.vertices])
    figure.vertex_groups.new(name="feet").add([int(v) for v in np.flatnonzero(height < 0.08)], 1, "REPLACE")
    figure.exmat.clamp = "feet"
    figure.exmat.bias = 0
    bpy.ops.exmat.precompute(wait=True)
    scene.cursor.location = HAND
    bpy.ops.exmat.add_grip()
    empty = figure.exmat.grips[0].target
    for frame, place in ((1, HAND), (30, AWAY), (60, AWAY)):
        empty.location = place
        empty.keyframe_insert("location", frame=frame)
    draw_panel(figure, scene)
    draw_motion(figure, scene)


def draw_panel(figure, scene):
    bpy.ops.exmat.play()
    bpy.ops.screen.animation_cancel(restore_frame=False)
    for frame in range(1, 41):
        scene.frame_set(frame)
    screen = bpy.context.screen
    for area in screen.areas:
        if area.type == "PROPERTIES":
            area.spaces.active.context = "PHYSICS"
            properties = area
        if area.type == "VIEW_3D":
            view = area.spaces.active.region_3d
            view.view_location, view.view_distance = (0, 0, 0.9), 4.2
            view.view_rotation = (0.78, 0.6, 0.1, 0.13)
            area.spaces.active.show_region_ui = False
            view_area = area
    with bpy.context.temp_override(area=view_area, region=next(region for region in view_area.regions if region.type == "WINDOW")):
        bpy.ops.view3d.view_axis(type="FRONT")
        view.view_location, view.view_distance = (0, 0, 0.95), 3.4
    properties.tag_redraw()
    bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=3)
    bpy.ops.screen.screenshot(filepath=str(FOLDER / "panel.png"))
    bpy.ops.exmat.stop()


def draw_motion(figure, scene):
    """Moments of the baked motion, beside each other."""
    bpy.ops.exmat.bake_keys()
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.display.shading.light = "STUDIO"
    scene.display.shading.show_cavity = True
    scene.display.shading.show_shadows = True
    scene.render.film_transparent = False
    scene.render.resolution_x, scene.render.resolution_y = 420, 480
    scene.world.color = (1, 1, 1)
    scene.view_settings.view_transform = "Standard"
    camera = scene.camera
    camera.location, camera.rotation_euler = (0, -6, 0.95), (np.pi / 2, 0, 0)
    camera.data.type, camera.data.ortho_scale = "ORTHO", 2.25
    pictures = []
    for frame in SHOWN:
        scene.frame_set(frame)
        scene.render.filepath = str(FOLDER / f"frame_{frame}.png")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        pixels = np.empty(image.size[0] * image.size[1] * 4, "f4")
        image.pixels.foreach_get(pixels)
        pictures.append(pixels.reshape(image.size[1], image.size[0], 4))
    sheet = np.concatenate(pictures, 1)
    image = bpy.data.images.new("sheet", sheet.shape[1], sheet.shape[0])
    image.pixels.foreach_set(sheet.ravel())
    image.filepath_raw, image.file_format = str(FOLDER / "motion.png"), "PNG"
    image.save()


def after_start():
    try:
        main()
    except Exception:
        traceback.print_exc()
    bpy.ops.wm.quit_blender()


bpy.context.preferences.view.show_splash = False
bpy.app.timers.register(after_start, first_interval=1)
