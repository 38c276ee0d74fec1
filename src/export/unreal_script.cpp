#include "export/unreal.h"

namespace tessera {

// Its calls are those of Unreal Engine 5's Python API (unreal.MaterialEditingLibrary, unreal.AssetImportTask and
// others).
const char* const kUnrealScript =
    R"py("""Imports the scene of tessera that lies beside this file into the open project of Unreal Engine 5 and places it in the
open level. In the editor: Tools, Execute Python Script. The plugins "Python Editor Script Plugin" and "Editor Scripting
Utilities" must be on. Assets go to /Game/Tessera/NAME, or NAME_level_N of a coarser level; set
TESSERA_FOLDER to change that. See docs/unreal.md of tessera."""
import json
import os
import re

import unreal

SOURCE = os.path.dirname(os.path.abspath(__file__))
DITHER = "/Engine/Functions/Engine_MaterialFunctions02/Utility/DitherTemporalAA"
FEATURES = 8

assets = unreal.EditorAssetLibrary
tools = unreal.AssetToolsHelpers.get_asset_tools()
editing = unreal.MaterialEditingLibrary


def import_file(name, folder):
    """Imports a file and returns the assets that it became."""
    task = unreal.AssetImportTask()
    task.set_editor_property("filename", os.path.join(SOURCE, name))
    task.set_editor_property("destination_path", folder)
    task.set_editor_property("automated", True)
    task.set_editor_property("replace_existing", True)
    task.set_editor_property("save", False)
    tools.import_asset_tasks([task])
    paths = list(task.get_editor_property("imported_object_paths"))
    imported = [assets.load_asset(path) for path in paths or assets.list_assets(folder, recursive=True)]
    if not imported:
        raise RuntimeError("Unreal did not import " + os.path.join(SOURCE, name))
    return imported


def import_map(name, folder):
    """Imports a map as one channel in BC4, exactly as it is: no colour space, no mipmaps, which would mix triangles."""
    textures = [each for each in import_file(name, folder) if isinstance(each, unreal.Texture2D)]
    if not textures:
        raise RuntimeError("Unreal imported no texture from " + name)
    texture = textures[0]
    for key, value in (
        ("srgb", False),
        ("compression_settings", unreal.TextureCompressionSettings.TC_ALPHA),
        ("mip_gen_settings", unreal.TextureMipGenSettings.TMGS_NO_MIPMAPS),
        ("filter", unreal.TextureFilter.TF_BILINEAR),
        ("address_x", unreal.TextureAddress.TA_CLAMP),
        ("address_y", unreal.TextureAddress.TA_CLAMP),
        ("never_stream", True),
    ):
        texture.set_editor_property(key, value)
    assets.save_loaded_asset(texture)
    return texture


def import_mesh(name, folder):
    """Imports a mesh whose places in the textures keep their precision: by default Unreal rounds them to 16 bits, which is
    more than a texel of a large texture."""
    meshes = [each for each in import_file(name, folder) if isinstance(each, unreal.StaticMesh)]
    if not meshes:
        raise RuntimeError("Unreal imported no static mesh from " + name)
    mesh = meshes[0]
    editor = unreal.get_editor_subsystem(unreal.StaticMeshEditorSubsystem)
    nanite = mesh.get_editor_property("nanite_settings")
    nanite.set_editor_property("enabled", False)  # it would round those places, too
    mesh.set_editor_property("nanite_settings", nanite)
    build = editor.get_lod_build_settings(mesh, 0)
    build.set_editor_property("use_full_precision_u_vs", True)
    build.set_editor_property("generate_lightmap_u_vs", False)
    build.set_editor_property("remove_degenerates", False)
    editor.set_lod_build_settings(mesh, 0, build)
    return mesh


def expression(material, kind, x, y, **properties):
    node = editing.create_material_expression(material, kind, x, y)
    for key, value in properties.items():
        node.set_editor_property(key, value)
    return node


def connect(source, output, target, target_input):
    if not editing.connect_material_expressions(source, output, target, target_input):
        raise RuntimeError("the nodes of the material could not be connected at " + target_input)


def map_parameter(material, name, texture, y):
    return expression(
        material, unreal.MaterialExpressionTextureSampleParameter2D, -1200, y, parameter_name=name, texture=texture,
        sampler_type=unreal.MaterialSamplerType.SAMPLERTYPE_ALPHA)


def make_material(name, folder, code, maps):
    """Creates the material of one decoder. `maps`: textures of one part, which instances replace."""
    material = tools.create_asset(name, folder, unreal.Material, unreal.MaterialFactoryNew())
    material.set_editor_property("shading_model", unreal.MaterialShadingModel.MSM_UNLIT)
    material.set_editor_property("blend_mode", unreal.BlendMode.BLEND_MASKED)
    material.set_editor_property("two_sided", True)

    inputs = []  # names, and the nodes and outputs that they are connected to
    for i in range(FEATURES):
        inputs.append(("texel%d" % i, map_parameter(material, "feature_%d" % i, maps[i], 260 * i), "R"))
        for j, kind in enumerate(("low", "span")):
            node = expression(material, unreal.MaterialExpressionScalarParameter, -900 + 200 * j, 260 * i + 100,
                              parameter_name="%s_%d" % (kind, i))
            inputs.append(("%s%d" % (kind, i), node, ""))
    # From the surface to the camera, in the axes of the mesh, so that its actor may be moved and turned.
    camera = expression(material, unreal.MaterialExpressionCameraVectorWS, -1200, -200)
    turned = expression(material, unreal.MaterialExpressionTransform, -1000, -200,
                        transform_source_type=unreal.MaterialVectorCoordTransformSource.TRANSFORMSOURCE_WORLD,
                        transform_type=unreal.MaterialVectorCoordTransform.TRANSFORM_LOCAL)
    connect(camera, "", turned, "")
    inputs.append(("toCamera", turned, ""))

    variables = "const float3 viewDirection = -toCamera;\n"
    for variable, kind in (("texels", "texel"), ("low", "low"), ("span", "span")):
        for letter, first in (("A", 0), ("B", 4)):
            values = ", ".join("%s%d" % (kind, first + i) for i in range(4))
            variables += "const float4 %s%s = float4(%s);\n" % (variable, letter, values)
    custom = expression(material, unreal.MaterialExpressionCustom, -300, 0, code=variables + code,
                        description="decoder of tessera", output_type=unreal.CustomMaterialOutputType.CMOT_FLOAT3)
    listed = []
    for input_name, _, _ in inputs:
        each = unreal.CustomInput()
        each.set_editor_property("input_name", input_name)
        listed.append(each)
    custom.set_editor_property("inputs", listed)
    for input_name, node, output in inputs:
        connect(node, output, custom, input_name)
    editing.connect_material_property(custom, "", unreal.MaterialProperty.MP_EMISSIVE_COLOR)

    # Half-transparent texels are dithered; temporal antialiasing blends the frames.
    opacity = map_parameter(material, "opacity", maps[FEATURES], 260 * FEATURES)
    dither = expression(material, unreal.MaterialExpressionMaterialFunctionCall, -300, 260 * FEATURES)
    dither.set_material_function(assets.load_asset(DITHER))
    connect(opacity, "R", dither, "Alpha Threshold")
    editing.connect_material_property(dither, "Result", unreal.MaterialProperty.MP_OPACITY_MASK)
    editing.recompile_material(material)
    assets.save_loaded_asset(material)
    return material


def make_instance(name, folder, material, maps, part):
    instance = tools.create_asset(name, folder, unreal.MaterialInstanceConstant,
                                  unreal.MaterialInstanceConstantFactoryNew())
    editing.set_material_instance_parent(instance, material)
    for i in range(FEATURES):
        editing.set_material_instance_texture_parameter_value(instance, "feature_%d" % i, maps[i])
        editing.set_material_instance_scalar_parameter_value(instance, "low_%d" % i, part["low"][i])
        editing.set_material_instance_scalar_parameter_value(instance, "span_%d" % i, part["span"][i])
    editing.set_material_instance_texture_parameter_value(instance, "opacity", maps[FEATURES])
    editing.update_material_instance(instance)
    assets.save_loaded_asset(instance)
    return instance


def place(mesh, part):
    actors = unreal.get_editor_subsystem(unreal.EditorActorSubsystem)
    actor = actors.spawn_actor_from_object(mesh, unreal.Vector(*part["location"]))
    actor.set_actor_label(part["name"])
    actor.set_folder_path("Tessera")


def main():
    with open(os.path.join(SOURCE, "scene.json"), encoding="utf-8") as file:
        scene = json.load(file)
    if scene.get("format") != "tessera-unreal" or scene.get("version") != 1:
        raise RuntimeError("scene.json is of another version than this script")
    name = re.sub(r"\W", "_", scene["name"]) or "scene"
    if scene["level"] > 0:
        name += "_level_%d" % scene["level"]
    root = os.environ.get("TESSERA_FOLDER", "/Game/Tessera/" + name)
    assets.delete_directory(root)
    materials = {}
    with unreal.ScopedSlowTask(len(scene["parts"]), "Importing " + name) as progress:
        progress.make_dialog(True)
        for part in scene["parts"]:
            if progress.should_cancel():
                break
            progress.enter_progress_frame(1, part["name"])
            folder = root + "/" + part["name"]
            maps = [import_map(image, folder + "/maps") for image in part["images"]]
            mesh = import_mesh(part["mesh"], folder)
            number = part["decoder"]
            if number not in materials:
                with open(os.path.join(SOURCE, scene["decoders"][number]["custom_node"]), encoding="utf-8") as file:
                    materials[number] = make_material("M_decoder_%d" % number, root, file.read(), maps)
            mesh.set_material(0, make_instance("MI_" + part["name"], folder, materials[number], maps, part))
            assets.save_loaded_asset(mesh)
            place(mesh, part)


main()
)py";

}  // namespace tessera
