#include "export/hlsl_decoder.h"

#include <fmt/format.h>

#include <array>

#include "base/check.h"
#include "representations/mesh/content/mesh_content.h"

namespace tessera {
namespace {

constexpr std::array<char, 4> kComponents = {'x', 'y', 'z', 'w'};

// Returns a literal of a finite number that gives the same float.
std::string literal(double value) {
  std::string text = fmt::format("{:.9g}", value == 0 ? 0.0 : value);  // no -0
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

std::string vectorLiteral(const std::array<double, 4>& values) {
  return fmt::format("float4({}, {}, {}, {})", literal(values[0]), literal(values[1]), literal(values[2]),
                     literal(values[3]));
}

// Returns the names of the decoder's inputs: features, then harmonics.
std::vector<std::string> inputNames() {
  std::vector<std::string> names;
  for (uint32_t i = 0; i < kMeshFeatures; ++i)
    names.push_back(fmt::format("features{}.{}", i < 4 ? 'A' : 'B', kComponents[i % 4]));
  for (uint32_t i = 0; i < kMeshHarmonics; ++i) names.push_back(fmt::format("harmonic{}", i));
  return names;
}

// Returns the statements of a layer, four outputs at a time, and replaces the names of its inputs by those of its
// outputs.
std::string writeLayer(const DenseLayer& layer, size_t number, bool isLast, std::vector<std::string>& names) {
  CHECK(names.size() == layer.inputs);
  std::string text;
  std::vector<std::string> outputs;
  for (uint32_t first = 0; first < layer.outputs; first += 4) {
    const std::string vector = fmt::format("layer{}_{}", number, first / 4);
    const auto column = [&](const auto& valueAt) {
      std::array<double, 4> values{};
      for (uint32_t i = 0; i < 4 && first + i < layer.outputs; ++i) values[i] = double{valueAt(first + i)};
      return vectorLiteral(values);
    };
    text += fmt::format("float4 {} = {};\n", vector, column([&](uint32_t output) { return layer.biases[output]; }));
    for (uint32_t input = 0; input < layer.inputs; ++input) {
      const auto weight = [&](uint32_t output) { return layer.weights[output * layer.inputs + input]; };
      text += fmt::format("{} += {} * {};\n", vector, column(weight), names[input]);
    }
    if (!isLast) text += fmt::format("{0} = max({0}, 0.0);\n", vector);
    for (uint32_t i = 0; i < 4 && first + i < layer.outputs; ++i)
      outputs.push_back(fmt::format("{}.{}", vector, kComponents[i]));
  }
  names = std::move(outputs);
  return text;
}

// The real spherical harmonics of scene/spherical_harmonics.h up to degree 2.
constexpr const char* kHarmonics =
    R"(const float harmonic0 = 0.282094791;
const float harmonic1 = -0.488602512 * d.y;
const float harmonic2 = 0.488602512 * d.z;
const float harmonic3 = -0.488602512 * d.x;
const float harmonic4 = 1.09254843 * d.x * d.y;
const float harmonic5 = -1.09254843 * d.y * d.z;
const float harmonic6 = 0.946174696 * d.z * d.z - 0.315391565;
const float harmonic7 = -1.09254843 * d.x * d.z;
const float harmonic8 = 0.546274215 * (d.x * d.x - d.y * d.y);
)";

// sRGB to linear light, IEC 61966-2-1.
constexpr const char* kReturnLinear =
    R"(return lerp(pow((srgb + 0.055) / 1.055, 2.4), srgb / 12.92, step(srgb, float3(0.04045, 0.04045, 0.04045)));
)";

// Returns the statements up to the colour, `float3 srgb`.
std::string writeColour(const std::vector<DenseLayer>& decoder, const Mat3d& directions) {
  std::string text =
      "const float4 featuresA = lowA + spanA * texelsA;\nconst float4 featuresB = lowB + spanB * texelsB;\n";
  text += "// The direction in the axes of the scene, which are right-handed.\nconst float3 d = normalize(float3(";
  for (int row = 0; row < 3; ++row) {
    text += fmt::format("{}dot(float3({}, {}, {}), viewDirection)", row == 0 ? "" : ",\n  ",
                        literal(directions(row, 0)), literal(directions(row, 1)), literal(directions(row, 2)));
  }
  text += std::string("));\n") + kHarmonics;
  std::vector<std::string> names = inputNames();
  for (size_t i = 0; i < decoder.size(); ++i) text += writeLayer(decoder[i], i, i + 1 == decoder.size(), names);
  CHECK(names.size() == 3u);
  return text +
         fmt::format("const float3 srgb = 1.0 / (1.0 + exp(-float3({}, {}, {})));\n", names[0], names[1], names[2]);
}

}  // namespace

Mat3d sceneFromUnreal(const Similarity& tileFromScene) {
  return tileFromScene.rotation.transpose() * Vec3d(1, -1, 1).asDiagonal();
}

std::string writeHlslStatements(const std::vector<DenseLayer>& decoder, const Mat3d& directions) {
  return "// Decoder of a scene of tessera: the code of a Custom node that returns float3, with the inputs texelsA, "
         "texelsB,\n"
         "// lowA, lowB, spanA, spanB (float4) and viewDirection (float3, from the camera to the surface). See "
         "unreal.md.\n" +
         writeColour(decoder, directions) + kReturnLinear;
}

std::string writeHlslFunctions(const std::vector<DenseLayer>& decoder, const Mat3d& directions) {
  const auto head = [](const char* name) {
    return fmt::format(
        "float3 {}(float4 texelsA, float4 texelsB, float4 lowA, float4 lowB, float4 spanA, float4 spanB,\n"
        "    float3 viewDirection)\n{{\n",
        name);
  };
  return "// Decoder of a scene of tessera. Texels are those of features 0 to 3 and 4 to 7, as they are sampled; "
         "viewDirection\n"
         "// points from the camera to the surface, in Unreal's axes.\n\n// The colour as sRGB, 0 to 1.\n" +
         head("tesseraColour") + writeColour(decoder, directions) +
         "return srgb;\n}\n\n// The same in linear light, which is what an unlit material emits.\n" +
         head("tesseraLinearColour") +
         "const float3 srgb = tesseraColour(texelsA, texelsB, lowA, lowB, spanA, spanB, viewDirection);\n" +
         kReturnLinear + "}\n";
}

nlohmann::ordered_json describeDecoder(const std::vector<DenseLayer>& decoder, const Mat3d& directions) {
  nlohmann::ordered_json json = {{"features", kMeshFeatures}, {"harmonics", kMeshHarmonics}};
  for (int row = 0; row < 3; ++row)
    json["scene_from_unreal"].push_back({directions(row, 0), directions(row, 1), directions(row, 2)});
  for (const DenseLayer& layer : decoder) {
    json["layers"].push_back(
        {{"inputs", layer.inputs}, {"outputs", layer.outputs}, {"weights", layer.weights}, {"biases", layer.biases}});
  }
  return json;
}

}  // namespace tessera
