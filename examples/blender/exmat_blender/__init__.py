"""Example-based elastic materials in Blender: shape keys become examples, the body follows the timeline.

The modules asset, columns, fault, frame, library, player, point_cache and spring do without Blender; importing them
alone does not import bpy.
"""
bl_info = {
    "name": "exmat",
    "author": "The exmat authors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "Properties > Physics > exmat",
    "description": "Elastic bodies that shape keys draw, live and baked",
    "category": "Physics",
}


def modules():
    from . import importing, jobs, operators, panel, playing, properties

    return properties, operators, panel, playing, importing, jobs


def register():
    for module in modules()[:-1]:
        module.register()


def unregister():
    for module in reversed(modules()):
        module.unregister()
