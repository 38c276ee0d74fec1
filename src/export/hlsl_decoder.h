// The network of a part of `mesh` in HLSL, with its weights as constants, for materials of Unreal Engine.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "scene/axes.h"
#include "tiles/dense_layer.h"
#include "tiles/tileset.h"

namespace tessera {

// The linear map of directions from Unreal's axes to the scene's. Unreal's are left-handed with Z up: X is east, Y
// south and Z up here, so that (x, y, z) of the tile frame is (x, -y, z). Source: Unreal Engine maps (x, y, z) of glTF,
// which is right-handed with Y up, to (x, z, y) when it imports a file (FAccessor::GetCoordArray of its module
// GLTFCore), and x, y and z of glTF are east, up and south here. Cesium for Unreal places georeferenced tiles in the
// same axes.
Mat3d sceneFromUnreal(const Similarity& tileFromScene);

// Returns statements that compute a colour and return it in linear light, as the code of a Custom node does, which
// stands in the body of a function. They read these variables, which are the node's inputs:
//   float4 texelsA, texelsB   texels of features 0 to 3 and 4 to 7, 0 to 1, as they are sampled
//   float4 lowA, lowB, spanA, spanB   the ranges of features: a feature is low + span · texel
//   float3 viewDirection      from the camera to the surface, in Unreal's axes, of any length
// The colour is the one that docs/tile-format.md, section 8, defines. `directions`: sceneFromUnreal().
std::string writeHlslStatements(const std::vector<DenseLayer>& decoder, const Mat3d& directions);

// Returns the same as functions of these variables, for shaders that include it:
//   float3 tesseraColour(texelsA, texelsB, lowA, lowB, spanA, spanB, viewDirection)         as sRGB
//   float3 tesseraLinearColour(texelsA, texelsB, lowA, lowB, spanA, spanB, viewDirection)   in linear light
std::string writeHlslFunctions(const std::vector<DenseLayer>& decoder, const Mat3d& directions);

// The same numbers as JSON.
nlohmann::ordered_json describeDecoder(const std::vector<DenseLayer>& decoder, const Mat3d& directions);

}  // namespace tessera
