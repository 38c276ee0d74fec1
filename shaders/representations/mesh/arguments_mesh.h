// The arguments of the shaders that draw contents of `mesh`, declared once for C++ and GLSL as in
// shaders/compute/arguments.h.
#ifndef TESSERA_SHADERS_REPRESENTATIONS_MESH_ARGUMENTS_MESH_H
#define TESSERA_SHADERS_REPRESENTATIONS_MESH_ARGUMENTS_MESH_H
#include "../../compute/arguments_hash_grid.h"
#include "../../render/arguments_view.h"
TESSERA_BEGIN_ARGUMENTS

// Of a texel (kMeshFeatures).
#define TESSERA_MESH_FEATURES 8

// A PatchSet.
struct MeshPartArguments {
  UintPointer vertices;     // [patches][4][3] numbers of 16 bits, two in a word
  UintPointer features[4];  // textures in BC5, of two features each
  UintPointer opacities;    // texture in BC4
  Bits64 layers;            // LayersPointer
  Bits64 weights;           // FloatPointer
  float low[TESSERA_MESH_FEATURES];
  float span[TESSERA_MESH_FEATURES];  // a texel of v stands for low + span · v
  uint layerCount;
  uint patchEdge;      // texels
  uint patchesAcross;  // patches in a row of a texture
  uint pairs;          // patches with two triangles, which come first
};
TESSERA_SIZE(MeshPartArguments, 144);

#ifdef __cplusplus
using MeshPartPointer = uint64_t;
#else
layout(buffer_reference, std430, buffer_reference_align = 8) buffer MeshPartPointer { MeshPartArguments value; };
#endif

// A part in a view. All is relative to the eye, so that single precision suffices; scene units.
struct PlacedPartArguments {
  MeshPartPointer part;
  float origin[3];  // the number v of a vertex along an axis stands for origin + step · v
  float step;
  float low[2];  // hits beside these limits in x and y do not count
  float high[2];
  uint isBackground;  // hits count only behind the scene's box
  uint unused;
  float share[2];  // drawn in pixels whose threshold is in this interval; 0 and 1: in all
};
TESSERA_SIZE(PlacedPartArguments, 56);

#ifdef __cplusplus
using PlacedPartsPointer = uint64_t;
#else
layout(buffer_reference, std430, buffer_reference_align = 8) buffer PlacedPartsPointer {
  PlacedPartArguments values[];
};
#endif

// A pinhole camera in which triangles are rasterised (src/representations/mesh/vulkan/raster_view.h).
struct RasterArguments {
  float rasterFromScene[9];  // rotation, row-major
  float focal[2];            // pixels
  float centre[2];
  float near;  // along the axis, scene units
  uint width;
  uint height;
};
TESSERA_SIZE(RasterArguments, 64);

// A fragment of a triangle, in the list of its pixel.
struct LayerNode {
  uint next;  // number of the next node + 1; 0: none
  uint part;
  uint triangle;
};
TESSERA_SIZE(LayerNode, 12);

#ifdef __cplusplus
using LayerNodesPointer = uint64_t;
#else
layout(buffer_reference, std430, buffer_reference_align = 4) buffer LayerNodesPointer { LayerNode values[]; };
#endif

// The lists of all fragments of the raster's rows from firstRow to lastRow, and of the row after it.
struct LayerListArguments {
  UintPointer heads;    // [height][width]: number of the first node + 1; 0: no fragments
  UintPointer counter;  // fragments so far, which may exceed the capacity
  LayerNodesPointer nodes;
  uint capacity;
  uint firstRow;
  uint lastRow;
  uint unused;
};
TESSERA_SIZE(LayerListArguments, 40);

// What all triangles of a raster have in common.
struct MeshViewArguments {
  ViewArguments view;
  RasterArguments raster;
  LayerListArguments lists;
  PlacedPartsPointer parts;
  UintPointer sky;   // bytes of [6][edge][edge][3]; optional
  uint skyEdge;
  uint isSamePixels;  // whether the pixels of the raster are those of the view
  // [height][width][2] of the raster: part + 1 (0: none) and triangle; or [4], if fragments are decoded: bits of the colour
  // and of the distance (0: none).
  UintPointer visible;
  UintPointer solid;    // optional, as `nearest`: of the nearest layer that hides half of what is behind
  UintPointer nearest;  // [height][width]: 1 / depth of the nearest half-transparent layer, bits of a float; 0: none
  float jitter[2];      // offset of what pixels show, in pixels
  uint frame;           // number of the frame, for dithering
  uint unused;
  FloatPointer noise;  // [pixels of the view]: 1 where dithering decides what is visible, otherwise 0
};
TESSERA_SIZE(MeshViewArguments, 344);

#ifdef __cplusplus
using MeshViewPointer = uint64_t;
#else
layout(buffer_reference, std430, buffer_reference_align = 8) buffer MeshViewPointer { MeshViewArguments value; };
#endif

// Blends the image of a view with the images before it. A pixel of history is its premultiplied colour, its opacity and
// how many frames it stands for.
struct BlendFramesArguments {
  ViewArguments view;     // colour, opacity and depth of the frame; the first two are replaced
  FloatPointer history;   // [pixels][5]; optional: there is none
  FloatPointer blended;   // [pixels][5]: the next history
  FloatPointer noise;     // optional: MeshViewArguments::noise; pixels without noise are not blended
  float previousFromCamera[9];  // rotation, row-major
  float shift[3];               // of the eye, in the axes of the previous camera, world units
  float focal[2];               // of the previous camera, a pinhole, in pixels
  float centre[2];
  uint restingFrames;      // how many frames of the same view the history counts as at most; 0: the view has changed
  float smallestWeight;    // of the frame if it has
  float largestDeviation;  // of the history from the mean around the pixel, in standard deviations
  uint unused;
};
TESSERA_SIZE(BlendFramesArguments, 272);

// The inference of the textures of a part (src/representations/mesh/content/infer_maps.h).
struct InferMapsArguments {
  MeshPartPointer part;  // whose textures are written
  UintPointer table;     // of the encoder: numbers in fp16, two in a word
  Bits64 layers;         // LayersPointer, of the encoder's network
  Bits64 weights;        // FloatPointer
  uint layerCount;
  uint levelCount;
  uint features;  // of an entry of the table
  uint blocks;    // of 4×4 texels in all patches
  uint places;    // along an edge of a texel, which is their mean
  float opacityOffset;
  float opaqueFrom;
  float transparentBelow;
  float unitOrigin[3];  // the number v of a vertex along an axis stands for unitOrigin + unitStep · v in the unit cube
  float unitStep[3];
  LevelArguments levels[TESSERA_MAX_LEVELS];
};
TESSERA_SIZE(InferMapsArguments, 88 + 24 * TESSERA_MAX_LEVELS);

// The triangles of one part.
struct DrawTrianglesArguments {
  MeshViewPointer view;
  uint part;  // number in MeshViewArguments::parts
  uint unused;
};
TESSERA_SIZE(DrawTrianglesArguments, 16);

TESSERA_END_ARGUMENTS
#endif
